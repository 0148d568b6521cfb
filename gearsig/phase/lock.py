"""What a Poincaré section is locked to: the cycles of a mesh or the revolutions of a shaft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig


@dataclass(frozen=True)
class CycleLock:
    """A shaft angle, and how many cycles make one of its revolutions.

    Parameters
    ----------
    angle : ShaftAngle
    cycles_per_revolution : float
        1 for the shaft itself, the mesh order for a gear pair, 1/2 for every second revolution.
    name : str
        E.g. "mesh of stage 1".
    """

    angle: ShaftAngle
    cycles_per_revolution: float
    name: str

    def __post_init__(self) -> None:
        positive(self.cycles_per_revolution, "cycles_per_revolution")

    def times_s(self, start_s: float, end_s: float, phase_cycles: float = 0.0) -> FloatArray:
        """Return the times between `start_s` and `end_s` at which a cycle is `phase_cycles` old, (n,).

        The angle's piecewise cubic is inverted exactly.

        Raises
        ------
        RefusalError
            If the angle is known in no part of that time.
        """
        from gearsig.angle.inversion import times_at

        part = self.angle.between(start_s, end_s)
        cycles = part.revolutions * self.cycles_per_revolution - phase_cycles
        first, last = np.ceil(cycles[0]), np.floor(cycles[-1])
        times = np.empty(max(int(last - first) + 1, 0))
        if len(times):
            times_at(part.time_s, cycles, part.speed_rev_per_s * self.cycles_per_revolution, 0, first, 1.0, times)
        return times


def find_lock(
    recording: Recording, *, pair: str = "", shaft: str = "", rig: Rig | None = None, angle: ShaftAngle | None = None
) -> CycleLock:
    """Return the lock to a gear pair's mesh cycles or to a shaft's revolutions.

    Parameters
    ----------
    recording : Recording
    pair, shaft : str
        One of them; neither: the reference shaft.
    rig : Rig, optional
        Default: the recording's own.
    angle : ShaftAngle, optional
        Of the rig's reference shaft; default: found from the recording, see `find_shaft_angle`.

    Raises
    ------
    InputError
        If both are named, or one that the rig does not have.
    RefusalError
        If there is no shaft angle, or the teeth that lead to the pair or shaft are not known: a section without a
        period means nothing.
    """
    from gearsig.angle.shaft import find_shaft_angle

    rig = rig if rig is not None else recording.rig
    if pair and shaft:
        raise InputError(f"both pair {pair!r} and shaft {shaft!r} are given", allowed="one of them")
    if (pair or shaft) and rig is None:
        raise InputError(
            f"the recording has no rig, so {pair or shaft!r} is not known", remedy="give rig=, or lock to angle alone"
        )
    cycles, name = _cycles(rig, pair, shaft)
    found = angle if angle is not None else find_shaft_angle(recording, rig)
    return CycleLock(found, cycles, name)


def constant_period_lock(period_s: float, end_s: float, name: str = "period") -> CycleLock:
    """Return the lock to a constant, known period, from time zero to `end_s`."""
    rate = 1.0 / positive(period_s, "period_s", "s")
    ends = np.array([0.0, positive(end_s, "end_s", "s")])
    angle = ShaftAngle(name, ends, ends * rate, np.full(2, rate), "constant")
    return CycleLock(angle, 1.0, f"{name} of {period_s:.6g} s")


def _cycles(rig: Rig | None, pair: str, shaft: str) -> tuple[float, str]:
    if rig is None:
        return 1.0, "revolution of the shaft"
    if pair:
        order, name = rig.mesh_order(rig.pair(pair)), f"mesh of {pair}"
    else:
        shaft = shaft or rig.reference_shaft
        order, name = (rig.ratio(shaft) if shaft else 1.0), f"revolution of {shaft or 'the shaft'}"
    if order is None:
        raise RefusalError(
            f"the period of the {name} is not known: tooth counts on the way from shaft {rig.reference_shaft!r} are "
            "missing",
            remedy="complete the teeth in the rig file",
        )
    return order, name
