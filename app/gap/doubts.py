"""What can be noticed when recordings are not of the machine that they are said to be of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.gap.conditions import Condition
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.change import lines_of_shaft, turned_difference
from gearsig.gap.frame import DRIVEN, DRIVER, GearFrame
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import average_lines, visible_orders
from gearsig.gap.spots import shaft_words
from gearsig.gap.tooth import STEPS_PER_TOOTH, mesh_power, residual_lines, tooth_energy
from gearsig.severity.calibration import load_calibration
from gearsig.severity.reference import telling_teeth_apart
from gearsig.severity.shaft_lines import ShaftLines, orders_from_mesh

NEAR_MESH, SLOW = 2, 5
"""Orders of a shaft beside a mesh harmonic that belong to it, and orders from 0 that are the shaft's own."""

LEAST_MESH_SHARE = 0.5
"""Of what repeats with either shaft. Machines of the simulator have 0.7 and more, the heaviest damage included; a pair
of 55/75 teeth taken for one of 29/47 has 0.45."""

LEAST_PATTERN = 3.0
"""Power of the lines that tell teeth apart over that of the noise in them: with less, any two patterns differ."""

LEAST_AGREEMENT = 0.6
"""Of both gears' patterns. One damaged gear lowers its own to 0.2, and leaves the other's at 0.8 and more; another
specimen of the same drawing has 0.2 and 0.5, and so have two gears that have worn heavily."""


WELL_EXPLAINED, HARDLY_EXPLAINED = 0.5, 0.15
"""Share, over that by chance, of what repeats with a shaft that mesh harmonics hold. Of the sample recordings, damaged
ones included, the right number of teeth has 0.35 and more (0.08 with the heaviest damage, and then no other number has
much); most wrong ones have less than 0, a few 0.2 to 0.6."""

FEWEST_TEETH, MOST_TEETH = 12, 200

LOST_DB, OWN_DB = 10.0, 6.0
"""By how much one tooth's burst has become less since the reference, and by how much it stands above the reference's
middling tooth: sound teeth that differ by chance have up to 7 dB, and lose nothing from one day to the next."""

CLEAR_CHANGE, ALONE = 10.0, 4.0
"""Energy of the change at one tooth over that at the middling tooth, and over the largest more than a tooth away: worn
flanks and another path to the sensor change all teeth, some of them much."""


def doubts_of(condition: Condition) -> list[str]:
    """Return what speaks strongly for a wrong rig file, or for recording and reference exchanged."""
    name, reference = condition.facts.name, condition.reference
    texts = wrong_teeth(condition.now, name)
    if reference is None or texts:
        return texts
    return wrong_teeth(reference, f"The reference of {name}") or exchanged(condition.now, reference, name)


def wrong_teeth(now: Gathered, name: str) -> list[str]:
    """Say so where a shaft's own mark shows that its gear has not the rig's teeth but another number.

    Where angle counts from a mark on the very shaft, its average holds for any teeth. Next to nothing of it must lie at
    the mesh harmonics of the rig's number of teeth, and most of it at those of another one; multiples and divisors of
    the right number are not noticed.
    """
    for side in (DRIVER, DRIVEN):
        if not now.marks[side]:
            continue
        stated, shares = now.frame.teeth[side], _explained(now, side)
        best = max(shares, key=shares.__getitem__, default=stated)
        if shares.get(stated, 1.0) < HARDLY_EXPLAINED and shares.get(best, 0.0) > WELL_EXPLAINED:
            shaft = shaft_words(now.frame, side)
            remark = (
                f"{name}: the teeth do not fit. What repeats with {shaft} does so {best} times a revolution, and the "
                f"rig file gives its gear {stated} teeth. Unless it is a recording of another machine, the rig file is "
                "wrong; until that is settled nothing here can be relied on."
            )
            return [remark]
    return []


def _explained(now: Gathered, side: int) -> dict[int, float]:
    """Return number of teeth → share of a shaft's average near its mesh harmonics over that by chance, (s − c)/(1 − c).

    Two harmonics must be visible.
    """
    whole = []
    for sums in now.channels.values():
        power = np.abs(average_lines(sums, side)[0]) ** 2
        power = power[: visible_orders(now, side, len(power)) + 1]
        power[: SLOW + 1] = 0.0
        whole.append(power / max(float(power.sum()), 1e-300))
    shares = np.mean(whole, axis=0)
    orders = np.arange(len(shares))
    found = {}
    for teeth in range(FEWEST_TEETH, min(MOST_TEETH, len(shares) // 2) + 1):
        near = orders_from_mesh(orders, teeth) <= NEAR_MESH
        by_chance = float(near[SLOW + 1 :].mean())
        found[teeth] = (float(shares[near].sum()) - by_chance) / (1.0 - by_chance)
    return found


def exchanged(now: Gathered, reference: Gathered, name: str) -> list[str]:
    """Say so where one tooth stands out in the reference and is ordinary in the recording.

    Damage adds a burst to one tooth and takes none away. What the change alone cannot tell, its sign does.
    """
    for side in (DRIVER, DRIVEN):
        try:
            difference, _ = turned_difference(now, reference, side)
        except RefusalError:
            return []
        own = lines_of_shaft(now, side).lines[:, : difference.lines.shape[1]]
        changed, here, there = (
            _energy(now, side, difference, lines) for lines in (difference.lines, own, own - difference.lines)
        )
        at = int(np.argmax(changed))
        lost_db, own_db = _decibel(there[at] / here[at]), _decibel(there[at] / np.median(there))
        elsewhere = np.roll(changed, -at)[2 * STEPS_PER_TOOTH : -2 * STEPS_PER_TOOTH]
        is_one = changed[at] >= max(CLEAR_CHANGE * float(np.median(changed)), ALONE * float(elsewhere.max()))
        if is_one and lost_db >= LOST_DB and own_db >= OWN_DB:
            place = (at / len(changed) + (0.5 - load_calibration().lag_pitches) / difference.teeth) % 1.0
            tooth = f"Tooth {int(place * difference.teeth) + 1}" if now.marks[side] else "One tooth"
            remark = (
                f"{name}: recording and reference may have been exchanged. {tooth} of {shaft_words(now.frame, side)} "
                f"(at {360.0 * place:.0f}°) stands {own_db:.0f} dB above the middling one in the reference, and is "
                f"{lost_db:.0f} dB weaker in the recording; damage adds such a burst and takes none away. If so, what "
                "is named is what the reference has: give the two the other way round."
            )
            return [remark]
    return []


def _energy(now: Gathered, side: int, difference: ShaftLines, lines: NDArray[np.complex128]) -> FloatArray:
    """Return the energy within one pitch of what tells the teeth apart, mean over channels."""
    rows = [
        tooth_energy(
            residual_lines(row, difference.teeth, difference.highest_order, difference.other_teeth)
            / np.sqrt(mesh_power(now, sums, side)),
            difference.teeth,
        )
        for row, sums in zip(lines, now.channels.values(), strict=True)
    ]
    energy: FloatArray = np.maximum(np.mean(rows, axis=0), 1e-300)
    return energy


def _decibel(ratio: float) -> float:
    return 10.0 * float(np.log10(ratio))


def strange_teeth(now: Gathered, name: str) -> list[str]:
    """Say so where little of what repeats with the shafts lies at the mesh harmonics of the rig's teeth.

    Gears of less than some 15 teeth are not noticed: any order lies near one of their harmonics.
    """
    share = max(_mesh_share(now, side) for side in (DRIVER, DRIVEN))
    if share >= LEAST_MESH_SHARE or wrong_teeth(now, name):  # that is said by itself
        return []
    remark = (
        f"{name}: only {100 * share:.0f} % of what repeats with a shaft lies at mesh harmonics of the rig's "
        f"{_teeth(now.frame)} teeth. Is it a recording of this machine?"
    )
    return [remark]


def strange_pattern(now: Gathered, reference: Gathered, name: str) -> list[str]:
    """Say so where neither gear's pattern of teeth is that of the reference; flawless gears have none to compare."""
    if not all(_has_pattern(one, side) for one in (now, reference) for side in (DRIVER, DRIVEN)):
        return []
    try:
        agreements = [turned_difference(now, reference, side)[1] for side in (DRIVER, DRIVEN)]
    except RefusalError:
        return []
    if max(agreements) >= LEAST_AGREEMENT:
        return []
    both = " and ".join(f"{max(a, 0.0):.2f}" for a in agreements)
    remark = (
        f"{name}: the patterns of the teeth of both gears agree with the reference by {both} only, where 1 is the same "
        "gears. The reference is of another machine, or both gears have worn since."
    )
    return [remark]


def _has_pattern(gathered: Gathered, side: int) -> bool:
    """Return whether what tells a gear's teeth apart stands clear of noise in the channel where it is clearest."""
    clearest = 0.0
    for sums in gathered.channels.values():
        lines, noise = average_lines(sums, side)
        used = telling_teeth_apart(np.arange(len(lines)), gathered.frame.teeth[side])
        clearest = max(clearest, float(np.sum(np.abs(lines[used]) ** 2) / np.sum(noise[used])))
    return clearest >= LEAST_PATTERN


def _mesh_share(now: Gathered, side: int) -> float:
    """Return the share of the average's power near mesh harmonics, mean over channels."""
    teeth = now.frame.teeth[side]
    shares = []
    for sums in now.channels.values():
        power = np.abs(average_lines(sums, side)[0]) ** 2
        orders = np.arange(len(power))
        above = orders > SLOW
        total = float(power[above].sum())
        shares.append(
            float(power[above & (orders_from_mesh(orders, teeth) <= NEAR_MESH)].sum()) / total if total > 0 else 1.0
        )
    return float(np.mean(shares))


def _teeth(frame: GearFrame) -> str:
    return "/".join(str(z) for z in frame.teeth)
