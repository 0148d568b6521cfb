"""`gearsig start-stop`, `force`, `identify`: analysis of the measured motion of both gears."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.motion import AngleProfile, ForceEstimate, Identification, NoiseStudy, StartStop
    from gearsig.recording import Recording
    from gearsig.rig import Rig
    from gearsig.spectra import Spectrum


DATA, PICTURE = "start_stop.json", "start_stop.png"
"""Files that -o writes."""


def start_stop(
    recording: options.MotionArgument,
    rig: options.RigOption = None,
    use: options.UseOption = None,
    bandwidth: options.BandwidthOption = None,
    unwrap: options.UnwrapOption = False,
    fs: options.SamplingRateOption = None,
    json: options.JsonOption = False,
    output: Annotated[Path | None, options.output_option(f"Folder for {DATA} and {PICTURE}.")] = None,
) -> None:
    """Find starts and stops, the backlash, every impact of the flanks, and the loop of torque over twist.

    The speed need not be steady. The picture shows the speed with the impacts, the phase plane of the teeth and torque
    over twist; the JSON has the level of the vibration (or else of the torque) tooth by tooth, forwards and backwards
    separately, and its orders.

    Example: gearsig start-stop drive.h5 --rig drive.toml -o drive
    """
    from gearsig.motion import examine_start_stop
    from gearsig.report import check_writable, start_stop_json, start_stop_text, write_folder

    if output is not None:
        check_writable(output)
    opened, motion = options.open_motion(recording, options.open_rig(rig, recording), fs, use, bandwidth, unwrap)
    examined = examine_start_stop(motion)
    data = start_stop_json(examined, *tooth_levels(opened, examined))
    if output is not None:
        from gearsig.plot import start_stop_figure

        write_folder(output, {PICTURE: start_stop_figure(examined)}, {DATA: data}, dpi="figure")
    typer.echo(data if json else start_stop_text(examined))
    if output is not None and not json:
        typer.echo(f"\nIn {output}: {DATA}, {PICTURE}.")


def tooth_levels(recording: Recording, examined: StartStop) -> tuple[AngleProfile | None, str, str, Spectrum | None]:
    """Return level tooth by tooth, channel, unit and forward orders of the first acceleration, or else the torque."""
    from gearsig.errors import RefusalError
    from gearsig.motion import angle_profile, segment_order_spectrum

    fitting = [c for q in ("acceleration", "torque") for c in recording.channels if c.quantity == q]
    if not fitting:
        return None, "", "", None
    name, unit, motion = fitting[0].name, fitting[0].unit, examined.motion
    values, angle = recording.values(name), motion.driver_angle_rad
    orders = None
    with suppress(RefusalError):  # where no segment holds a revolution
        orders = segment_order_spectrum(values, angle, examined.segments, unit=unit, source=name)
    return angle_profile(values, angle, examined.segments, motion.path.teeth[0]), name, unit, orders


FORCE_DATA, TABLE, FORCE_PICTURE, NOISE_PICTURE = "force.json", "force.csv", "force.png", "noise.png"
"""Files that -o writes."""

DatumOption = Annotated[
    str,
    typer.Option(
        "--datum",
        metavar="auto|zero|LENGTH",
        help="Compression at which the teeth are in the middle of the backlash; auto: estimate it from the motion.",
    ),
]


def force(
    recording: options.MotionArgument,
    rig: options.RigOption = None,
    use: options.UseOption = None,
    bandwidth: options.BandwidthOption = None,
    unwrap: options.UnwrapOption = False,
    datum: DatumOption = "auto",
    noise: Annotated[
        bool, typer.Option("--noise", help="Also find the noise up to which the piecewise model beats Hunt–Crossley.")
    ] = False,
    fs: options.SamplingRateOption = None,
    json: options.JsonOption = False,
    output: Annotated[Path | None, options.output_option(f"Folder for {FORCE_DATA}, {TABLE}, {FORCE_PICTURE}.")] = None,
) -> None:
    """Estimate the force between the teeth by the piecewise, Hunt–Crossley and Kelvin–Voigt models.

    The rig's [contact] table gives stiffness, backlash, restitution, friction and inertias. If torque was measured,
    each model is compared with torque over base radius. A speed or acceleration that was not measured is derived, and
    the result says how.

    Example: gearsig force drive.h5 --rig drive.toml --noise -o force
    """
    from rich.console import Console

    from gearsig.motion import estimate_forces
    from gearsig.report import check_writable, force_json, force_text

    if output is not None:
        check_writable(output)
    machine = options.open_rig(rig, recording)
    zero = read_datum(datum)
    with Console(stderr=True).status("reading") as status:
        opened, motion = options.open_motion(recording, machine, fs, use, bandwidth, unwrap)
        estimate = estimate_forces(motion, datum=zero)
        study = None
        if noise:
            import numpy as np

            from gearsig.motion import noise_study

            status.update("adding noise")
            rng = np.random.default_rng(0)
            roles, band = options.read_uses(use), options.read_bandwidth(bandwidth)
            study = noise_study(opened, machine, rng=rng, use=roles, bandwidth_hz=band, unwrap=unwrap, datum=zero)
        written: tuple[str, ...] = ()
        if output is not None:
            status.update("drawing")
            written = write_force(estimate, study, output)
    typer.echo(force_json(estimate, study) if json else force_text(estimate, study))
    if written and not json:
        typer.echo(f"\nIn {output}: {', '.join(written)}.")


def read_datum(text: str) -> str | float:
    """Parse "auto", "zero" or a length, returned in m."""
    if text in ("auto", "zero"):
        return text
    try:
        return quantity(text, "um", "--datum") * 1e-6
    except InputError as error:
        raise InputError(error.what, allowed="auto, zero, or a length, e.g. 12um") from None


def write_force(estimate: ForceEstimate, study: NoiseStudy | None, folder: Path) -> tuple[str, ...]:
    """Write data, table and pictures; return the file names. Without a reference force there is no force picture."""
    from gearsig.plot import force_figure, noise_figure
    from gearsig.report import force_csv, force_json, write_folder

    texts, pictures = {FORCE_DATA: force_json(estimate, study), TABLE: force_csv(estimate)}, {}
    if estimate.references_n:
        pictures[FORCE_PICTURE] = force_figure(estimate)
    if study is not None:
        pictures[NOISE_PICTURE] = noise_figure(study)
    write_folder(folder, pictures, texts, dpi="figure")
    return (*texts, *pictures)


FITTED_NAMES = (
    "half_backlash_um",
    "stiffness_n_per_m_lambda",
    "restitution",
    "driver_inertia_kg_m2",
    "friction_coefficient",
    "driven_inertia_kg_m2",
)
"""Parameters that a rig file can hold."""


def identify(
    recording: Annotated[Path, typer.Argument(help="Recording with the motion of both gears and the driver's torque.")],
    rig: options.RigOption = None,
    use: options.UseOption = None,
    bandwidth: options.BandwidthOption = None,
    unwrap: options.UnwrapOption = False,
    fs: options.SamplingRateOption = None,
    json: options.JsonOption = False,
    output: Annotated[
        Path | None, options.output_option("Rig file (.toml) to write, with all that was identified.", "FILE")
    ] = None,
) -> None:
    """Fit tooth contact and load to a recording, with 95 % intervals; list what the recording cannot determine.

    The best record starts, runs and stops with a brake: it loads both flanks, contains impacts and shows the inertias.

    Example: gearsig identify drive.h5 --rig drive.toml -o fitted.toml
    """
    from gearsig.motion import identify as fit
    from gearsig.report import check_writable, identify_json, identify_text
    from gearsig.rig import write_rig

    if output is not None and (output.suffix.lower() != ".toml" or not output.parent.is_dir()):
        raise InputError(f"cannot write {str(output)!r}", allowed="a .toml file in a folder that exists")
    if output is not None:
        check_writable(output.parent)
    machine = options.open_rig(rig, recording)
    opened, motion = options.open_motion(recording, machine, fs, use, bandwidth, unwrap)
    identification = fit(motion)
    known = machine or opened.rig
    if output is not None and known is not None:  # motion could not have been measured without a rig
        write_rig(with_fitted(known, identification), output)
    typer.echo(identify_json(identification) if json else identify_text(identification))
    if output is not None and not json:
        typer.echo(f"\n{output.name}: the rig with what could be identified.")


def with_fitted(rig: Rig, identification: Identification) -> Rig:
    """Return the rig whose contact holds the fitted values that could be identified."""
    assert rig.contact is not None  # noqa: S101  motion could not have been measured without it
    values = {
        p.name: max(p.value, 0.0) for p in identification.parameters if p.is_determined and p.name in FITTED_NAMES
    }
    return replace(
        rig,
        contact=replace(rig.contact, **values),  # type: ignore[arg-type]  # all of them are numbers
        sources=(
            *rig.sources,
            f"contact fitted to {identification.source or 'a recording'}: {', '.join(sorted(values))}",
        ),
    )
