"""Cases: a rig, its operating conditions, its faults, and its healthy twin."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gearsig.checks import count, one_of, within
from gearsig.errors import InputError
from gearsig.recording import Provenance, Recording, write_recording
from gearsig.rig import write_rig
from sims.blind._changes import CATALOGUE, EVERY, MECHANICAL, OUTSIDE_CATALOGUE, Place
from sims.blind._rig import BlindRig, draw_rig
from sims.blind._scene import RunCondition, Scene, measure, run, scene_of

Kind = Literal["none", "single", "unknown", "pair"]
KINDS: tuple[Kind, ...] = ("none", "single", "unknown", "pair")
KIND_SHARES = (0.2, 0.5, 0.2, 0.1)
MIN_MESH_HARMONICS = 3


@dataclass(frozen=True)
class Fault:
    """A fault: name, severity in its own unit, level in its span (0 weak, 1 strong), and seed of its choices."""

    name: str
    severity: float
    level: float
    seed: int


@dataclass(frozen=True)
class BlindCase:
    """A case to be recorded. Reference i has the operating point of condition i."""

    role: str
    kind: str
    rig: BlindRig
    conditions: tuple[RunCondition, ...]
    references: tuple[RunCondition, ...]
    faults: tuple[Fault, ...]


@dataclass(frozen=True)
class CaseRecordings:
    """Recordings of a case, its healthy references (or none), its twins, and the location of each fault."""

    conditions: tuple[Recording, ...]
    references: tuple[Recording, ...]
    twins: tuple[Recording, ...]
    places: tuple[Place, ...]


def draw_case(
    rng: np.random.Generator,
    role: str = "development",
    *,
    kind: str | None = None,
    effect: str | None = None,
    level: float | None = None,
    n_conditions: int | None = None,
    with_reference: bool | None = None,
) -> BlindCase:
    """Draw a case; whatever is not given is also drawn.

    The rig, its conditions, durations and noise are drawn independently of the fault: the same generator state with
    another kind or effect gives the same rig. Only ``backlash`` affects the conditions, as it shows only under light
    load: its first condition is always a light load.

    Parameters
    ----------
    rng : numpy.random.Generator
    role : str
        "development", "calibration" or "evaluation"; no tooth number and no module is shared between them.
    kind : str or None
        "none", "single", "unknown" (outside the catalogue) or "pair" (two of the catalogue).
    effect : str or None
        Name for "single" or "unknown"; it determines the kind if that is not given.
    level : float or None
        0 (barely noticeable) to 1 (strong), for every fault of the case; None: uniform in between.
    n_conditions : int or None
        1 or 2.
    with_reference : bool or None
        Whether each condition has a healthy recording of the same rig.

    Raises
    ------
    InputError
        If a name does not exist or a value is outside its range.
    """
    seeds = [int(s) for s in rng.integers(2**62, size=4)]
    drawn = str(np.random.default_rng(seeds[3]).choice(KINDS, p=KIND_SHARES))
    chosen = _kind(kind, effect, drawn)
    if n_conditions is not None and count(n_conditions, "n_conditions") > 2:
        raise InputError(f"n_conditions is {n_conditions}", allowed="1 or 2")
    rig = draw_rig(np.random.default_rng(seeds[0]), role)
    faults = _draw_faults(np.random.default_rng(seeds[1]), rig, chosen, effect, level)
    is_light = any(f.name == "backlash" for f in faults)
    conditions, references = _draw_conditions(
        np.random.default_rng(seeds[2]), rig, n_conditions, with_reference, starts_light=is_light
    )
    return BlindCase(role, chosen, rig, conditions, references, faults)


def record_case(case: BlindCase, *, encoder_counts: int = 0) -> CaseRecordings:
    """Run a case: recordings, references and twins.

    A twin is the same run with the same seeds but without the fault; a case without a fault is its own twin. The noise
    level is set by the quietest twin and a clipping converter's range by the loudest, so that the noise does not reveal
    the fault. With `encoder_counts` per revolution each gear carries an encoder.
    """
    runs = [(scene, run(scene)) for scene in (scene_of(case.rig, c) for c in case.conditions)]
    n, gains = len(case.rig.chains), np.array([c.gain for c in case.rig.chains])
    bare = [measure(scene, motion).samples[:n] for scene, motion in runs]
    rms = tuple(np.min([x.std(axis=1) for x in bare], axis=0) / gains)
    peak = tuple(np.max([np.abs(x).max(axis=1) for x in bare], axis=0))

    def levelled(scene: Scene) -> Scene:
        scene.reference_rms, scene.reference_peak = rms, peak
        return scene

    def recorded(condition: RunCondition, faults: tuple[Fault, ...] = ()) -> tuple[Recording, list[Place]]:
        scene = levelled(scene_of(case.rig, condition))
        places = [EVERY[f.name].apply(scene, f.severity, np.random.default_rng(f.seed)) for f in faults]
        return measure(scene, run(scene), encoder_counts=encoder_counts), places

    twins = tuple(measure(levelled(scene), motion, encoder_counts=encoder_counts) for scene, motion in runs)
    references = tuple(recorded(c)[0] for c in case.references)
    if not case.faults:
        return CaseRecordings(twins, references, twins, ())
    done = [recorded(c, case.faults) for c in case.conditions]
    return CaseRecordings(tuple(r for r, _ in done), references, twins, tuple(done[0][1]))


def _kind(kind: str | None, effect: str | None, drawn: str) -> str:
    if effect is not None:
        one_of(effect, "effect", EVERY)
        kind_of_effect = "unknown" if effect in OUTSIDE_CATALOGUE else "single"
        if kind not in (None, kind_of_effect):
            raise InputError(f"effect {effect!r} does not make a case of kind {kind!r}", allowed=kind_of_effect)
        return kind_of_effect
    return one_of(kind, "kind", KINDS) if kind is not None else drawn


def _draw_faults(
    rng: np.random.Generator, rig: BlindRig, kind: str, effect: str | None, level: float | None
) -> tuple[Fault, ...]:
    if level is not None:
        within(level, "level", 0, 1)
    if kind == "none":
        return ()
    if kind == "pair":
        first = str(rng.choice(MECHANICAL))
        other_groups = [name for name in CATALOGUE if CATALOGUE[name].group != CATALOGUE[first].group]
        names = [first, str(rng.choice(other_groups))]
    elif kind == "unknown":
        alike = [n for n, c in OUTSIDE_CATALOGUE.items() if bool(c.resembles) == (rng.random() < 0.5)] or list(
            OUTSIDE_CATALOGUE
        )
        names = [str(rng.choice(alike))]
    else:
        names = [str(rng.choice(list(CATALOGUE)))]
    faults = []
    for name in [effect] if effect else names:
        at = float(rng.uniform(0, 1))
        at = at if level is None else level
        faults.append(Fault(name, EVERY[name].severity(rig, at), at, int(rng.integers(2**62))))
    return tuple(faults)


def _draw_conditions(
    rng: np.random.Generator,
    rig: BlindRig,
    n_conditions: int | None,
    with_reference: bool | None,
    *,
    starts_light: bool,
) -> tuple[tuple[RunCondition, ...], tuple[RunCondition, ...]]:
    n_drawn, reference_drawn = int(rng.integers(1, 3)), bool(rng.random() < 0.5)
    n = n_drawn if n_conditions is None else n_conditions
    has_reference = reference_drawn if with_reference is None else with_reference
    fastest = min(3000.0, 60 * 0.45 * rig.sampling_rate_hz / (MIN_MESH_HARMONICS * rig.pair.z1))
    slowest = 600.0
    load_error, place = rng.uniform(0.85, 1.15), rng.uniform(0, 1)
    shares, is_light = rng.uniform(0.2, 0.9, 2), rng.random(2) < 0.25
    light = 10 ** rng.uniform(-2.8, -1.9, 2)
    if abs(shares[1] - shares[0]) < 0.2:
        shares[1] = shares[0] + 0.3 if shares[0] < 0.55 else shares[0] - 0.3
    is_light[1] &= not is_light[0]
    if starts_light:
        is_light[:], light[0] = (True, False), 0.4 * light[0]
    speeds = [slowest * (fastest / slowest) ** ((place + k * rng.uniform(0.25, 0.75)) % 1.0) for k in range(2)]
    mounts = [int(s) for s in rng.integers(2**62, size=2)]
    conditions, references = [], []
    for k in range(2):
        share = float(light[k] if is_light[k] else shares[k])
        made = RunCondition(
            stated_rpm=float(round(speeds[k], 0)),
            stated_nm=share * rig.rated_nm,
            true_rpm=speeds[k] * (1 + rng.normal(0, 0.004)),
            true_nm=share * rig.rated_nm * load_error * (1 + rng.normal(0, 0.02)),
            duration_s=round(float(rng.uniform(4, 8)), 2),
            seed=int(rng.integers(2**62)),
            mount_seed=mounts[0],
        )
        conditions.append(made)
        references.append(
            replace(
                made,
                true_rpm=made.true_rpm * (1 + rng.normal(0, 0.004)),
                true_nm=made.true_nm * (1 + rng.normal(0, 0.03)),
                duration_s=round(float(rng.uniform(4, 8)), 2),
                seed=int(rng.integers(2**62)),
                mount_seed=mounts[1],
            )
        )
    return tuple(conditions[:n]), tuple(references[:n]) if has_reference else ()


# --------------------
# Cases on disk: what the diagnosing side may see, and the answers.
# --------------------


LAYOUT = "gearsig blind labels 1"
FILE_TIME = 1_700_000_000
"""Time stamp of every file: the true times would reveal how long each took to make."""


def write_visible(made: CaseRecordings, folder: Path) -> None:
    """Write what the diagnosing side may see, and nothing else.

    condition_1.h5 (and _2), reference_1.h5 … if there are any, each with a rig file of the same name that states its
    operating point, and rig.toml, which is that of condition_1.
    """
    for stem, recordings in (("condition", made.conditions), ("reference", made.references)):
        for i, recording in enumerate(recordings, 1):
            _write(recording, folder / f"{stem}_{i}.h5")
    _write_description(made.conditions[0], folder / "rig.toml")


def labels(case: BlindCase, made: CaseRecordings) -> dict[str, Any]:
    """Return the true answers; see the package's docstring for the keys."""
    conditions = [
        {
            "file": f"condition_{i}.h5",
            "stated_rpm": c.stated_rpm,
            "stated_nm": c.stated_nm,
            "true_rpm": c.true_rpm,
            "true_nm": c.true_nm,
            "load_share": c.stated_nm / case.rig.rated_nm,
        }
        for i, c in enumerate(case.conditions, 1)
    ]
    effects = [
        {
            "name": fault.name,
            "group": EVERY[fault.name].group,
            "severity": fault.severity,
            "unit": EVERY[fault.name].unit,
            "level": fault.level,
            "resembles": EVERY[fault.name].resembles,
            "place": dict(place),
        }
        for fault, place in zip(case.faults, made.places, strict=True)
    ]
    return {
        "layout": LAYOUT,
        "role": case.role,
        "kind": case.kind,
        "effects": effects,
        "has_reference": bool(case.references),
        "conditions": conditions,
        "pair": {"z1": case.rig.pair.z1, "z2": case.rig.pair.z2, "module_mm": case.rig.pair.module_mm},
    }


def _write(recording: Recording, path: Path) -> None:
    bare = Recording(recording.samples, recording.sampling_rate_hz, recording.channels, provenance=Provenance())
    write_recording(bare, path)
    os.utime(path, (FILE_TIME, FILE_TIME))
    _write_description(recording, path.with_suffix(".toml"))


def _write_description(recording: Recording, path: Path) -> None:
    if recording.rig is None:
        raise InputError("the recording carries no rig", where=path.name)
    write_rig(recording.rig, path)
    os.utime(path, (FILE_TIME, FILE_TIME))
