"""Hand-made analyses: a gearbox with every kind of finding, and a recording that allows no answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.diagnosis import (
    Analysis,
    AnalysisSettings,
    CannotTell,
    ChannelAnalysis,
    Finding,
    Kind,
    Strength,
    Where,
)
from gearsig.indicators import Indicator
from gearsig.orders import OrderMap, SynchronousAverage
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Shaft
from gearsig.spectra import Spectrum

MESH, RATE_HZ, SPEED_RPM = 23, 25_600.0, 1999.76


def make_rig(name: str = "single-stage test gearbox") -> Rig:
    return Rig(
        name=name,
        shafts=(Shaft("input"), Shaft("output")),
        pairs=(GearPair("stage 1", "input", "output", 23, 46, module_mm=3.0, pressure_angle_deg=20.0),),
        bearings=(Bearing("input bearing", "input", 9, 7.94, 39.04),),
        operating_point=OperatingPoint("input", 2000.0),
        sources=("maker's data sheet",),
        assumed=("bearings",),
    )


def make_spectrum(rng: np.random.Generator, axis: str, n_lines: int, step: float, source: str) -> Spectrum:
    """Return noise on a sloping floor with mesh harmonics and sidebands; `step` is the axis' line spacing."""
    positions = np.arange(n_lines) * step
    one = 1.0 if axis == "order" else SPEED_RPM / 60
    values = 3e-3 * (1 + 4 * np.exp(-(((positions / one - 140) / 40) ** 2))) * rng.rayleigh(size=n_lines)
    for harmonic in range(1, 6):
        for side in range(-4, 5):
            level = (2.0 / harmonic) * (1.0 if side == 0 else 0.12 / abs(side))
            i = round((harmonic * MESH + side) * one / step)
            if i < n_lines:
                values[i] += level
    return Spectrum(
        values,
        positions,
        axis,
        "amplitude peak",
        "m/s^2",
        step,
        1.5 * step,
        "hann",
        1,
        source,
        "input" if axis == "order" else "",
    )


def make_averages(rng: np.random.Generator, channel: str, shaft: str, teeth: int, tooth: int | None) -> dict:
    n = 2048
    angle = np.arange(n) / n
    mesh = 1.5 * np.cos(2 * np.pi * teeth * angle) + 0.6 * np.cos(4 * np.pi * teeth * angle + 1)
    noise = np.convolve(rng.normal(0, 0.12, n), np.ones(8) / 8, mode="same")
    residual = noise
    if tooth is not None:
        centre = (tooth - 0.5) / teeth
        residual = residual + 0.9 * np.exp(-(((angle - centre) * teeth / 0.8) ** 2)) * np.cos(
            2 * np.pi * 140 * (angle - centre)
        )
    error = np.full(n, 0.05)
    make = lambda values, kind: SynchronousAverage(values, error, 366, shaft, channel, "m/s^2", kind, 380.0)  # noqa: E731
    return {
        (shaft, "average"): make(mesh + residual, "average"),
        (shaft, "residual"): make(residual, "residual"),
        (shaft, "difference"): make(residual * 0.9, "difference"),
        (shaft, "regular"): make(mesh, "regular"),
    }


def make_map(rng: np.random.Generator) -> OrderMap:
    positions, time = np.arange(0, 100, 0.1), np.linspace(0.2, 10.8, 120)
    speed = 1000 + 150 * time
    values = 0.004 * rng.rayleigh(size=(120, 1000))
    for order in (1, 23, 46, 69):
        values[:, order * 10] += 0.5 * (speed / 2000) ** 2 / (1 + order / 23)
    resonance = np.exp(-(((positions[None, :] * speed[:, None] / 60 - 1200) / 60) ** 2))
    return OrderMap(
        values * (1 + 6 * resonance), positions, time, speed, "order", "amplitude peak", "m/s^2", 0.1, "a1", "input"
    )


def make_findings() -> tuple[Finding, ...]:
    return (
        Finding(
            "tooth-local-impact",
            Kind.FAULT,
            "One tooth of the gear on shaft 'input' meshes differently from the others.",
            Where(("a1", "a2"), shaft="input", gear="stage 1/input", angle_deg=258.3, tooth=17),
            Strength(0.94, "m/s^2", 0.11, "2 standard errors of the residual", 18.6),
            0.93,
            "agreement of two channels and of both halves of the recording",
            (
                "The residual peaks at 258.3° with 0.94 m/s², 8.5 times its floor.",
                "FM4 is 6.8 where a healthy gear reads about 3.",
                "Against it: the peak is 40 % smaller on channel a2.",
            ),
            "a recording at another load, where the peak should grow with torque",
        ),
        Finding(
            "bearing-inner-race",
            Kind.SUSPICION,
            "The envelope of channel a1 shows lines near the inner-race order of 'input bearing'.",
            Where(("a1",), shaft="input", bearing="input bearing", order=5.415, order_shaft="input"),
            Strength(0.031, "m/s^2", 0.014, "median of the neighbouring envelope lines", 6.9),
            0.55,
            "height over the floor of two harmonics",
            ("Harmonics 1 and 2 stand 6.9 and 4.1 dB above the floor.",),
            "a recording of at least 30 s",
        ),
        Finding(
            "clipped",
            Kind.DATA_PROBLEM,
            "Channel a3 is clipped in 0.4 % of its samples.",
            Where(("a3",), time_s=(2.1, 2.3)),
            evidence=("1132 samples lie at the largest value, 49.87 m/s².",),
            surer="a larger measuring range",
        ),
        Finding("load-unknown", Kind.CANNOT_TELL, "Whether the load changed cannot be told.", surer="a torque channel"),
        Finding("sideband-asymmetry", Kind.NOTICE, "The upper sidebands of the mesh are 4 dB above the lower ones."),
        Finding("speed-found", Kind.INFORMATION, "The shaft speed is 1999.76 rpm.", confidence=0.99),
    )


def make_indicators(channels: tuple[str, ...]) -> tuple[Indicator, ...]:
    result = []
    for i, channel in enumerate(channels):
        result += [
            Indicator("rms", 1.71 + i, "m/s^2", channel),
            Indicator("kurtosis", 3.4 - 0.2 * i, "", channel),
            Indicator("FM4", 6.8 / (1 + i), "", channel, "difference", "input", "stage 1/input"),
            Indicator(
                "NA4", float("nan"), "", channel, "residual", "input", "stage 1/input", note="needs a healthy run"
            ),
            Indicator(
                "sideband level", -12.4 - i, "dB", channel, "order spectrum", "", "stage 1/input", "orders 20 to 26"
            ),
            Indicator("envelope rms", 0.4, "m/s^2", channel, "envelope", band="2000 to 4000 Hz"),
        ]
    return tuple(result)


def make_gearbox(
    names: tuple[str, ...] = ("a1", "a2", "a3"), rig: Rig | None = None, n_lines: int = 100_000
) -> Analysis:
    rng = np.random.default_rng(7)
    rig = rig or make_rig()
    time = np.arange(int(11.04 * RATE_HZ)) / RATE_HZ
    samples = np.stack([np.sin(2 * np.pi * 766.6 * time) + rng.normal(0, 1 + i, len(time)) for i in range(len(names))])
    recording = Recording(
        samples,
        RATE_HZ,
        tuple(Channel(name, "acceleration", "m/s^2", "pinion bearing, vertical") for name in names),
        rig=rig,
        provenance=Provenance(
            "monday run.mat", "ab" * 32, "MAT v5 reader 0.1.0", ("read", "doubled variables left out")
        ),
        warnings=("variable 'a1' occurs twice; the copy that is all zeros was left out",),
    )
    knots = np.linspace(0, 11.04, 400)
    rev = SPEED_RPM / 60 * knots + 0.02 * np.sin(knots)
    slope = SPEED_RPM / 60 + 0.02 * np.cos(knots)
    angle = ShaftAngle("input", knots, rev, slope, "tachless", 2.3e-5, 0.96, ("no tachometer: speed from the mesh",))
    channels = []
    for i, name in enumerate(names):
        averages = make_averages(rng, name, "input", 23, 17) | make_averages(rng, name, "output", 46, None)
        channels.append(
            ChannelAnalysis(
                name,
                make_spectrum(rng, "frequency", n_lines, RATE_HZ / 2 / n_lines, name),
                make_spectrum(rng, "frequency", 4097, RATE_HZ / 2 / 4097, name),
                make_spectrum(rng, "order", 4000, 0.01, f"envelope of {name}, 2000 to 4000 Hz"),
                (2000.0, 4000.0),
                make_spectrum(rng, "order", n_lines, 380 / n_lines, name),
                make_map(rng) if i == 0 else None,
                averages,
            )
        )
    return Analysis(
        recording,
        rig,
        angle,
        tuple(channels),
        make_indicators(names),
        make_findings(),
        "Tooth 17 of the input gear is damaged (93 % sure); the bearing on the same shaft deserves a look.",
        asdict(AnalysisSettings()) | {"window": None},
    )


def make_cannot_tell() -> Analysis:
    recording = Recording(np.zeros((1, 1)), 1000.0, (Channel("x"),), provenance=Provenance("empty.csv"))
    reason = CannotTell(
        "What is the shaft speed?", "there is no speed source and no gear data", "give teeth or a tachometer"
    )
    finding = Finding("no-speed", Kind.CANNOT_TELL, "The speed is not known.", evidence=("one sample only",))
    return Analysis(recording, None, reason, (), (), (finding,), "Cannot tell: the recording is too short.")


@pytest.fixture(scope="session")
def gearbox() -> Analysis:
    return make_gearbox()


@pytest.fixture(scope="session")
def cannot_tell() -> Analysis:
    return make_cannot_tell()


@pytest.fixture(scope="session")
def gearbox_with() -> Callable[..., Analysis]:
    """Build a small gearbox analysis with names of one's choice."""
    return lambda names, rig_name: make_gearbox(tuple(names), make_rig(rig_name), n_lines=2000)
