"""What can be noticed when recordings are not of the machine that they are said to be of."""

from __future__ import annotations

import numpy as np

from gearsig.errors import RefusalError
from gearsig.gap.change import turned_difference
from gearsig.gap.frame import DRIVEN, DRIVER, GearFrame
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import average_lines
from gearsig.severity.reference import telling_teeth_apart
from gearsig.severity.shaft_lines import orders_from_mesh

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


def strange_teeth(now: Gathered, name: str) -> list[str]:
    """Say so where little of what repeats with the shafts lies at the mesh harmonics of the rig's teeth.

    Gears of less than some 15 teeth are not noticed: any order lies near one of their harmonics.
    """
    share = max(_mesh_share(now, side) for side in (DRIVER, DRIVEN))
    if share >= LEAST_MESH_SHARE:
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
