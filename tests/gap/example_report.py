"""Hand-made gap reports of a 55/75 pair, one for each outcome: pages, figures and files are tried on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.gap import (
    AddedEffect,
    AngleCurves,
    AverageCurves,
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    GapStep,
    Interval,
    NextRecording,
    OperatingCondition,
    PathFacts,
    PlaceKind,
    Shrinkage,
    SpectrumCurves,
)

RIG = "Published pair 55/75"
TWIN = '[about]\nmodel = "cracked"\ntitle = "Twin of Published pair 55/75"\n\n[parameters]\ndriver_teeth = 55\n'
POINTS = (OperatingCondition(1504.2, 60.0), OperatingCondition(1998.7, 60.0))


def effect_report(rig: str = RIG, simulator: str = "cracked") -> GapReport:
    """One effect is named: a root crack, diagnosed from two conditions and a healthy reference."""
    return GapReport(
        rig=rig,
        simulator=simulator,
        conditions=conditions(2),
        references=("healthy_1.h5", "healthy_2.h5"),
        outcome=GapOutcome.EFFECT,
        size=Interval(7.9, 7.1, 8.8),
        repeatability=46.0,
        places=places(),
        causes=causes(),
        groups={
            "tooth-local": 0.93,
            "flank": 0.04,
            "shaft": 0.01,
            "drive and load": 0.005,
            "bearing": 0.0,
            "measurement chain": 0.0,
            "unknown": 0.015,
        },
        steps=(
            GapStep("simulator as it is", Interval(7.9, 7.1, 8.8)),
            GapStep("crack in a tooth root", Interval(3.9, 3.2, 4.7)),
            GapStep("housing and sensor resonances", Interval(1.6, 1.2, 2.1)),
        ),
        next_recordings=next_recordings(),
        spectra=tuple(
            with_reference(spectrum(label, seed)) for seed, label in enumerate(("residual of a1", "residual of a2"))
        ),
        angles=(angles("input", 55, tooth=21), angles("output", 75)),
        averages=(average("input", 55, tooth=21), average("output", 75)),
        notes=("The mean torque is the rig file's; it was not measured.",),
        twin_toml=TWIN,
        path=PathFacts("run_up.h5", 229.0, 7334.0, {"a1": 0.86, "a2": 0.0}),
    )


def cannot_separate_report() -> GapReport:
    """Two effects fit alike on the one condition that there is, without a reference."""
    first, second, third, *_ = causes()
    shaken = replace(first, probability=0.48, shrinkage=shrinkage(0.58, 0.41, 0.69, held_out=OTHER_REVOLUTIONS))
    rival = replace(second, probability=0.41, shrinkage=shrinkage(0.55, 0.37, 0.66, held_out=OTHER_REVOLUTIONS))
    return replace(
        effect_report(),
        outcome=GapOutcome.CANNOT_SEPARATE,
        conditions=conditions(1),
        references=(),
        causes=(shaken, rival, replace(third, probability=0.06), GapCause("unknown", "", "unknown", "", 0.05)),
        inseparable=("root_crack", "tooth_spall"),
        twin_toml="",
        path=None,
        spectra=(spectrum("residual of a1"), spectrum("residual of a2", seed=1)),
        averages=(),
        angles=(replace(angles("input", 55, tooth=21), has_mark=False),),
    )


def unknown_report() -> GapReport:
    """A large gap near 5.15 orders that no effect explains."""
    report = effect_report()
    place = GapPlace(
        PlaceKind.LINE,
        "tones at 5.15 orders of the input shaft, which belong to no shaft and no bearing of the rig",
        21.4,
        88.0,
        9.3,
        0.71,
        orders=(5.15, 10.3, 15.45),
        channel="a1",
    )
    unknown = GapCause("unknown", "", "nothing in the catalogue", "", 0.86)
    rest = tuple(
        replace(c, probability=p, severity=None) for c, p in zip(causes()[:3], (0.08, 0.04, 0.02), strict=True)
    )
    return replace(
        report,
        outcome=GapOutcome.UNKNOWN,
        places=(place, *report.places[1:3]),
        causes=(unknown, *rest),
        steps=(report.steps[0],),
        next_recordings=(),
        spectra=tuple(replace(s, after=np.zeros(0)) for s in report.spectra),
        angles=tuple(replace(a, after=np.zeros(0)) for a in report.angles),
        twin_toml="",
        notes=("The rig file names no bearing: bearing orders could not be tried.",),
        warnings=("condition_1.h5: the teeth do not fit.",),
    )


def no_gap_report() -> GapReport:
    """A machine that differs from the simulator no more than healthy ones do."""
    report = effect_report()
    return replace(
        report,
        outcome=GapOutcome.NO_GAP,
        size=Interval(0.6, 0.5, 0.8),
        repeatability=3.6,
        places=(),
        causes=(GapCause("none", "", "no gap beyond the floor", "", 0.94), replace(causes()[1], probability=0.06)),
        groups={"none": 0.94, "flank": 0.06},
        steps=(),
        next_recordings=(),
        twin_toml="",
        notes=(),
        spectra=tuple(
            replace(s, after=np.zeros(0), measured=1.05 * s.before, reference=s.before) for s in report.spectra
        ),
        averages=tuple(replace(a, measured=a.reference) for a in report.averages),
        angles=tuple(replace(a, after=np.zeros(0), measured=a.before) for a in report.angles),
    )


def undecided_report() -> GapReport:
    """A machine whose gap is larger than usual, and nothing likely enough to be its cause."""
    report = no_gap_report()
    return replace(
        report,
        outcome=GapOutcome.UNDECIDED,
        size=Interval(1.7, 1.5, 1.9),
        places=effect_report().places,
        causes=tuple(replace(c, probability=p) for c, p in zip(report.causes, (0.3, 0.2), strict=True)),
        groups={"tooth-local": 0.6, "none": 0.3},
    )


def gearless_report() -> GapReport:
    """A damaged outer race on a rig without gears: nothing was simulated, so there are no sizes, curves and steps."""
    nan, nothing = float("nan"), np.zeros(0)
    race = GapPlace(
        PlaceKind.ENVELOPE,
        "envelope lines of the outer race of bearing 1 (order 3.21, 80.2 Hz), 35 dB over their floor",
        34.8,
        nan,
        nan,
        nan,
        shaft="shaft",
        orders=(3.21,),
        band_hz=(614.0, 1255.0),
        channel="a1",
    )
    notes = ("6 of 6 harmonics of 3.2097 stand out in the envelope of a1.", "At most 81 %: chance of it < 1e-6.")
    outer = GapCause(
        "bearing_outer_race", "bearing", "spall on an outer race", "mm", 0.81, place="bearing 1", notes=notes
    )
    rest = (
        GapCause("unknown", "unknown", "something else", "", 0.095),
        GapCause("none", "none", "no damage", "", 0.095),
    )
    curves = replace(
        spectrum("envelope of a1, 610 Hz to 1.3 kHz"), before=nothing, after=nothing, structural_db=nothing
    )
    return GapReport(
        rig="Bearing test rig",
        simulator="",
        conditions=(ConditionFacts("outer.mat", OperatingCondition(1500.0, nan), 75.0, 3.0, 48_828.0),),
        references=(),
        outcome=GapOutcome.EFFECT,
        size=Interval(nan, nan, nan),
        repeatability=nan,
        places=(race,),
        causes=(outer, *rest),
        groups={"bearing": 0.81, "unknown": 0.095, "none": 0.095},
        spectra=(curves,),
        notes=("The rig has no gear pair: nothing was simulated.",),
    )


def all_reports() -> dict[str, GapReport]:
    """Return one report of each outcome, by the outcome's words, and one without a simulation."""
    reports = (effect_report(), cannot_separate_report(), unknown_report(), no_gap_report(), undecided_report())
    return {**{report.outcome.value: report for report in reports}, "gearless": gearless_report()}


def with_few_curves(report: GapReport) -> GapReport:
    """Return the report with one spectrum and one shaft: drawing takes the time."""
    return replace(report, spectra=report.spectra[:1], angles=report.angles[:1], averages=())


def conditions(n: int) -> tuple[ConditionFacts, ...]:
    """Return facts of the first `n` recordings."""
    return tuple(
        ConditionFacts(f"condition_{i}.h5", point, round(point.speed_rpm / 10, 2), 6.0, 20_000.0)
        for i, point in enumerate(POINTS[:n], 1)
    )


def places() -> tuple[GapPlace, ...]:
    """Return the places of a root crack, strongest first."""
    return (
        GapPlace(
            PlaceKind.TOOTH,
            "a burst once per revolution at tooth 21 of the input shaft",
            14.2,
            61.0,
            8.7,
            0.58,
            shaft="input",
            angle_deg=134.2,
            tooth=21,
            channel="a1",
        ),
        GapPlace(
            PlaceKind.SIDEBANDS,
            "low, wide sidebands of the input shaft around the mesh harmonics",
            9.1,
            33.0,
            4.4,
            0.22,
            shaft="input",
            orders=(51.0, 52.0, 58.0, 59.0),
        ),
        GapPlace(
            PlaceKind.ENVELOPE,
            "envelope lines at multiples of the input shaft",
            6.8,
            17.0,
            2.9,
            0.12,
            shaft="input",
            orders=(1.0, 2.0, 3.0),
        ),
        GapPlace(PlaceKind.BAND, "more noise between 2.1 and 3.4 kHz", -3.2, 12.0, 1.6, 0.08, band_hz=(2100.0, 3400.0)),
    )


ANOTHER_CONDITION, OTHER_REVOLUTIONS = "another operating condition", "other revolutions of the same recordings"


def shrinkage(
    value: float, low: float, high: float, *, held_out: str = ANOTHER_CONDITION, placebo: float = 0.06
) -> Shrinkage:
    """Return a shrinkage of the crack's size."""
    return Shrinkage(
        Interval(6.2, 5.5, 6.9), Interval(1.7, 1.3, 2.2), Interval(value, low, high), 0.96, placebo, held_out
    )


def causes() -> tuple[GapCause, ...]:
    """Return a crack, what looks like it, a nuisance and the two that are no effect."""
    return (
        GapCause(
            "root_crack",
            "tooth-local",
            "crack in a tooth root",
            "mm",
            0.88,
            Interval(2.3, 1.9, 2.8),
            AddedEffect("root_crack", 2.3, {"gear": "driver", "tooth": 21.0}),
            "tooth 21 of the driver",
            shrinkage(0.72, 0.64, 0.79),
            (
                Evidence("kurtosis of the input shaft's residual average", 11.8, 12.4, 1.1, speaks_for=True),
                Evidence("sidebands of the input shaft, 1 to 6 orders away", 8.0, 9.1, 1.4, speaks_for=True),
                Evidence("envelope line at 1 × input shaft", 5.9, 6.8, 1.9, speaks_for=True),
                Evidence("centroid of the spectrum", 2.0, 7.0, 1.3, speaks_for=False, is_further=True),
                Evidence("level of the mesh harmonics", 0.4, 2.3, 1.2, speaks_for=False),
            ),
        ),
        GapCause(
            "tooth_spall",
            "tooth-local",
            "spall on a tooth flank",
            "mm",
            0.05,
            Interval(1.1, 0.7, 1.8),
            AddedEffect("tooth_spall", 1.1, {"gear": "driver", "tooth": 21.0}),
            "tooth 21 of the driver",
            shrinkage(0.31, 0.12, 0.44, placebo=0.19),
            (
                Evidence("kurtosis of the input shaft's residual average", 6.1, 12.4, 1.1, speaks_for=True),
                Evidence("band power 4 to 8 kHz", 7.2, 0.9, 1.5, speaks_for=False),
            ),
        ),
        GapCause(
            "pitch_error",
            "flank",
            "pitch error",
            "um",
            0.04,
            Interval(14.0, 6.0, 25.0),
            AddedEffect("pitch_error", 14.0, {"gear": "driver"}),
            "",
            shrinkage(0.08, -0.1, 0.2, placebo=0.11),
            (Evidence("sidebands of the input shaft, 1 to 2 orders away", 6.6, 2.0, 1.4, speaks_for=False),),
        ),
        GapCause("transfer_path", "measurement chain", "housing and sensor resonances", "dB", 0.015, is_nuisance=True),
        GapCause("unknown", "", "nothing in the catalogue", "", 0.01),
        GapCause("none", "", "no gap beyond the floor", "", 0.005),
    )


def next_recordings() -> tuple[NextRecording, ...]:
    """Return two recordings that would tell crack from spall."""
    names = ("root_crack", "tooth_spall")
    return (
        NextRecording(
            OperatingCondition(900.0, 120.0),
            names,
            5.4,
            1.6,
            "record at 900 rpm and 120 N m: there a crack in a tooth root and a spall on a tooth flank lie "
            "5.4 structural floors apart, against 1.6 now.",
        ),
        NextRecording(OperatingCondition(1500.0, 120.0), names, 3.8, 1.6, "record at 1500 rpm and 120 N m."),
    )


def spectrum(label: str, seed: int = 0) -> SpectrumCurves:
    """Return mesh harmonics with sidebands: more of them measured than simulated before."""
    rng = np.random.default_rng(seed)
    orders = np.arange(0.0, 200.0, 0.25)
    noise = 0.004 * (1 + rng.rayleigh(size=len(orders)))
    mesh, sidebands = np.zeros_like(orders), np.zeros_like(orders)
    for harmonic in (1, 2, 3):
        mesh[4 * 55 * harmonic] = 1.2 / harmonic
        for side in range(1, 9):
            for order in (55 * harmonic - side, 55 * harmonic + side):
                sidebands[4 * order] = 0.14 / harmonic / (1 + 0.2 * side)
    return SpectrumCurves(
        label,
        "m/s^2",
        orders,
        noise + 1.1 * mesh + sidebands,
        noise + mesh + 0.15 * sidebands,
        noise + mesh + 0.9 * sidebands,
        np.full_like(orders, 0.006),
        np.full_like(orders, 3.0),
    )


def with_reference(curves: SpectrumCurves) -> SpectrumCurves:
    """Return the curves with a reference that is as the simulation before, a little stronger."""
    return replace(
        curves,
        reference=1.02 * curves.before,
        reference_floor=np.full_like(curves.orders, 0.008),
        reference_structural_db=np.full_like(curves.orders, 2.0),
    )


def average(shaft: str, teeth: int, tooth: int | None = None) -> AverageCurves:
    """Return teeth that differ a little, and a burst at a tooth where one is given."""
    angle = np.arange(480) * 0.75
    born = 2.0 * np.sin(np.radians(31 * angle)) + np.sin(np.radians(17 * angle))
    burst = np.zeros_like(angle)
    if tooth is not None:
        away = angle - (tooth - 0.5) * 360.0 / teeth
        burst = 12.0 * np.exp(-((away / 3.0) ** 2)) * np.cos(np.radians(110 * away))
    return AverageCurves(shaft, "m/s^2", "a1", teeth, True, angle, born + burst, born)


def angles(shaft: str, teeth: int, tooth: int | None = None) -> AngleCurves:
    """Return the energy along one revolution, with a peak at a tooth where one is given."""
    angle = np.arange(360) * 1.0
    even = 1 + 0.15 * np.sin(np.radians(3 * angle))
    peak = np.zeros_like(angle)
    if tooth is not None:
        centre = (tooth - 0.5) * 360.0 / teeth
        peak = 8.0 * np.exp(-(((angle - centre) / 4.0) ** 2))
    return AngleCurves(shaft, "m/s^2", teeth, True, angle, even + peak, even, even + 0.85 * peak)
