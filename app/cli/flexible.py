"""Commands that compute with finite elements: a pair of gears, one gear's body, the growth of a root crack.

`gearsig flexible`: maps, speed sweeps and spectra. `gearsig gear-body`: mesh, modes, stress, reduction. `gearsig
growth`: how fast a root crack grows, and how many revolutions are left.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.console import progress_bar
from app.cli.quantities import quantity, span
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.checks import FloatArray
    from sims.reduced_fe import GrowthLaw


MODEL = "reduced-fe"


def flexible(
    output: Annotated[Path, options.output_option("Folder for figures and tables.")],
    preset: options.PresetOption = "",
    settings: options.SetOption = None,
    effects: options.EffectOption = None,
    torques: Annotated[str, typer.Option("--torques", metavar="LIST", help="Torques of the sweeps.")] = "85,170,340Nm",
    speeds: Annotated[str, typer.Option("--speeds", metavar="RANGE", help="Speeds to sweep, up and down.")] = (
        "900..4100rpm"
    ),
    duration: Annotated[
        str,
        typer.Option("--duration", metavar="TIME", help="Length of a sweep; 15s up and down are six million steps."),
    ] = "15s",
    spreading: Annotated[
        bool, typer.Option("--spreading", help="Also check contact at single nodes against patches (RBE3).")
    ] = False,
    seed: options.SeedOption = 0,
    fresh: options.FreshOption = False,
) -> None:
    """Study a pair of reduced finite-element gears: stiffness and transmission-error maps, sweeps with jumps, spectra.

    Example: gearsig flexible --preset light_damping_50_50 -o study
    """
    import numpy as np

    from app.flexible import RANGE, flexible_study, write_study
    from sims.presets import preset as preset_named
    from sims.reduced_fe import ReducedPair

    request = options.read_request(MODEL, preset, settings, effects, None, None, "1s", "20480Hz", seed)
    first, last = span(speeds, "rpm", "--speeds", example="900..4100")
    torques_nm = tuple(quantity(text, "N m", "--torques") for text in torques.split(","))
    if fresh:
        options.clear_other_versions(MODEL)
    ready = ReducedPair().prepare(request.setup, np.random.default_rng(seed))
    chosen = preset_named(MODEL, request.preset)
    with progress_bar("preparing") as show:
        study = flexible_study(
            ready.pair,
            float(ready.operation.torque_nm.values[0]),
            torques_nm,
            sweep_s=quantity(duration, "s", "--duration"),
            first_rpm=first,
            last_rpm=last,
            step_s=ready.step_s,
            check_spreading=spreading,
            on_progress=lambda stage, done: show(done, stage),
        )
        paths = write_study(study, output, chosen.name)
    typer.echo(f"{output}: {', '.join(path.name for path in paths)}")
    for torque, (up, down) in study.sweeps.items():
        natural = study.natural_hz[torque]
        jumps = [sweep.jump_hz(RANGE[0] * natural, RANGE[1] * natural) for sweep in (up, down)]
        peaks = [sweep.peak_hz(RANGE[0] * natural, RANGE[1] * natural) for sweep in (up, down)]
        sweep_texts = [
            f"greatest at {peak:.0f} Hz, {'no jump' if jump is None else f'jump at {jump:.0f} Hz'}"
            for peak, jump in zip(peaks, jumps, strict=True)
        ]
        typer.echo(
            f"{torque:g} N·m: torsional mode {natural:.0f} Hz; sweep up: {sweep_texts[0]}; sweep down: {sweep_texts[1]}"
        )


SPRINGS = {"radial": "2e8N/m", "axial": "1e8N/m", "tilt": "1e5Nm/rad", "twist": "4e4Nm/rad"}
"""Default springs that hold the hub."""


def gear_body(
    output: Annotated[Path, options.output_option("Folder for figures and files.")],
    teeth: Annotated[int, typer.Option("--teeth")] = 50,
    module: Annotated[str, typer.Option("--module", metavar="LENGTH")] = "3mm",
    pressure_angle: Annotated[float, typer.Option("--pressure-angle", help="Degrees.")] = 20.0,
    profile_shift: Annotated[float, typer.Option("--profile-shift", help="In modules.")] = 0.0,
    fillet: Annotated[float, typer.Option("--fillet", help="Tip radius of the tool, in modules.")] = 0.38,
    face: Annotated[str, typer.Option("--face", metavar="LENGTH", help="Face width.")] = "20mm",
    bore: Annotated[str, typer.Option("--bore", metavar="LENGTH", help="Radius of the bore.")] = "20mm",
    web: Annotated[str, typer.Option("--web", metavar="LENGTH", help="Thickness of the web; default: full disc.")] = "",
    rim: Annotated[str, typer.Option("--rim", metavar="LENGTH", help="Thickness of the rim, with a web.")] = "",
    hub: Annotated[str, typer.Option("--hub", metavar="LENGTH", help="Thickness of the hub, with a web.")] = "",
    dof: Annotated[int, typer.Option("--dof", help="Approximate degrees of freedom of the mesh.")] = 277_200,
    modes: Annotated[int, typer.Option("--modes", help="Number of elastic modes.")] = 20,
    held: Annotated[
        str, typer.Option("--held", help="free, bore or springs: how the gear is held for its modes.")
    ] = "free",
    radial: Annotated[str, typer.Option("--radial", metavar="STIFFNESS", help="Radial springs.")] = SPRINGS["radial"],
    axial: Annotated[str, typer.Option("--axial", metavar="STIFFNESS", help="Axial springs.")] = SPRINGS["axial"],
    tilt: Annotated[str, typer.Option("--tilt", metavar="STIFFNESS", help="Tilting springs.")] = SPRINGS["tilt"],
    twist: Annotated[str, typer.Option("--twist", metavar="STIFFNESS", help="Torsional spring.")] = SPRINGS["twist"],
    force: Annotated[str, typer.Option("--force", metavar="FORCE", help="Force on a tooth, for stress.")] = "1000N",
    reduce: Annotated[bool, typer.Option("--reduce", help="Also reduce the gear, and state the errors.")] = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Delete reduced gears that another version of gearsig kept.")
    ] = False,
    vtk: Annotated[bool, typer.Option("--vtk", help="Also write gear.vtu for other programs.")] = False,
) -> None:
    """Mesh one gear with finite elements; show its mesh, modes and stress, and reduce it for the model reduced-fe.

    Example: gearsig gear-body --teeth 50 --module 3mm --web 12mm --reduce -o gear
    """
    from app.gear_body import lines, study_gear, write_gear_body
    from gearsig.checks import one_of
    from sims.fe_gear import GearBlank
    from sims.mesh import GearGeometry
    from sims.reduced_fe import NAME

    def length(text: str, name: str) -> float | None:
        return quantity(text, "mm", name) if text else None

    geometry = GearGeometry(
        teeth,
        quantity(module, "mm", "--module"),
        pressure_angle,
        profile_shift,
        quantity(face, "mm", "--face"),
        tool_tip_radius=fillet,
        bore_radius_mm=quantity(bore, "mm", "--bore"),
    )
    blank = GearBlank(geometry, length(web, "--web"), length(rim, "--rim"), length(hub, "--hub"))
    one_of(held, "--held", ("free", "bore", "springs"))
    springs = _springs(held, {"radial": radial, "axial": axial, "tilt": tilt, "twist": twist})
    if fresh:
        options.clear_other_versions(NAME)
    with progress_bar("mesh") as show:
        study = study_gear(
            blank,
            dof,
            n_modes=modes,
            held="bore" if held == "bore" else "free",
            springs=springs,
            force_n=quantity(force, "N", "--force"),
            reduce=reduce,
            on_progress=lambda stage, done: show(done, stage),
        )
        paths = write_gear_body(study, output, vtk=vtk)
    typer.echo("\n".join(lines(study)))
    typer.echo(f"{output}: {', '.join(path.name for path in paths)}")


def _springs(held: str, texts: dict[str, str]) -> FloatArray | None:
    """Return the hub stiffness in six directions (N/m, N m/rad); None if the hub is not on springs."""
    import numpy as np

    from gearsig.checks import positive

    if held != "springs":
        for name, text in texts.items():
            if text != SPRINGS[name]:
                raise InputError(f"--{name} is given, but --held is {held!r}", remedy="add --held springs")
        return None
    units = {"radial": "N/m", "axial": "N/m", "tilt": "Nm/rad", "twist": "Nm/rad"}
    radial, axial, tilt, twist = (
        positive(quantity(texts[name], unit, f"--{name}"), f"--{name}", unit) for name, unit in units.items()
    )
    return np.array([radial, radial, axial, tilt, tilt, twist])


CRACKED = "cracked"
"""Model of the machine in which the crack grows."""


def growth(
    output: Annotated[Path, options.output_option("Folder for figure, CSV and JSON.")],
    depth: Annotated[str, typer.Option("--depth", metavar="LENGTH", help="Present depth: 1mm, or 1..1.6mm.")],
    preset: options.PresetOption = "",
    settings: options.SetOption = None,
    torque: Annotated[
        str, typer.Option("--torque", metavar="TORQUE", help="On the driver; default: the preset's.")
    ] = "",
    speed: Annotated[str, typer.Option("--speed", metavar="SPEED", help="Of the driver; default: the preset's.")] = "",
    gear: Annotated[str, typer.Option("--gear", help="driver or driven: whose tooth is cracked.")] = "driver",
    angle: Annotated[
        float, typer.Option("--angle", help="Degrees between the crack and the tooth's centre line.")
    ] = 45.0,
    load_factor: Annotated[
        float,
        typer.Option("--load-factor", help="Ratio of the load to that of the torque alone: K_A K_v."),
    ] = 1.0,
    paris: Annotated[
        str,
        typer.Option(
            "--paris",
            metavar="C,m[,sC[,sm]]",
            help="da/dN = C ΔK^m in mm and MPa√m, and the scatter of log10 C and m; default: two stages of BS 7910.",
        ),
    ] = "",
    threshold: Annotated[
        float, typer.Option("--threshold", help="ΔK in MPa√m below which a crack does not grow.")
    ] = 2.0,
    toughness: Annotated[float, typer.Option("--toughness", help="K in MPa√m at which the tooth breaks.")] = 60.0,
    seed: options.SeedOption = 0,
) -> None:
    """Predict the revolutions until a cracked tooth breaks, with an interval, by finite elements and Paris' law.

    The machine is a preset of the model cracked, or a preset file. growth.json lists the assumptions.

    Example: gearsig growth --preset published_55_75 --depth 1..1.6mm --torque 300Nm -o growth
    """
    import numpy as np

    from app.gear_body import ASSUMPTIONS, growth_study, write_growth
    from gearsig.checks import one_of
    from gearsig.report import check_writable
    from sims.cracked import CrackedPair
    from sims.presets import preset as preset_named

    one_of(gear, "--gear", ("driver", "driven"))
    check_writable(output)
    request = options.read_request(CRACKED, preset, settings, None, None, None, "1s", "20480Hz", seed)
    chosen = preset_named(CRACKED, request.preset)
    setup = replace(request.setup, parameters={**request.parameters, "crack_depth_mm": 0.0})
    study = growth_study(
        CrackedPair().prepare(setup, np.random.default_rng(seed)).machine.mesh,
        1 if gear == "driver" else 2,
        first_mm=span(depth if ".." in depth else f"{depth}..{depth}", "mm", "--depth"),
        angle_deg=angle,
        torque_nm=quantity(torque, "N m", "--torque") if torque else chosen.torque_nm,
        speed_rpm=quantity(speed, "rpm", "--speed") if speed else chosen.speed_rpm,
        law=_law(paris, threshold, toughness),
        load_factor=load_factor,
        seed=seed,
    )
    paths = write_growth(study, output)
    k = study.intensity.k_mpa_sqrt_m
    typer.echo(f"ΔK {k[0]:.3g} MPa√m at {study.intensity.depth_mm[0]:.3g} mm, {k.max():.3g} at most. {study.verdict}")
    typer.echo("Assumed: " + "; ".join(ASSUMPTIONS) + f". Law: {study.law.source}.")
    typer.echo(f"{output}: {', '.join(path.name for path in paths)}")


def _law(paris: str, threshold: float, toughness: float) -> GrowthLaw:
    from sims.reduced_fe import STEEL_IN_AIR, GrowthLaw, GrowthStage

    if not paris:
        return replace(STEEL_IN_AIR, threshold=threshold, toughness=toughness)
    try:
        numbers = [float(part) for part in paris.split(",")]
    except ValueError:
        numbers = []
    if not 2 <= len(numbers) <= 4:
        raise InputError(f"--paris is {paris!r}", allowed="C,m or C,m,scatter of log10 C,scatter of m: 6.9e-9,3,0.2")
    return GrowthLaw((GrowthStage(*numbers),), threshold, toughness, f"given: C, m = {paris}")
