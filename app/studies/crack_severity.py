"""Make the calibration of crack severity: `python -m app.studies.crack_severity [--cases N] [--to FILE]`.

Draws and simulates gearboxes (some 2.5 s each on one core), each with its crack, healthy, and with a chip or spall;
fits the models, and writes the JSON file that the library reads. The intervals come from errors on cases left out of
a fit.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.studies import answers_of, drawn_rigs, run_study
from app.studies.drawn_rigs import DrawnRig, draw_rig, simulate_rig
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.severity import (
    ALONE,
    CHIPPED,
    CRACKED,
    FEATURES,
    FILE,
    KINDS,
    LARGEST_SPEED_DIFFERENCE,
    LARGEST_TORQUE_CHANGE,
    MIN_SPREAD,
    RELIEF,
    RELIEF_KNOWN,
    RISING,
    SHAPE,
    SHAPED,
    SPALLED,
    WITH_REFERENCE,
    DepthModel,
    GearEvidence,
    KindModel,
    ShaftLines,
    gear_evidence,
    kind_vector,
    pair_facts,
    pair_lines,
    percent_per_mm,
    reach_of,
    segments,
)

# --------------------
# One case of the calibration: a random rig, its recording and reference, and the resulting features of both gears.
# --------------------


OTHER_FLANKS_SHARE = 0.15
"""Share of healthy machines whose flanks differ from the reference: run in, or ground again."""

RELIEF_ERROR = 0.2
"""Maximum relative error of the tip relief given to the estimator: tips never have exactly the specified relief."""

CHIP_HEIGHT_MODULES = (0.25, 1.5)
SPALL_WIDTH_PERCENT, SPALL_LENGTH_MODULES = (20.0, 90.0), (0.3, 1.2)


@dataclass(frozen=True)
class CrackCase:
    """A random rig with its recording, a reference of the healthy gears, and a second healthy recording."""

    drawn: DrawnRig
    recording: Recording
    reference: Recording
    healthy: Recording


@dataclass(frozen=True)
class CaseFeatures:
    """Features of a case.

    Parameters
    ----------
    drawn : DrawnRig
    gear : int
        0 or 1: which gear has the crack.
    percent : float
        Depth of the crack in percent of the root; 0: none.
    with_reference, alone, healthy, healthy_with_reference : arrays, (2, n_features)
        For both gears: the recording against its reference, the recording alone, the reference alone, and the second
        healthy recording against the reference.
    looks : mapping
        (kind, "with_reference" or "alone") → features, (n_features,), and shape of the event, (n_shape,), for the
        cracked gear and for the gear with the other fault.
    lag_pitches : float
        Lag of the event, with a reference, behind the middle of the cracked tooth's engagement; nan if there is no
        mark.
    reach : mapping
        Quantities that limit the calibration.
    """

    drawn: DrawnRig
    gear: int
    percent: float
    with_reference: FloatArray
    alone: FloatArray
    healthy: FloatArray
    healthy_with_reference: FloatArray
    looks: dict[tuple[str, str], tuple[FloatArray, FloatArray]]
    lag_pitches: float
    reach: dict[str, float]


def draw_case(seed: int, index: int, *, for_the_check: bool, even: bool = False) -> CrackCase | None:
    """Draw and simulate a case; None if the random gears cannot be made (undercut, a crack through the tooth)."""
    rng = np.random.default_rng([seed, index, int(for_the_check)])
    drawn = draw_rig(rng, for_the_check=for_the_check, even=even)
    speed = float(rng.uniform(1.0 - LARGEST_SPEED_DIFFERENCE, 1.0 + LARGEST_SPEED_DIFFERENCE))
    torque = float(rng.uniform(1.0 - LARGEST_TORQUE_CHANGE, 1.0 + LARGEST_TORQUE_CHANGE))
    flanks = 1 if rng.uniform() < OTHER_FLANKS_SHARE else 0
    try:
        return CrackCase(
            drawn,
            simulate_rig(drawn),
            simulate_rig(drawn, severity=0.0, run=1, speed_factor=speed, torque_factor=torque),
            simulate_rig(drawn, severity=0.0, run=2, flanks=flanks),
        )
    except (InputError, RefusalError):
        return None


def draw_tooth_fault(drawn: DrawnRig, rng: np.random.Generator) -> tuple[str, Recording] | None:
    """Draw and simulate a chip or a spall on the tooth instead of the crack; return its kind and the recording.

    None if the gears do not allow its size.
    """
    module = float(drawn.parameters["module_mm"])
    if rng.uniform() < 0.5:
        kind, effect = CHIPPED, "chipped_tooth"
        severity = module * float(np.exp(rng.uniform(*np.log(CHIP_HEIGHT_MODULES))))
        options = {"width_percent": 100.0 if rng.uniform() < 0.4 else float(rng.uniform(30.0, 90.0))}
    else:
        kind, effect = SPALLED, "tooth_spall"
        severity = float(rng.uniform(*SPALL_WIDTH_PERCENT))
        options = {"length_mm": module * float(rng.uniform(*SPALL_LENGTH_MODULES)), "depth_um": 100.0}
    try:
        return kind, simulate_rig(drawn, effect=effect, severity=severity, options=options)
    except (InputError, RefusalError):
        return None


def observe(
    case: CrackCase, other_fault: tuple[str, Recording] | None = None, relief_error: float = 0.0
) -> CaseFeatures:
    """Return the features of a case, without any fitted model.

    Parameters
    ----------
    case : CrackCase
    other_fault : (str, Recording) or None
        See `draw_tooth_fault`.
    relief_error : float
        Relative error of the tip relief given to the estimator.
    """
    drawn, rig = case.drawn, case.recording.rig
    if rig is None:
        raise InputError("a simulated recording has no rig")
    facts = pair_facts(rig, None)
    relief_um = float(drawn.parameters["tip_relief_um"]) * (1.0 + relief_error)

    def lines(recording: Recording) -> tuple[ShaftLines, ...]:
        return pair_lines(recording, rig, facts.pair, case.recording.vibration_names())

    def seen(a: tuple[ShaftLines, ...], b: tuple[ShaftLines, ...] | None) -> tuple[GearEvidence, ...]:
        return gear_evidence(a, b, facts.module_mm, facts.load_mpa, relief_um)

    now, healthy = lines(case.recording), lines(case.reference)
    compared, alone, good = seen(now, healthy), seen(now, None), seen(healthy, None)
    gear = ("driver", "driven").index(drawn.gear)
    looks = {(CRACKED, WITH_REFERENCE): _kind_features(compared[gear]), (CRACKED, ALONE): _kind_features(alone[gear])}
    if other_fault is not None:
        kind, damaged = other_fault[0], lines(other_fault[1])
        looks[kind, WITH_REFERENCE] = _kind_features(seen(damaged, healthy)[gear])
        looks[kind, ALONE] = _kind_features(seen(damaged, None)[gear])
    return CaseFeatures(
        drawn=drawn,
        gear=gear,
        percent=drawn.depth_mm * percent_per_mm(drawn.teeth[gear], facts.module_mm),
        with_reference=np.stack([e.features for e in compared]),
        alone=np.stack([e.features for e in alone]),
        healthy=np.stack([e.features for e in good]),
        healthy_with_reference=np.stack([e.features for e in seen(lines(case.healthy), healthy)]),
        looks=looks,
        lag_pitches=_lag(compared[gear], drawn.tooth),
        reach=reach_of(facts, now[0].order_hz * facts.driver_teeth),
    )


def _kind_features(evidence: GearEvidence) -> tuple[FloatArray, FloatArray]:
    return evidence.features, evidence.shape


def _lag(evidence: GearEvidence, tooth: int) -> float:
    if not evidence.shaft.has_mark:
        return float("nan")
    z = evidence.shaft.teeth
    return (evidence.event.centre_rev * z - tooth - 0.5 + z / 2) % z - z / 2


# --------------------
# From the features of simulated cracks to a model of their depth.
# --------------------


FALSE_ALARMS = 0.02
"""Share of healthy gear pairs whose score exceeds the threshold."""

TAUGHT = 0.10
"""Share of healthy gear pairs whose score exceeds the minimum score of cracks used to learn the depth: cracks just
below the threshold are informative as well, and without a reference few exceed it."""

CLEAR_MM = 1.0
"""Minimum depth of the cracks used to train the detection."""

OUTSIDE = 0.01
"""Share of the calibration's own cracks that count as unlike a crack."""

_RIDGE = 3.0
_FOLDS = 10
_KNOTS = (1 / 3, 2 / 3)
_COVERAGE = (0.05, 0.95)
_SHAPED = [FEATURES.index(name) for name in SHAPED]


@dataclass(frozen=True)
class Cases:
    """Cracks with their features, and healthy gears.

    Parameters
    ----------
    features : array, (n, n_features)
        Features of the cracked gear.
    percent, depth_mm : arrays, (n,)
    healthy : array, (n_healthy, 2, n_features)
        Features of both gears of healthy pairs.
    """

    features: FloatArray
    percent: FloatArray
    depth_mm: FloatArray
    healthy: FloatArray


def fit_model(cases: Cases, *, relief_known: bool) -> DepthModel:
    """Fit detection, depth and spread to all cases, and quantiles to the errors of cross-validated models."""
    linear = [i for i, name in enumerate(FEATURES) if name not in RISING and (relief_known or name not in RELIEF)]
    mean, scale = cases.features.mean(axis=0), cases.features.std(axis=0)
    z = (cases.features - mean) / scale
    healthy = (cases.healthy - mean) / scale
    detection = _detection_weights(z[cases.depth_mm >= CLEAR_MM], healthy.reshape(-1, z.shape[1]))
    healthy_scores = np.sort((healthy @ detection).max(axis=1))
    threshold = float(np.quantile(healthy_scores, 1.0 - FALSE_ALARMS))
    taught = z @ detection >= np.quantile(healthy_scores, 1.0 - TAUGHT)
    y = np.log(cases.percent)
    knots = np.quantile(z[taught][:, _SHAPED], _KNOTS, axis=0).T
    depth, spread = _depth_and_spread(z[taught], y[taught], knots, linear)
    intercept, coefficients, slopes = depth
    precision = _precision(z[taught], linear)
    distances = np.sqrt(np.einsum("ij,jk,ik->i", z[taught], precision, z[taught]))
    return DepthModel(
        mean=mean,
        scale=scale,
        intercept=intercept,
        coefficients=coefficients,
        knots=knots,
        slopes=slopes,
        spread=spread,
        quantiles=_conformal(_cross_validation_errors(z[taught], y[taught], knots, linear)),
        detection=detection,
        threshold=threshold,
        healthy_scores=healthy_scores,
        precision=precision,
        largest_distance=float(np.quantile(distances, 1.0 - OUTSIDE)),
        lowest=cases.features[taught].min(axis=0),
        highest=cases.features[taught].max(axis=0),
        percent_range=(float(cases.percent[taught].min()), float(cases.percent[taught].max())),
    )


def _depth_and_spread(
    z: FloatArray, y: FloatArray, knots: FloatArray, linear: list[int]
) -> tuple[tuple[float, FloatArray, FloatArray], FloatArray]:
    depth = _depth_weights(z, y, knots, linear)
    return depth, _spread_weights(z, np.abs(y - _predicted(depth, z, knots)))


def _predicted(depth: tuple[float, FloatArray, FloatArray], z: FloatArray, knots: FloatArray) -> FloatArray:
    intercept, coefficients, slopes = depth
    return np.asarray(intercept + z @ coefficients + _curves(z, knots) @ slopes.ravel())


def _cross_validation_errors(z: FloatArray, y: FloatArray, knots: FloatArray, linear: list[int]) -> FloatArray:
    """Return (y − ŷ)/σ of each case for the model fitted to the other nine tenths of the cases.

    R. F. Barber, E. J. Candès, A. Ramdas, R. J. Tibshirani, "Predictive inference with the jackknife+", 2021 (CV+).
    """
    scaled = np.empty(len(y))
    fold = np.arange(len(y)) % _FOLDS
    for k in range(_FOLDS):
        out = fold == k
        depth, spread = _depth_and_spread(z[~out], y[~out], knots, linear)
        sigma = np.maximum(spread[0] + z[out] @ spread[1:], MIN_SPREAD)
        scaled[out] = (y[out] - _predicted(depth, z[out], knots)) / sigma
    return scaled


def _detection_weights(cracked: FloatArray, healthy: FloatArray) -> FloatArray:
    """Return weights of a logistic regression, crack or none, on features that a crack raises; all are ≥ 0."""
    from scipy.optimize import minimize

    used = [FEATURES.index(name) for name in ("band_excess", "prominence", "pattern_excess")]
    x = np.vstack([cracked[:, used], healthy[:, used]])
    sign = np.r_[np.ones(len(cracked)), -np.ones(len(healthy))]
    share = np.r_[np.full(len(cracked), 0.5 / len(cracked)), np.full(len(healthy), 0.5 / len(healthy))]

    def loss(w: FloatArray) -> float:
        return float(share @ np.logaddexp(0.0, -sign * (x @ w[:-1] + w[-1])) + 0.003 * np.sum(w[:-1] ** 2))

    start = np.r_[np.ones(len(used)), 0.0]
    best = minimize(loss, start, bounds=[(0.0, None)] * len(used) + [(None, None)]).x
    weights = np.zeros(len(FEATURES))
    weights[used] = best[:-1]
    return weights


def _curves(z: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the columns of the rising curves, three per shaped feature."""
    return np.hstack([segments(z[:, i], pair) for i, pair in zip(_SHAPED, knots, strict=True)])


def _depth_weights(
    z: FloatArray, y: FloatArray, knots: FloatArray, linear: list[int]
) -> tuple[float, FloatArray, FloatArray]:
    """Fit the depth by ridge regression: rising curves of the depth features, linear terms of the rest."""
    from scipy.optimize import lsq_linear

    columns = np.c_[np.ones(len(z)), _curves(z, knots), z[:, linear]]
    n, n_curves = columns.shape[1], knots.size // 2 * 3
    rows = np.vstack([columns, np.sqrt(_RIDGE) * np.eye(n)[1:]])
    low = np.full(n, -np.inf)
    low[1 : 1 + n_curves] = 0.0
    result = lsq_linear(rows, np.r_[y, np.zeros(n - 1)], bounds=(low, np.full(n, np.inf))).x
    coefficients = np.zeros(z.shape[1])
    coefficients[linear] = result[1 + n_curves :]
    return float(result[0]), coefficients, np.maximum(result[1 : 1 + n_curves], 0.0).reshape(-1, 3)


def _spread_weights(z: FloatArray, error: FloatArray) -> FloatArray:
    """Fit a linear model of σ over excess and prominence; the mean absolute error is √(2/π) σ."""
    used = [FEATURES.index(name) for name in ("band_excess", "prominence")]
    rows = np.c_[np.ones(len(z)), z[:, used]]
    ridge = 30.0 * np.diag([0.0, 1.0, 1.0])
    best = np.linalg.solve(rows.T @ rows + ridge, rows.T @ error) * np.sqrt(np.pi / 2)
    spread = np.zeros(len(FEATURES) + 1)
    spread[[0, *(1 + i for i in used)]] = best
    return spread


def _precision(z: FloatArray, linear: list[int]) -> FloatArray:
    """Return the inverse covariance of the features used for the depth; 0 for the others."""
    used = sorted([*_SHAPED, *linear])
    precision = np.zeros((z.shape[1], z.shape[1]))
    precision[np.ix_(used, used)] = np.linalg.inv(np.cov(z[:, used].T) + 1e-3 * np.eye(len(used)))
    return precision


def _conformal(scaled: FloatArray) -> tuple[float, float]:
    """Return the quantiles of n errors for a new case: the k-th of n + 1, rounded outwards."""
    ordered, n = np.sort(scaled), len(scaled)
    low = int(np.floor(_COVERAGE[0] * (n + 1))) - 1
    high = int(np.ceil(_COVERAGE[1] * (n + 1))) - 1
    return float(ordered[max(low, 0)]), float(ordered[min(high, n - 1)])


# --------------------
# From the features of simulated cracks, chips and spalls to a model that classifies them.
# --------------------


def fit_kind(vectors: FloatArray, kinds: list[str]) -> KindModel:
    """Fit a softmax regression; cracks have the same total weight as chips and spalls together.

    Parameters
    ----------
    vectors : array, (n, n_features)
        Features of detected events; see `gearsig.severity.kind_vector`.
    kinds : list of str
        True kind of each.
    """
    from sklearn.linear_model import LogisticRegression

    mean, scale = vectors.mean(axis=0), vectors.std(axis=0)
    z = np.clip((vectors - mean) / scale, -4.0, 4.0)
    shares = {name: 0.5 if name == CRACKED else 0.5 / (len(KINDS) - 1) for name in KINDS}
    weights = [len(kinds) * shares[kind] / kinds.count(kind) for kind in kinds]
    # Penalty: twice the sum of the squared weights, without the offsets.
    model = LogisticRegression(C=0.25, tol=1e-9, max_iter=10_000)
    model.fit(z, [KINDS.index(kind) for kind in kinds], sample_weight=weights)
    return KindModel(mean, scale, np.c_[model.intercept_, model.coef_])


SEED = 2611
N_CASES = 540
EVEN_EVERY = 6
"""One case in this many, the last of each group, has teeth that hardly differ."""

_DIGITS = 7


def main(cases: int = N_CASES, processes: int = 2, to: Path = FILE, state: str = "") -> None:
    """Simulate, fit and write; `state` is the commit of the simulator, for the provenance."""
    observed = observe_all(cases, processes)
    text = json.dumps(calibration_of(observed, cases, state), indent=1)
    to.write_text(text + "\n", encoding="utf-8")
    typer.echo(f"{len(observed)} of {cases} cases; written to {to}")


def observe_all(n_cases: int, n_processes: int) -> list[tuple[int, CaseFeatures]]:
    """Return features by case index, without cases that cannot be made or have too few mesh harmonics."""
    answers = answers_of(observe_case, range(n_cases), n_processes)
    return [(index, answer) for index, answer in answers if isinstance(answer, CaseFeatures)]


def observe_case(index: int) -> CaseFeatures | str:
    """Return the features of one case, or the reason why there are none."""
    case = draw_case(SEED, index, for_the_check=False, even=index % EVEN_EVERY == EVEN_EVERY - 1)
    if case is None:
        return ""
    rng = np.random.default_rng([SEED, index, 0, 1])
    relief_error = float(rng.uniform(-RELIEF_ERROR, RELIEF_ERROR))
    try:
        return observe(case, draw_tooth_fault(case.drawn, rng), relief_error)
    except RefusalError as refusal:
        return str(refusal)


def calibration_of(observed: Sequence[tuple[int, CaseFeatures]], n_drawn: int, simulator_state: str) -> dict[str, Any]:
    """Return the calibration as JSON-like values."""
    models = {
        name + ending: fit_model(cases_of(observed, name), relief_known=bool(ending))
        for name in (WITH_REFERENCE, ALONE)
        for ending in ("", RELIEF_KNOWN)
    }
    return {
        "features": list(FEATURES),
        "shape": list(SHAPE),
        "lag_pitches": round(_median_lag(observed, models[WITH_REFERENCE]), 3),
        "reach": _reach([o for _, o in observed]),
        "models": {name: _plain(model) for name, model in models.items()},
        "kinds": {name: _plain(kind_of(observed, name, models[name])) for name in (WITH_REFERENCE, ALONE)},
        "provenance": _provenance(observed, n_drawn, simulator_state),
    }


def cases_of(observed: Sequence[tuple[int, CaseFeatures]], kind: str) -> Cases:
    """Return the cases of one model, which include each machine in its healthy state."""
    cracked = [(i, o) for i, o in observed if o.percent > 0]
    healthy = [o.healthy if kind == ALONE else o.healthy_with_reference for _, o in observed]
    return Cases(
        np.array([getattr(o, kind)[o.gear] for _, o in cracked]),
        np.array([o.percent for _, o in cracked]),
        np.array([o.drawn.depth_mm for _, o in cracked]),
        np.array(healthy),
    )


def kind_of(observed: Sequence[tuple[int, CaseFeatures]], way: str, model: DepthModel) -> KindModel:
    """Return the model of the kind of fault, fitted to the detected events."""
    vectors = [
        (kind, kind_vector(*looks))
        for _, o in observed
        for (kind, name), looks in o.looks.items()
        if name == way and (kind != CRACKED or o.percent > 0) and model.score(looks[0]) >= model.threshold
    ]
    return fit_kind(np.array([vector for _, vector in vectors]), [kind for kind, _ in vectors])


def _median_lag(observed: Sequence[tuple[int, CaseFeatures]], model: DepthModel) -> float:
    lags = [
        o.lag_pitches
        for _, o in observed
        if o.percent > 0 and model.score(o.with_reference[o.gear]) >= model.threshold and np.isfinite(o.lag_pitches)
    ]
    return float(np.median(lags))


def _reach(observed: Sequence[CaseFeatures]) -> dict[str, list[float]]:
    return {
        name: [float(f"{min(values):.4g}"), float(f"{max(values):.4g}")]
        for name in observed[0].reach
        if (values := [o.reach[name] for o in observed])
    }


def _plain(model: DepthModel | KindModel) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in vars(model).items():
        array = np.asarray(value, dtype=np.float64)
        rounded = np.vectorize(lambda v: float(f"{v:.{_DIGITS}g}"))(array)
        values[name] = rounded.tolist()
    return values


def _provenance(observed: Sequence[tuple[int, CaseFeatures]], n_drawn: int, simulator_state: str) -> dict[str, Any]:
    from importlib.metadata import version

    cracked = [o for _, o in observed if o.percent > 0]
    return {
        "made_by": "python -m app.studies.crack_severity",
        "version": version("gearsig"),
        "simulator": "sims.cracked: spur gear pair, 16 degrees of freedom",
        "simulator_state": simulator_state,
        "seed": SEED,
        "n_drawn": n_drawn,
        "n_used": len(observed),
        "n_cracked": len(cracked),
        "even_every": EVEN_EVERY,
        "false_alarms": FALSE_ALARMS,
        "depths_mm": list(drawn_rigs.DEPTHS_MM),
        "modules_mm": list(drawn_rigs.CALIBRATION_MODULES_MM),
        "speed_difference": LARGEST_SPEED_DIFFERENCE,
        "torque_difference": LARGEST_TORQUE_CHANGE,
        "other_flanks_share": OTHER_FLANKS_SHARE,
        "tip_relief_error": RELIEF_ERROR,
        "chip_height_modules": list(CHIP_HEIGHT_MODULES),
        "spall_width_percent": list(SPALL_WIDTH_PERCENT),
        "spall_length_modules": list(SPALL_LENGTH_MODULES),
        "crack": "straight, 45 degrees, through the whole face width",
        "teeth": "18 to 100, no pair whose teeth add up to a multiple of three",
        "least_revolutions": drawn_rigs.MIN_REVOLUTIONS,
    }


if __name__ == "__main__":
    run_study(main)
