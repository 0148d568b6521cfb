"""How well crack severity is told on machines that its calibration never saw.

`python tests/benchmarks/severity_cases.py [CASES] [SEED]` draws gearboxes of other teeth, modules, stiffness, damping,
paths and flanks than the calibration's, simulates each with its crack (or none) and as it was before, and prints for
"with a reference" and "alone", tip relief unknown or known to 20 %: how many cracks are seen, the error of the depth,
how often the 90 % interval holds it, false cracks on healthy machines, whether gear and tooth are right, what is
refused. Then cracks as they grow on the same machines, teeth that are chipped or spalled instead, other cracks, and the
presets. Everything comes from one simulator: real machines are less kind.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from math import sqrt

import numpy as np

from app.studies.crack_severity import RELIEF_ERROR, CrackCase, draw_case, draw_tooth_fault
from app.studies.drawn_rigs import simulate_rig
from gearsig.errors import GearsigError, RefusalError
from gearsig.recording import Recording
from gearsig.severity import CRACKED, KINDS, CrackEstimate, NoCrackSeen, estimate_crack
from sims import simulate
from sims.presets import preset, presets

SEED = 9154
"""Not the calibration's."""

DEPTH_CLASSES_MM = ((0.5, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0))

GROWING_MM = (0.5, 1.0, 2.0, 3.0, 4.0)
N_GROWING = 24

Answer = CrackEstimate | NoCrackSeen | RefusalError


@dataclass(frozen=True)
class Outcome:
    """An answer beside the truth: depth in mm (0: healthy), shaft and tooth (from 1) of the crack."""

    depth_mm: float
    shaft: str
    tooth: int
    n_teeth: int
    answer: Answer


def ask(recording: Recording, reference: Recording | None, tip_relief_um: float | None = None) -> Answer:
    """Return the estimate, or the refusal."""
    try:
        return estimate_crack(recording, reference=reference, tip_relief_um=tip_relief_um)
    except RefusalError as refusal:
        return refusal


def outcome(
    case: CrackCase, recording: Recording, depth_mm: float, reference: Recording | None, relief_um: float | None = None
) -> Outcome:
    """Ask for one recording of a drawn case."""
    drawn = case.drawn
    shaft, n_teeth = (("input", drawn.teeth[0]), ("output", drawn.teeth[1]))[drawn.gear == "driven"]
    return Outcome(depth_mm, shaft, drawn.tooth + 1, n_teeth, ask(recording, reference, relief_um))


def roughly_known_relief_um(case: CrackCase) -> float:
    """Return the tip relief as a drawing has it."""
    error = np.random.default_rng(case.drawn.seed).uniform(-RELIEF_ERROR, RELIEF_ERROR)
    return float(case.drawn.parameters["tip_relief_um"]) * (1.0 + error)


def report(title: str, outcomes: list[Outcome]) -> None:
    """Print what the answers are worth."""
    cracked, healthy = [o for o in outcomes if o.depth_mm > 0], [o for o in outcomes if o.depth_mm == 0]
    seen = [o for o in cracked if isinstance(o.answer, CrackEstimate)]
    none_seen = [o for o in cracked if isinstance(o.answer, NoCrackSeen)]
    print(f"\n{title}: {len(cracked)} cracked, {len(healthy)} healthy machines")
    for low, high in DEPTH_CLASSES_MM:
        inside = [o for o in cracked if low <= o.depth_mm < high]
        print(f"  {low:g} to {high:g} mm: seen {share(isinstance(o.answer, CrackEstimate) for o in inside)}", end="")
        errors = [abs(e) for e in errors_mm(inside)]
        print(f", median error {np.median(errors):.2f} mm" if errors else "")
    if seen:
        print_seen(seen)
    print(f"  no crack seen though there is one: {share(isinstance(o.answer, NoCrackSeen) for o in cracked)}", end="")
    held = share(o.depth_mm <= o.answer.below_mm for o in none_seen if isinstance(o.answer, NoCrackSeen))
    print(f'; of these below the stated "below x mm": {held}')
    print(f"  refused: {share(isinstance(o.answer, RefusalError) for o in cracked)} of the cracked,", end="")
    print(f" {share(isinstance(o.answer, RefusalError) for o in healthy)} of the healthy")
    print(f"  crack claimed on a healthy machine: {share(isinstance(o.answer, CrackEstimate) for o in healthy)}")
    for reason, n in Counter(str(o.answer)[:60] for o in outcomes if isinstance(o.answer, RefusalError)).most_common():
        print(f"    {n} × {reason} …")


def print_seen(seen: list[Outcome]) -> None:
    """Print errors, intervals and names of the cracks that were seen."""
    errors = np.array(errors_mm(seen))
    rng = np.random.default_rng(0)
    medians = [np.median(np.abs(rng.choice(errors, len(errors)))) for _ in range(1000)]
    low, high = np.quantile(medians, [0.05, 0.95])
    print(f"  median absolute error {np.median(np.abs(errors)):.2f} mm (90 %: {low:.2f} to {high:.2f}),", end="")
    print(f" 90th percentile {np.quantile(np.abs(errors), 0.9):.2f} mm, bias {np.median(errors):+.2f} mm")
    pairs = [(o, o.answer) for o in seen if isinstance(o.answer, CrackEstimate)]
    covered = share(a.interval_mm[0] <= o.depth_mm <= a.interval_mm[1] for o, a in pairs)
    width = np.median([a.interval_mm[1] - a.interval_mm[0] for _, a in pairs])
    print(f"  90 % interval holds the depth: {covered}, median width {width:.2f} mm")
    print(f"  gear right: {share(a.shaft == o.shaft for o, a in pairs)}", end="")
    named = [(o, a.tooth) for o, a in pairs if a.tooth is not None and a.shaft == o.shaft]
    print(f"; tooth right: {share(o.tooth == tooth for o, tooth in named)}", end="")
    print(f", within one: {share((o.tooth - t + 1) % o.n_teeth <= 2 for o, t in named)}")


def errors_mm(outcomes: list[Outcome]) -> list[float]:
    """Return estimate less truth of those that were seen."""
    return [o.answer.depth_mm - o.depth_mm for o in outcomes if isinstance(o.answer, CrackEstimate)]


def share(hits: object) -> str:
    """Return "k of n (p %, 90 % interval)", by Wilson's score interval."""
    values = [bool(hit) for hit in hits]  # type: ignore[attr-defined]  # any iterable
    n, k, z = len(values), sum(values), 1.645
    if n == 0:
        return "none of 0"
    centre = (k + z * z / 2) / (n + z * z)
    half = z * sqrt(k * (n - k) / n + z * z / 4) / (n + z * z)
    return f"{k} of {n} ({100 * k / n:.0f} %, {100 * max(centre - half, 0):.0f} to {100 * (centre + half):.0f} %)"


def print_kinds(cases: list[CrackCase], seed: int, *, with_reference: bool) -> None:
    """Print what is said of cracks, chips and spalls."""
    rows: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    for i, case in enumerate(cases):
        reference = case.reference if with_reference else None
        if case.drawn.depth_mm > 0:
            rows[CRACKED][said(ask(case.recording, reference))] += 1
        other = draw_tooth_fault(case.drawn, np.random.default_rng([seed, i, 2]))
        if other is not None:
            kind, damaged = other
            rows[kind][said(ask(damaged, reference))] += 1
    print(f"\nKinds, {'with a reference' if with_reference else 'alone'}:")
    for kind, counts in rows.items():
        print(f"  {kind}: " + ", ".join(f"{n} {text}" for text, n in counts.most_common()))


def said(answer: Answer) -> str:
    """Return the kind that is named, or why none is."""
    if isinstance(answer, CrackEstimate):
        return f'"{answer.kind}"'
    return "no crack seen" if isinstance(answer, NoCrackSeen) else "refused"


def print_growing(cases: list[CrackCase], *, with_reference: bool) -> None:
    """Print how the same cracks are told as they grow: the estimate, or what is not seen as 0."""
    found: dict[float, list[Answer]] = {depth: [] for depth in GROWING_MM}
    falls = steps = bounds = 0
    for case in cases:
        last: tuple[float, float] | None = None
        for depth in GROWING_MM:
            try:
                recording = simulate_rig(case.drawn, severity=depth)
            except GearsigError:
                break
            answer = ask(recording, case.reference if with_reference else None)
            found[depth].append(answer)
            if isinstance(answer, RefusalError):
                continue
            seen = isinstance(answer, CrackEstimate)
            now = (answer.depth_mm, answer.interval_mm[1]) if isinstance(answer, CrackEstimate) else (0.0, 0.0)
            if last is not None and (seen or last[0] > 0):
                steps, falls, bounds = steps + 1, falls + (now[0] < last[0]), bounds + (now[1] < last[1])
            last = now
    print(f"\nGrowing cracks, {'with a reference' if with_reference else 'alone'}:")
    for depth, answers in found.items():
        sizes = [a.depth_mm for a in answers if isinstance(a, CrackEstimate)]
        middle = f", median estimate {np.median(sizes):.2f} mm" if sizes else ""
        print(f"  {depth:g} mm: seen {share(isinstance(a, CrackEstimate) for a in answers)}{middle}")
    print(f"  of {steps} steps, {falls} estimates and {bounds} upper bounds fall")


def other_cracks(cases: list[CrackCase]) -> None:
    """Print what becomes of cracks that are not what the calibration knows."""
    kinds: dict[str, dict[str, float | str]] = {
        "at 30°": {"angle_deg": 30.0},
        "at 60°": {"angle_deg": 60.0},
        "over half the width": {"width_percent": 50.0},
    }
    for kind, options in kinds.items():
        outcomes = []
        for case in cases:
            depth = max(case.drawn.depth_mm, 1.0)
            try:
                recording = simulate_rig(case.drawn, severity=depth, options=options)
            except GearsigError:
                continue
            outcomes.append(outcome(case, recording, depth, case.reference))
        claims = [(o, o.answer) for o in outcomes if isinstance(o.answer, CrackEstimate)]
        covered = share(a.interval_mm[0] <= o.depth_mm <= a.interval_mm[1] for o, a in claims)
        print(f"  {kind}: seen {share(isinstance(o.answer, CrackEstimate) for o in outcomes)}", end="")
        print(f", bias {np.median(errors_mm(outcomes)):+.2f} mm, interval holds {covered}")


def all_presets() -> None:
    """Print depth against truth on the simulator's presets, which have a housing of their own."""
    for name in presets("cracked"):
        point = preset("cracked", name).operation.speed_rpm.largest
        before = simulate("cracked", preset=name, duration_s=4.0, speed_rpm=1.003 * point)  # same flanks: same seed
        for depth in (0.5, 1.0, 2.0, 3.0):
            for reference in (before, None):
                recording = simulate("cracked", preset=name, parameters={"crack_depth_mm": depth}, duration_s=4.0)
                answer = ask(recording, reference)
                kind = "with reference" if reference else "alone"
                text = answer.text if not isinstance(answer, RefusalError) else f"refused: {answer.reason[:90]}"
                print(f"  {name}, {depth:g} mm, {kind}: {text}")


def main() -> None:
    """Draw, simulate, ask, print."""
    n_cases = int(sys.argv[1]) if len(sys.argv) > 1 else 150
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else SEED
    drawn = [draw_case(seed, i, for_the_check=True, even=i % 5 == 4) for i in range(n_cases)]
    cases = [case for case in drawn if case is not None]
    for with_reference in (True, False):
        for known in (False, True):
            title = "With a reference" if with_reference else "Alone"
            outcomes = [
                outcome(
                    c,
                    c.recording,
                    c.drawn.depth_mm,
                    c.reference if with_reference else None,
                    roughly_known_relief_um(c) if known else None,
                )
                for c in cases
            ]
            report(title + (", tip relief known" if known else ""), outcomes)
    cracked = [case for case in cases if case.drawn.depth_mm > 0]
    for with_reference in (True, False):
        print_growing(cracked[:N_GROWING], with_reference=with_reference)
    for with_reference in (True, False):
        print_kinds(cases, seed, with_reference=with_reference)
    print("\nOther cracks, with a reference:")
    other_cracks(cracked[:16])
    print("\nPresets:")
    all_presets()


if __name__ == "__main__":
    main()
