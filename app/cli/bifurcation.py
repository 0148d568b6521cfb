"""`gearsig bifurcation`: how the motion of a model changes over one parameter."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import progress_bar, stopped
from app.cli.options import (
    EffectOption,
    PresetOption,
    RateOption,
    SeedOption,
    SetOption,
    SimulatedSpeedOption,
    SimulatedTorqueOption,
    SimulationChoices,
    read_request,
)

if TYPE_CHECKING:
    from app.bifurcation import BifurcationRequest, Found


MAX_REASONS = 5


def bifurcation(
    model: Annotated[str, typer.Argument(help="Model, e.g. cracked; `gearsig simulate --list` shows them.")],
    vary: Annotated[
        str,
        typer.Option(
            "--vary",
            metavar="NAME=VALUES",
            help="speed=600..3000rpm:100 (from, to, how many), torque=5..50Nm:40, half_backlash_um=0..60:40, "
            "root_crack=0..4mm:20. NAME is speed, torque, a parameter or an effect.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for figure, table and summary.")
    ],
    preset: PresetOption = "",
    settings: SetOption = None,
    effects: EffectOption = None,
    speed: SimulatedSpeedOption = None,
    torque: SimulatedTorqueOption = None,
    section: Annotated[
        str,
        typer.Option("--section", metavar="CYCLE", help="A point once per mesh cycle (mesh) or revolution (shaft)."),
    ] = "mesh",
    phase: Annotated[float, typer.Option("--phase", help="Place in the cycle at which the point lies, 0 to 1.")] = 0.0,
    signal: Annotated[
        str,
        typer.Option(
            "--signal",
            help="transmission_error_m, 'driver y', mesh_force_n …, or a channel with its noise: a1.",
        ),
    ] = "transmission_error_m",
    points: Annotated[
        int | None, typer.Option("--points", help="Points at each value; default 100, 400 with --kind.")
    ] = (None),
    direction: Annotated[
        str,
        typer.Option(
            "--direction",
            help="up or down, each value from where the last one ended; both shows hysteresis; rest: each from rest.",
        ),
    ] = "both",
    kind: Annotated[
        bool,
        typer.Option(
            "--kind",
            help="Also the kind of motion at each value, told over ranges: Lyapunov exponent, 0–1 test. Takes longer.",
        ),
    ] = False,
    fs: RateOption = "20480Hz",
    seed: SeedOption = 0,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", help="Processes; default: one per processor.")] = None,
) -> None:
    """Draw a bifurcation diagram: Poincaré points of the steady motion over speed, load, backlash, or anything else.

    At each value the transient is left out: 8 time constants of the machine's slowest decay. It can be stopped with
    Ctrl-C at any time; the same command goes on from what is complete.

    Example: gearsig bifurcation cracked --preset symmetric_50_50 --torque 20Nm --vary speed=1600..2400rpm:41 -o jump
    """
    request = read_request(model, preset, settings, effects, speed, torque, "1s", fs, seed)
    wanted = wanted_of(request, vary, section, signal, points, direction, phase, with_kind=kind)
    found = _run(wanted, output, jobs)
    _tell(wanted, found, output)


def wanted_of(
    request: SimulationChoices,
    vary: str,
    section: str,
    signal: str,
    n_points: int | None,
    direction: str,
    phase: float,
    *,
    with_kind: bool,
) -> BifurcationRequest:
    """Return what the options ask for."""
    from app.bifurcation import MIN_FOR_KIND, BifurcationRequest
    from app.cli.sweep import sweep_of
    from sims.cracked import Branch

    n = n_points if n_points is not None else MIN_FOR_KIND if with_kind else 100
    sweep = sweep_of(request, [vary], common_seed=True, extension=".h5")
    wanted = BifurcationRequest(Branch(sweep, signal, section, n), direction, phase, with_kind)
    wanted.branch.check_signal()
    return wanted


def _run(wanted: BifurcationRequest, output: Path, jobs: int | None) -> Found:
    from app.bifurcation import complete, n_complete, run_folder

    try:
        with progress_bar("simulating", wanted.n_values) as show:
            return run_folder(wanted, output, n_processes=jobs, on_progress=show)
    except KeyboardInterrupt:
        n = n_complete(wanted, output)
        if n:
            _tell(wanted, complete(wanted, output), output)
        raise stopped(f"{n} of {wanted.n_values} values are in {output}") from None


def _tell(wanted: BifurcationRequest, found: Found, output: Path) -> None:
    from app.bifurcation import (
        NAMES,
        coexistence_lines,
        measured_of,
        motion_lines,
        parameter_words,
        summary,
        write_results,
    )

    paths = write_results(wanted, found, output)
    reasons = [(name, one) for name, kept in found.items() for one in kept if one.reason]
    for name, one in reasons[:MAX_REASONS]:
        typer.echo(f"{NAMES[name]}, {one.value:g}: {one.reason}", err=True)
    if len(reasons) > MAX_REASONS:
        typer.echo(f"… and {len(reasons) - MAX_REASONS} more: see {paths[2].name}", err=True)
    unit = parameter_words(wanted.branch)[1]
    for name, kept in found.items():
        values = measured_of(kept)
        periods = sorted({one.period for one in values})
        seen = ", ".join("none within 16 cycles" if p == 0 else str(p) for p in periods)
        most = max((one.separated_share for one in values), default=0.0)
        typer.echo(f"{NAMES[name]}: {len(values)} values; periods in cycles: {seen}; teeth apart up to {most:.0%}")
        for line in motion_lines(kept, unit):
            typer.echo(f"  {line}")
    for line in coexistence_lines(summary(wanted, found), unit):
        typer.echo(line)
    typer.echo(f"{paths[0]} (figure), {paths[1].name} (points), {paths[2].name} (values).")
