"""The gear pair under study, with every order counted on its driver's shaft."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.errors import RefusalError
from gearsig.rig.types import GearPair, Rig

DRIVER, DRIVEN = 0, 1


@dataclass(frozen=True)
class BearingFrame:
    """A bearing's orders, in cycles per revolution of the driver.

    Parameters
    ----------
    name : str
    side : int
        0: on the driver's shaft; 1: on the driven one.
    outer, inner, spin, cage : float
        BPFO, BPFI, BSF, FTF; nan where not known.
    """

    name: str
    side: int
    outer: float
    inner: float
    spin: float
    cage: float


@dataclass(frozen=True)
class GearFrame:
    """A spur gear pair with its shafts and bearings.

    Parameters
    ----------
    pair : GearPair
    shafts : (str, str)
        Of driver and driven gear.
    teeth : (int, int)
    bearings : tuple of BearingFrame
    """

    pair: GearPair
    shafts: tuple[str, str]
    teeth: tuple[int, int]
    bearings: tuple[BearingFrame, ...]

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of either shaft per revolution of the driver."""
        return 1.0, self.teeth[0] / self.teeth[1]


def gear_frame(rig: Rig) -> GearFrame:
    """Return the frame of a rig's only gear pair.

    Raises
    ------
    RefusalError
        If there is no pair or more than one, or its teeth are not known.
    """
    remedy = "describe one pair with both tooth counts in the rig file"
    if len(rig.pairs) != 1:
        have = "no gear pair" if not rig.pairs else f"{len(rig.pairs)} gear pairs"
        raise RefusalError(f"the rig has {have}; the models have one", remedy=remedy)
    pair = rig.pairs[0]
    if pair.driver_teeth is None or pair.driven_teeth is None:
        raise RefusalError(f"the teeth of pair {pair.name!r} are not known", remedy=remedy)
    teeth = (pair.driver_teeth, pair.driven_teeth)
    shafts = (pair.driver, pair.driven)
    orders = (1.0, teeth[0] / teeth[1])
    bearings = []
    for bearing in rig.bearings:
        if bearing.shaft not in shafts:
            continue
        side = shafts.index(bearing.shaft)
        own = {name: order * orders[side] for name, order in bearing.orders().items()}
        nan = float("nan")
        bearings.append(
            BearingFrame(bearing.name, side, *(own.get(name, nan) for name in ("BPFO", "BPFI", "BSF", "FTF")))
        )
    return GearFrame(pair, shafts, teeth, tuple(bearings))
