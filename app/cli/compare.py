"""`gearsig compare`: comparison of a simulation with a recording, without looking for causes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.console import typed_command
from gearsig.errors import InputError, options_named

if TYPE_CHECKING:
    from gearsig.comparison import Comparison
    from gearsig.recording import Recording
    from gearsig.rig import Rig


PAGE, DATA, TABLE = "compare.html", "compare.json", "orders.csv"
"""Files that -o writes."""

SimulationRigOption = Annotated[
    Path | None,
    typer.Option(
        "--sim-rig",
        metavar="FILE",
        help="Rig file of the simulation. Default: NAME.toml next to it, else the gears of --rig.",
    ),
]


def compare(
    simulation: Annotated[Path, typer.Argument(help="Simulated signals: any file that gearsig reads.")],
    recording: Annotated[Path, typer.Argument(help="The recording to compare with.")],
    rig: options.RigOption = None,
    output: Annotated[Path | None, options.output_option(f"Folder for {PAGE}, {DATA} and {TABLE}.")] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            metavar="SIM=RECORDED",
            help="Channels to compare; repeatable. Default: those of equal name, or the only channel of each.",
        ),
    ] = None,
    align: Annotated[
        str, typer.Option("--align", help="auto, marks or correlation; auto: marks if both records have them.")
    ] = "auto",
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    simulation_rig: SimulationRigOption = None,
    simulation_fs: Annotated[
        float | None, options.rate_option("--sim-fs", "Sampling rate of the simulation, like --fs.")
    ] = None,
    simulation_speed_rpm: Annotated[
        float | None, typer.Option("--sim-speed-rpm", metavar="RPM", help="Speed of the simulation, like --speed-rpm.")
    ] = None,
) -> None:
    """Compare a simulation with a recording by order, band and angle, and state the repeatability of each figure.

    Both are resampled over shaft angle, so speed, sampling rate and length may differ. It prints the levels of the mesh
    harmonics and the similarity of the synchronous averages; the page adds order spectra, averages tooth by tooth and
    band levels. It names no cause.

    Example: gearsig compare model.h5 measured.csv --rig gearbox.toml -o comparison
    """
    from rich.console import Console

    from gearsig.checks import one_of
    from gearsig.comparison import ALIGN
    from gearsig.comparison import compare as compare_records
    from gearsig.report import check_writable, comparison_text

    one_of(align, "--align", ALIGN)
    if output is not None:
        check_writable(output)
    machine = options.open_rig(rig, recording)
    with Console(stderr=True).status("reading") as status:
        recorded = options.open_recording(
            recording, machine, fs, options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
        )
        simulated = open_simulation(simulation, simulation_rig, machine, simulation_fs, simulation_speed_rpm)
        pairs = [read_pair(text, simulated, recorded) for text in channel or ()]
        status.update("comparing")
        result = compare_records(simulated, recorded, channels=pairs, align_by=align)
        if output is not None:
            status.update("drawing")
            write_comparison(result, output, typed_command())
    typer.echo(comparison_text(result))
    if output is not None:
        typer.echo(f"\nOpen {output / PAGE} in a browser.")


def open_simulation(
    path: Path, rig: Path | None, machine: Rig | None, sampling_rate_hz: float | None, speed_rpm: float | None
) -> Recording:
    """Read the simulation with its own rig file; without one, its channels are used as the file has them.

    The recording's rig then supplies only the gears: its sensor scales and tachometer belong to the measurement.
    """
    from gearsig.comparison import SIMULATION_OPTIONS, for_simulation

    opened_rig = options.open_rig(rig, path)
    its_rig = opened_rig if opened_rig is not None or machine is None else for_simulation(machine)
    speed = options.stated_speed(speed_rpm, None, 1)
    with options_named(SIMULATION_OPTIONS):
        return options.open_recording(path, its_rig, sampling_rate_hz, speed)


def read_pair(text: str, simulated: Recording, recorded: Recording) -> tuple[str, str]:
    """Return the two channels of "SIM=RECORDED", or of one name that both records have; names may contain "="."""
    if text in simulated.channel_names and text in recorded.channel_names:
        return text, text
    parts = text.split("=")
    cuts = [("=".join(parts[:i]), "=".join(parts[i:])) for i in range(1, len(parts))]
    known = [cut for cut in cuts if cut[0] in simulated.channel_names and cut[1] in recorded.channel_names]
    if known:
        return known[0]
    if len(parts) != 2:
        raise InputError(
            f"{text!r} is not SIM=RECORDED",
            where="--channel",
            allowed=f"simulation: {', '.join(simulated.channel_names)}; recording: {', '.join(recorded.channel_names)}",
        )
    return parts[0].strip(), parts[1].strip()


def write_comparison(comparison: Comparison, folder: Path, command: str) -> None:
    """Write page, data and table: all are built before the first is written, and each appears once it is complete."""
    from gearsig.report import comparison_page, comparison_to_json, orders_csv, write_folder

    texts = {
        TABLE: orders_csv(comparison),
        DATA: comparison_to_json(comparison),
        PAGE: comparison_page(comparison, command=command),
    }
    write_folder(folder, texts=texts)
