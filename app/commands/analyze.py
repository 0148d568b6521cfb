"""`gearsig analyze`: one recording, in words and numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.options import (
    PulsesOption,
    ReferenceOption,
    RigOption,
    SamplingRateOption,
    SpeedOption,
    TachometerTimesOption,
    TorqueOption,
    open_recording,
    open_reference,
    open_rig,
    stated_speed,
    torque_of,
)


def analyze(
    recording: Annotated[Path, typer.Argument(help="CSV, MAT, WAV, HDF5, Parquet, TDMS or UFF58 file.")],
    rig: RigOption = None,
    fs: SamplingRateOption = None,
    speed_rpm: SpeedOption = None,
    tach_times: TachometerTimesOption = None,
    pulses_per_revolution: PulsesOption = 1,
    reference: ReferenceOption = None,
    torque: TorqueOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, for other programs.")] = False,
    indicators: Annotated[bool, typer.Option("--indicators", help="Print the table of indicators as well.")] = False,
) -> None:
    """Say what a recording shows of the machine's condition, most important first.

    Every finding comes with its place (gear, shaft, order, angle), its strength against a floor, how sure it is, and
    what would make it surer. Where the recording does not allow an answer, it says so and why. With --reference, cracks
    of a millimetre show, and every indicator is compared.

    Example: gearsig analyze gearbox.csv --rig gearbox.toml
    """
    from rich.console import Console

    from gearsig.diagnosis.analyze import analyze as run_analysis

    speed = stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    machine, torque_nm = open_rig(rig, recording), torque_of(torque)
    with Console(stderr=True).status("reading") as status:  # shown on a terminal only
        result = run_analysis(
            open_recording(recording, machine, fs, speed),
            reference=open_reference(reference, machine, fs, speed_rpm),
            torque_nm=torque_nm,
            on_stage=status.update,
        )
    if json:
        from gearsig.report.to_json import analysis_to_json

        typer.echo(analysis_to_json(result))
    else:
        from gearsig.report.text import analysis_text

        typer.echo(analysis_text(result, with_indicators=indicators))
