"""The crack estimate where encoders on both shafts show a tooth as well: beside the vibration, or in its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import exp, hypot
from typing import Any

import numpy as np

from gearsig.errors import RefusalError, answer_or_none
from gearsig.prepared import PreparedRecording
from gearsig.rig import SIDES
from gearsig.severity._features import ReferenceRefusalError
from gearsig.severity._model import (
    CHIPPED,
    CRACKED,
    KINDS,
    LARGEST_BOUND_PERCENT,
    NO_MARK,
    NORMAL_90,
    SPALLED,
    TEETH_COUNT,
    CrackEstimate,
    NoCrackSeen,
    UnlikeCracksError,
)
from gearsig.severity._pair import ASSUMED, PairFacts, finite_element_percent, normal_n_per_mm, percent_per_mm
from gearsig.severity._tooth_error import (
    CLEARLY_A_TOOTH,
    CRACK,
    UNDECIDED,
    ToothErrorEvidence,
    load_known_tooth_errors,
    tooth_error_evidence,
)


def with_encoders(
    by_vibration: Callable[[], CrackEstimate | NoCrackSeen],
    prepared: PreparedRecording,
    before: PreparedRecording,
    facts: PairFacts,
) -> CrackEstimate | NoCrackSeen:
    """Return the answer from the vibration and, where there are encoders, from what they show or why nothing."""
    unseen: list[str] = []
    ask = partial(tooth_error_evidence, prepared.recording, before.recording, prepared.rig)
    measured = answer_or_none(ask, "No evidence from the encoders", unseen, let_through=ReferenceRefusalError)
    encoders = None if measured is None else measured.with_load(normal_n_per_mm(facts), facts.teeth)

    def by_encoders(evidence: ToothErrorEvidence, odds: float, shaft: str = "") -> CrackEstimate | None:
        ask = partial(_by_encoders, evidence, prepared, before, facts, odds, shaft)
        return answer_or_none(ask, "No estimate from the encoders", unseen)

    answer: CrackEstimate | NoCrackSeen
    try:
        answer = by_vibration()
    except ReferenceRefusalError:
        raise
    except RefusalError as refusal:
        # Where the vibration shows a damaged tooth, the encoders need not show it as clearly, and cannot rule it out.
        is_shown, alone = isinstance(refusal, UnlikeCracksError), None
        if encoders is not None and encoders.is_seen:
            alone = by_encoders(encoders, UNDECIDED if is_shown else CLEARLY_A_TOOTH)
        bound = None if encoders is None or is_shown else _none_by_encoders(encoders, prepared, before, facts)
        why = f"By the vibration there is no estimate: {refusal.reason}"
        said = [*([] if encoders is None else [encoders.text]), *(f"{reason}." for reason in unseen)]
        searched = refusal.looked_at if isinstance(refusal.looked_at, tuple) else ()
        instead = alone or (None if bound is None else replace(bound, searched=searched))
        if instead is None:
            if not said:
                raise
            raise type(refusal)(" ".join([*said, why]), remedy=refusal.remedy, looked_at=refusal.looked_at) from None
        return replace(instead, reasons=(*instead.reasons, f"{why}.", *(f"{reason}." for reason in unseen)))
    if encoders is not None:
        shown = (UNDECIDED, answer.shaft) if isinstance(answer, CrackEstimate) else (CLEARLY_A_TOOTH, "")
        answer = _together(answer, encoders, by_encoders(encoders, *shown) if encoders.is_seen else None, facts)
    else:
        answer = with_assumption(answer)
    return replace(answer, reasons=(*answer.reasons, *(f"{reason}." for reason in unseen)))


def with_assumption(answer: CrackEstimate | NoCrackSeen) -> CrackEstimate | NoCrackSeen:
    """Return a depth by the vibration with what it assumes of the tooth."""
    if isinstance(answer, NoCrackSeen):
        return answer
    per_mm = answer.depth_percent / answer.depth_mm
    assumed = ASSUMED.format(depth_mm=finite_element_percent(answer.depth_percent) / per_mm)
    return replace(answer, reasons=(*answer.reasons, assumed))


KIND_OF_FAULT = {CRACK: CRACKED, "chipped_tooth": CHIPPED, "tooth_spall": SPALLED}
FAULT_PRIORS = {CRACKED: 0.5, CHIPPED: 0.25, SPALLED: 0.25}
"""As in `KindModel`."""

ASSUMED_BY_ENCODERS = (
    "The depth by the encoders follows from the size of the change and the load, for a crack through the whole face "
    "width; its interval holds for rack-shaped and for finite-element teeth."
)


def _by_encoders(
    encoders: ToothErrorEvidence,
    prepared: PreparedRecording,
    before: PreparedRecording,
    facts: PairFacts,
    odds: float,
    shaft: str = "",
) -> CrackEstimate | None:
    """Return the estimate from the transmission error; None below these odds of a damaged tooth.

    Where both gears show the change, that on `shaft` is meant.

    Raises
    ------
    RefusalError
        If encoders are not known to show the depth at this load or with this gear.
    """
    if encoders.odds_of_a_tooth < odds:
        return None
    weights = {KIND_OF_FAULT[name]: p * FAULT_PRIORS[KIND_OF_FAULT[name]] for name, p in encoders.probabilities.items()}
    is_driven = encoders.gear == SIDES[1] or (not encoders.gear and shaft == facts.pair.driven)
    shaft, teeth = ((facts.pair.driver, facts.driver_teeth), (facts.pair.driven, facts.driven_teeth))[is_driven]
    log_percent, half_width = _log_percent_by_encoders(encoders, facts, teeth)
    gear, has_mark = SIDES[is_driven], prepared.has_mark(shaft)
    place_rev = encoders.places_rev[gear]
    if has_mark:  # the encoder's zero may be elsewhere
        passed = prepared.angle_of(shaft).revolutions_at(np.array([encoders.passes_s[gear]]))
        place_rev = float(passed[0]) % 1.0
    return CrackEstimate(
        shaft=shaft,
        gear=f"{facts.pair.name}/{shaft}",
        tooth=int(place_rev * teeth) % teeth + 1 if has_mark else None,
        angle_deg=360.0 * place_rev,
        gear_is_certain=bool(encoders.gear),
        **_depth(log_percent, half_width, percent_per_mm(teeth, facts.module_mm)),
        p_value=1.0 / encoders.odds_of_a_tooth,
        with_reference=True,
        reasons=(
            encoders.text,
            TEETH_COUNT if has_mark else NO_MARK,
            ASSUMED_BY_ENCODERS,
            *_encoder_doubts(prepared, before),
        ),
        kind_probabilities={kind: weights[kind] / sum(weights.values()) for kind in KINDS},
    )


def _encoder_doubts(prepared: PreparedRecording, before: PreparedRecording) -> list[str]:
    return [
        f"{whose}{problem.text}; the encoders may be wrong for it."
        for whose, of in (("", prepared), ("The reference: ", before))
        for problem in of.grave_problems([c.name for c in of.recording.channels if c.quantity == "encoder"])
    ]


def _none_by_encoders(
    encoders: ToothErrorEvidence, prepared: PreparedRecording, before: PreparedRecording, facts: PairFacts
) -> NoCrackSeen | None:
    """Return below which depth a crack would change the transmission error by less than its noise; None if too deep."""
    if encoders.is_seen:
        return None
    limits = []
    for teeth in facts.teeth:
        try:
            log_percent, half_width = _log_percent_by_encoders(encoders, facts, teeth)
        except RefusalError:
            return None
        percent = exp(log_percent + half_width)  # 95 % of cracks that change it so little are less deep
        limits.append((percent / percent_per_mm(teeth, facts.module_mm), percent))
    below_mm, below_percent = max(limits)
    if below_percent > LARGEST_BOUND_PERCENT:
        return None
    reasons = (encoders.text, ASSUMED_BY_ENCODERS, *_encoder_doubts(prepared, before))
    return NoCrackSeen(below_mm, below_percent, 1.0, True, reasons=reasons)


def _log_percent_by_encoders(encoders: ToothErrorEvidence, facts: PairFacts, teeth: int) -> tuple[float, float]:
    """Return ln of a crack's depth in percent of the root, and the half width of its 90 % interval.

    Raises
    ------
    RefusalError
        If the load or the number of teeth is beyond those of known cracks, or the depth would be.
    """
    known, load_n_per_mm = load_known_tooth_errors(), normal_n_per_mm(facts)
    log_percent, spread = known.log_percent(encoders.rms_um, load_n_per_mm, teeth)
    known.check_reach(load_n_per_mm / facts.module_mm, teeth, exp(log_percent - spread))
    return log_percent, NORMAL_90 * spread


def _depth(log_percent: float, half_width: float, percent_per_mm: float) -> dict[str, Any]:
    """Return the fields of a `CrackEstimate` that state the depth; the interval is of ln(percent)."""
    low, percent, high = (min(exp(log_percent + n * half_width), 100.0) for n in (-1.0, 0.0, 1.0))
    return {
        "depth_mm": percent / percent_per_mm,
        "depth_percent": percent,
        "interval_mm": (low / percent_per_mm, high / percent_per_mm),
        "interval_percent": (low, high),
    }


def _together(
    answer: CrackEstimate | NoCrackSeen, encoders: ToothErrorEvidence, alone: CrackEstimate | None, facts: PairFacts
) -> CrackEstimate | NoCrackSeen:
    """Return the answer from vibration and encoders together.

    Of the same tooth, kinds are multiplied, and two estimates of ln(depth) are weighted by their inverse variances, as
    if they were independent; both depend on how the tooth gives way, which both intervals allow for. Where the two name
    different teeth, the vibration's answer stands, unless only the encoders tell the gear, and clearly.

    Parameters
    ----------
    answer : CrackEstimate or NoCrackSeen
        From the vibration.
    encoders : ToothErrorEvidence
    alone : CrackEstimate or None
        From the encoders, on the gear of the vibration's answer where both gears show the change.
    facts : PairFacts
    """
    if alone is None:
        answer = with_assumption(answer)
        return replace(answer, reasons=(*answer.reasons, encoders.text))
    by_vibration, by_encoders = f"By the vibration alone: {answer.text}", f"By the encoders alone: {alone.text}"
    if isinstance(answer, NoCrackSeen):
        return replace(alone, reasons=(*alone.reasons, by_vibration))
    is_clear = encoders.odds_of_a_tooth >= CLEARLY_A_TOOTH
    if answer.shaft != alone.shaft and alone.gear_is_certain and is_clear and not answer.gear_is_certain:
        return replace(alone, reasons=(*alone.reasons, by_vibration))
    teeth = facts.teeth[answer.shaft != facts.pair.driver]
    apart = 0 if answer.tooth is None or alone.tooth is None else abs(answer.tooth - alone.tooth)
    if answer.shaft != alone.shaft or min(apart, teeth - apart) > NEIGHBOURS:
        against = f"{by_encoders} The vibration says otherwise, and its answer is given."
        answer = with_assumption(answer)
        return replace(answer, reasons=(*answer.reasons, encoders.text, against))
    weights = {
        k: answer.kind_probabilities.get(k, FAULT_PRIORS[k]) * alone.kind_probabilities[k] / FAULT_PRIORS[k]
        for k in KINDS
    }
    answer = replace(
        answer,
        gear_is_certain=answer.gear_is_certain or alone.gear_is_certain,
        p_value=answer.p_value * alone.p_value,
        kind_probabilities={kind: weight / sum(weights.values()) for kind, weight in weights.items()},
    )
    # The middle of the interval lies between both kinds of teeth, as the encoders' depth does.
    low, high = np.log(answer.interval_percent).tolist()
    of_encoders, half_of_encoders = _log_percent_by_encoders(encoders, facts, teeth)
    log_percent, half = 0.5 * (low + high), 0.5 * (high - low)
    if abs(log_percent - of_encoders) > hypot(half, half_of_encoders):
        other = f"{by_encoders} Its depth as a crack differs from the vibration's, which is given."
        answer = with_assumption(answer)
        return replace(answer, reasons=(*answer.reasons, encoders.text, other))
    # An interval without width, as at the whole root, does not say how certain the vibration is.
    precisions = [(width or half_of_encoders) ** -2.0 for width in (half, half_of_encoders)]
    mean = (precisions[0] * log_percent + precisions[1] * of_encoders) / sum(precisions)
    return replace(
        answer,
        **_depth(mean, sum(precisions) ** -0.5, answer.depth_percent / answer.depth_mm),
        reasons=(
            *answer.reasons,
            encoders.text,
            ASSUMED_BY_ENCODERS,
            f"{by_encoders} {by_vibration} The depth combines both.",
        ),
    )


NEIGHBOURS = 1
"""Difference of tooth numbers up to which vibration and encoders name the same tooth: each is good to about one."""
