"""`gearsig analyze`, `crack`, `report`: results of recordings as text, numbers and pages; `gearsig rig`: rig files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli import options
from app.cli.console import EXIT_INPUT_ERROR, EXIT_INTERRUPTED, EXIT_SOME_FAILED, progress_bar, typed_command
from app.cli.quantities import quantity
from gearsig.errors import InputError


def analyze(
    recording: Annotated[Path, typer.Argument(help="CSV, MAT, WAV, HDF5, Parquet, TDMS, UFF58 or MF4 file.")],
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    reference: options.ReferenceOption = None,
    reference_fs: options.ReferenceRateOption = None,
    torque: options.TorqueOption = None,
    json: options.JsonOption = False,
    indicators: Annotated[bool, typer.Option("--indicators", help="Also print the table of indicators.")] = False,
    memory: options.MemoryOption = 2.0,
) -> None:
    """Report what a recording shows about the machine's condition, most important first.

    Each finding states its location (gear, shaft, order, angle), its strength relative to a noise floor, its certainty,
    and what would increase the certainty. If the recording does not allow an answer, the report says why. With
    --reference, cracks of a millimetre become visible and every indicator is compared.

    Example: gearsig analyze gearbox.csv --rig gearbox.toml
    """
    from rich.console import Console

    from gearsig.diagnosis import LongAnalysis, analyze_file, read_reference

    given: dict[str, Any] = {"memory_bytes": 1e9 * memory, "sampling_rate_hz": fs}
    machine, torque_nm = options.open_rig(rig, recording), options.torque_of(torque)
    with Console(stderr=True).status("reading") as status:  # shown on a terminal only
        healthy = None
        if reference is not None:
            stated = options.stated_speed(speed_rpm, None, 1)  # pulse times belong to the other recording
            healthy = read_reference(reference, machine, speed=stated, reference_rate_hz=reference_fs, **given)
        result = analyze_file(
            recording,
            machine,
            speed=options.stated_speed(speed_rpm, tach_times, pulses_per_revolution),
            reference=healthy,
            torque_nm=torque_nm,
            on_stage=status.update,
            **given,
        )
    if isinstance(result, LongAnalysis):
        from gearsig.report import long_analysis_text, long_analysis_to_json

        typer.echo(long_analysis_to_json(result) if json else long_analysis_text(result, with_indicators=indicators))
    elif json:
        from gearsig.report import analysis_to_json

        typer.echo(analysis_to_json(result))
    else:
        from gearsig.report import analysis_text

        typer.echo(analysis_text(result, with_indicators=indicators))


def crack(
    recording: Annotated[Path, typer.Argument(help="Recording of a spur gear pair at steady speed.")],
    rig: options.RigOption = None,
    reference: options.ReferenceOption = None,
    reference_fs: options.ReferenceRateOption = None,
    torque: options.TorqueOption = None,
    tip_relief: Annotated[
        str | None,
        typer.Option("--tip-relief", help="Tip relief, e.g. 15um, if the drawing states it; improves the estimate."),
    ] = None,
    channel: options.ChannelsOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
) -> None:
    """Estimate the depth of a crack in a tooth root, in mm and % of the root, with a 90 % interval.

    It reports "no crack seen, below … mm" if none stands out and one through half of the root would have; it refuses
    machines outside its calibration (by simulation). With --reference it is much more certain, and cracks of a
    millimetre become visible. It also says whether the tooth may be chipped or spalled instead. Fine encoders on both
    shafts, in both recordings, count as well. With --channel it uses only some of the accelerations, e.g. to leave
    out a dead one.

    Example: gearsig crack sample_data/root_crack_3mm.h5 --reference sample_data/root_crack_0mm.h5
    """
    from gearsig.severity import estimate_crack

    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    machine = options.open_rig(rig, recording)
    estimate = estimate_crack(
        options.open_recording(recording, machine, fs, speed),
        reference=options.open_reference(reference, machine, fs, speed_rpm, reference_fs),
        torque_nm=options.torque_of(torque),
        tip_relief_um=quantity(tip_relief, "um", "--tip-relief") if tip_relief else None,
        channels=tuple(dict.fromkeys(channel or ())),
    )
    typer.echo(estimate.text)
    for reason in estimate.reasons:
        typer.echo(reason)


def demo(
    output: Annotated[Path, options.output_option("Folder for the pages.")] = Path("demo-report"),
) -> None:
    """Diagnose the sample recordings, write a report of them, and say where it is."""
    from app.samples import samples
    from gearsig.diagnosis import analyze
    from gearsig.report import analysis_text, check_writable

    check_writable(output)
    chosen = samples()
    first = next((s for s in chosen if "damaged" in s.recording.stem), chosen[0])
    typer.echo(f"$ gearsig analyze {first.recording}\n")
    typer.echo(analysis_text(analyze(options.open_recording(first.recording, options.open_rig(first.rig), None))))
    typer.echo(
        f"\nThe same for all {len(chosen)} samples (simulated, as {first.recording.parent} describes), "
        "each compared with its healthy machine where there is one:"
    )
    healthy = {s.recording: s.reference for s in chosen if s.reference is not None}
    recordings = [sample.recording for sample in chosen]
    make_report(recordings, output, command=f"gearsig demo -o {output}", reference=healthy)
    typer.echo("Next: `gearsig rig example` for a rig file of your own, `gearsig dashboard` to explore.")


# `gearsig rig`: check a rig file, print one to start from, list the bearings known by name.

rig_app = typer.Typer(
    name="rig", no_args_is_help=True, help="Check a rig file, which describes the machine, or print one to start from."
)


@rig_app.command()
def check(file: Annotated[Path, typer.Argument(help="Rig file (TOML).")]) -> None:
    """Print the orders that a rig file implies: shafts, meshes, sidebands, hunting tooth, BPFO, BPFI, BSF, FTF."""
    from gearsig.rig import describe_rig, read_rig

    typer.echo(describe_rig(read_rig(file)))


@rig_app.command()
def example() -> None:
    """Print a commented rig file; delete what you do not know."""
    typer.echo((Path(__file__).parent / "example_rig.toml").read_text(encoding="utf-8"))


@rig_app.command()
def bearings(names: Annotated[list[str] | None, typer.Argument(help="E.g. 6205-2RS; default: all.")] = None) -> None:
    """List the bearings that a rig file may name, with their orders and the source of their geometry."""
    from gearsig.rig import Bearing, bearing_catalogue, catalogue_bearing

    typer.echo(f"{'bearing':<16} {'n':>3} {'ball mm':>8} {'pitch mm':>8}  BPFO    BPFI    BSF     FTF     source")
    for known in [catalogue_bearing(name) for name in names] if names else bearing_catalogue().values():
        orders = " ".join(
            f"{order:<7.4f}" for order in Bearing(known.name, "shaft", bearing=known.name).orders().values()
        )
        size = f"{known.rolling_element_diameter_mm:>8g} {known.pitch_diameter_mm:>8g}"
        typer.echo(f"{known.name:<16} {known.n_rolling_elements:>3} {size}  {orders} {known.source}")


# --------------------
# `gearsig report`: pages of many recordings.
# --------------------


def report(
    files: Annotated[list[Path], typer.Argument(help="Recordings, folders (including sub-folders) or 'FOLDER/*.csv'.")],
    output: Annotated[Path, options.output_option("Folder for the pages.")],
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    reference: options.ReferenceOption = None,
    reference_fs: options.ReferenceRateOption = None,
    torque: options.TorqueOption = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="METHOD",
            help="Further methods on the pages, e.g. order-map or modes+squeezed-cwt; see gearsig show --list. "
            "Repeatable. Default: those that suit each recording; none: no further methods.",
        ),
    ] = None,
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
    memory: options.MemoryOption = 2.0,
    pdf: Annotated[bool, typer.Option("--pdf", help="Also write each page and the index as PDF.")] = False,
) -> None:
    """Write one self-contained HTML page per recording, and an index page that compares them.

    A file that cannot be analysed does not stop the others: the index lists it with the reason, and the exit code is 1
    (2 if no file could be analysed). With --reference, all recordings are compared with that one. It can be stopped at
    any time: the same command continues from the existing pages.

    Example: gearsig report monday.csv tuesday.csv --rig gearbox.toml -o report
    """
    if tach_times is not None and (len(files) > 1 or files[0].is_dir()):
        raise InputError("--tach-times belongs to one recording, but several are given", remedy="report each by itself")
    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    failed = make_report(
        files,
        output,
        rig,
        jobs,
        cluster,
        command=typed_command(),
        sampling_rate_hz=fs,
        speed=speed,
        reference=reference,
        reference_rate_hz=reference_fs,
        torque_nm=options.torque_of(torque),
        memory_bytes=1e9 * memory,
        pdf=pdf,
        methods=[] if methods == ["none"] else methods,
    )
    if failed:
        raise typer.Exit(failed)


def make_report(
    files: list[Path], output: Path, rig: Path | None = None, jobs: int | None = None, cluster: str = "", **how: Any
) -> int:
    """Write the pages and show the progress; `how` goes to `report_many`; return the exit code."""
    from gearsig.batch import report_many

    before, so_far = output.exists(), "0"

    def advance(done: int, total: int, _result: object) -> None:
        nonlocal so_far
        so_far = f"{done} of {total}"
        show(done, total=total)

    with options.open_cluster(cluster) as workers:
        try:
            with progress_bar("analysing", len(files)) as show:
                result = report_many(
                    files,
                    output,
                    rig=options.open_rig(rig),
                    n_processes=jobs,
                    on_progress=advance,
                    **how,
                )
        except KeyboardInterrupt:
            typer.echo(f"gearsig: stopped after {so_far} files; {_present_text(output, before)}", err=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None
        ran = workers.text() if workers else ""
    for entry in result.entries:
        typer.echo(f"{entry.name}: {entry.verdict}")
    for failure in result.failures:
        typer.echo(f"{failure.name}: not analysed: {failure.reason}", err=True)
    kept = f"{result.n_found} of {len(result.entries)} pages existed already. " if result.n_found else ""
    typer.echo(f"{kept}{f'It ran {ran}. ' if ran else ''}Open {result.index_path} in a browser.")
    if not result.failures:
        return 0
    return EXIT_SOME_FAILED if result.entries else EXIT_INPUT_ERROR


def _present_text(output: Path, was_there: bool) -> str:
    """Say what an interrupted report left; a new folder without pages is removed."""
    pages = [page for page in output.glob("*.html") if page.name != "index.html"] if output.is_dir() else []
    if pages:
        return f"pages in {output} are complete; the same command continues from there"
    if not was_there:
        (output / "index.html").unlink(missing_ok=True)
    if not was_there and output.is_dir() and not any(output.iterdir()):
        output.rmdir()
    return "nothing was kept"
