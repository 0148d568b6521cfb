"""`gearsig growth`: how fast a root crack grows, and how many turns are left."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from sims.reduced_fe import GrowthLaw

MODEL = "cracked"


def growth(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for figure, CSV and JSON.")],
    depth: Annotated[str, typer.Option("--depth", metavar="LENGTH", help="Present depth: 1mm, or 1..1.6mm.")],
    preset: options.PresetOption = "",
    settings: options.SetOption = None,
    torque: Annotated[str, typer.Option("--torque", metavar="TORQUE", help="Of the driver; the preset's.")] = "",
    speed: Annotated[str, typer.Option("--speed", metavar="SPEED", help="Of the driver; the preset's.")] = "",
    gear: Annotated[str, typer.Option("--gear", help="driver or driven: whose tooth is cracked.")] = "driver",
    angle: Annotated[float, typer.Option("--angle", help="Degrees between crack and the tooth's centre line.")] = 45.0,
    load_factor: Annotated[
        float,
        typer.Option("--load-factor", help="How much greater the load is than the torque's: K_A K_v."),
    ] = 1.0,
    paris: Annotated[
        str,
        typer.Option(
            "--paris",
            metavar="C,m[,sC[,sm]]",
            help="da/dN = C ΔK^m in mm and MPa√m, and the scatter of log10 C and of m; else the two stages of BS 7910.",
        ),
    ] = "",
    threshold: Annotated[float, typer.Option("--threshold", help="ΔK in MPa√m below which a crack rests.")] = 2.0,
    toughness: Annotated[float, typer.Option("--toughness", help="K in MPa√m at which the tooth breaks.")] = 60.0,
    seed: options.SeedOption = 0,
) -> None:
    """Say how many turns a root crack has left, with an interval: stress intensity by finite elements, Paris' law.

    The machine is a preset of the model cracked, or a file of one. What is assumed stands in growth.json.

    Example: gearsig growth --preset published_55_75 --depth 1..1.6mm --torque 300Nm -o growth
    """
    import numpy as np

    from app.growth import ASSUMPTIONS, growth_study, write_growth
    from gearsig.checks import one_of
    from gearsig.report import check_writable
    from sims.cracked import CrackedPair
    from sims.presets import preset as preset_named
    from sims.simulator import SimulationSetup

    one_of(gear, "--gear", ("driver", "driven"))
    check_writable(output)
    request = options.read_request(MODEL, preset, settings, None, None, None, "1s", "20480Hz", seed)
    chosen = preset_named(MODEL, request.preset)
    setup = SimulationSetup(request.preset, {**request.parameters, "crack_depth_mm": 0.0})
    low, dots, high = depth.partition("..")
    last = quantity(high or low, "mm", "--depth")
    study = growth_study(
        CrackedPair().prepare(setup, np.random.default_rng(seed)).machine.mesh,
        1 if gear == "driver" else 2,
        first_mm=(quantity(low, "mm", "--depth") if dots else last, last),
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
    from dataclasses import replace

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
