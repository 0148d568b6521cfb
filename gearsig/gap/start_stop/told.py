"""Everything that some cycles of a start–stop recording tell, and how it changes from one machine to another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.start_stop.contact_part import ContactPart, Flanks, contact_part, prepare_flanks
from gearsig.gap.start_stop.cycles import CycledMotion
from gearsig.gap.start_stop.load_part import LoadEquation, LoadPart, load_part, prepare_load
from gearsig.gap.start_stop.ripple_part import orders_of, ripple_part, runs_of
from gearsig.motion.impacts import Impact, find_impacts

NAMES = (
    "play",
    "deflection",
    "curve",
    "inertia",
    "load_friction",
    "flank_friction",
    "tooth",
    "next_tooth",
    "ripple",
    "next_ripple",
    "driver_wave",
    "driven_wave",
    "off_centre",
    "impact",
    "contact_scatter",
    "load_scatter",
)
"""Of the changes, see `change_of`."""

CURVE_PART, WAVE_PART = 0.1, 0.2
"""Of the deflection under the ordinary load: curve and waves of sound gears differ by that."""
TOOTH_PART = 0.01
"""Of it: teeth differ by that at least; by how much they do is read off the recording, see `spot_of`."""
RIPPLE_PART, OFF_CENTRE_PART, FRICTION_STEP = 0.01, 0.03, 0.02
"""Of the mean torque; of the ordinary drive; of the coefficient: below it nothing is told from nothing."""
FEW_WAVES = 6.0
"""Of an order in one run: fewer, and the course of a start and a stop passes for a ripple."""
ORDINARY_DEFLECTION_UM = 20.0
BESIDE = 2
"""Orders on either side into which a ripple leaks: a run is short."""
LEAST_SCATTER_UM, LEAST_SCATTER_PART = 0.5, 0.01


@dataclass(frozen=True)
class Told:
    """What some cycles tell.

    Parameters
    ----------
    contact : ContactPart
    load : LoadPart
    ripple : array, (n_orders,)
        Amplitude over mean torque.
    impact_mps : float
        Median over the cycles of the hardest impact; nan where none can be seen.
    ripple_waves : array, (n_orders,)
        How many waves of each order an ordinary run holds.
    """

    contact: ContactPart
    load: LoadPart
    ripple: FloatArray
    impact_mps: float
    ripple_waves: FloatArray


@dataclass(frozen=True)
class Spot:
    """Where a change was found, and what teeth and orders differ by ordinarily.

    Parameters
    ----------
    tooth : int
        Of the driver, from 0.
    order : int
        Place among the orders of the ripple.
    tooth_step_um : float
        Scatter of the changes of all teeth.
    ripple_step : array, (n_orders,)
        Part of the mean torque that a run's own course may put there.
    next_tooth_um : float
        Change of the tooth that changed next most: a cracked one must yield more to be seen.
    """

    tooth: int
    order: int
    tooth_step_um: float
    ripple_step: FloatArray
    next_tooth_um: float


@dataclass(frozen=True)
class Examined:
    """A recording with all that is prepared once."""

    cycles: CycledMotion

    @cached_property
    def flanks(self) -> Flanks:
        """Samples that tell where the flanks are."""
        return prepare_flanks(self.cycles)

    @cached_property
    def equation(self) -> LoadEquation | None:
        """Of the driven gear."""
        return prepare_load(self.cycles)

    @cached_property
    def orders(self) -> NDArray[np.int64]:
        """Of the ripple."""
        return orders_of(self.cycles)

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """Flanks that met; none where they cannot be seen."""
        m = self.cycles.motion
        whole = contact_part(self.flanks, np.ones(len(m.driver_angle_rad), dtype=bool))
        if not np.isfinite(whole.play_um):
            return ()
        try:
            return find_impacts(m, whole.zero_m, half_backlash_m=0.5e-6 * whole.play_um)
        except RefusalError:
            return ()

    @property
    def every(self) -> tuple[int, ...]:
        """Numbers of all cycles."""
        return tuple(range(self.cycles.n_cycles))

    def tell(self, wanted: tuple[int, ...]) -> Told:
        """Return what some cycles tell."""
        rows = self.cycles.samples_of(wanted)
        return Told(
            contact_part(self.flanks, rows),
            load_part(self.equation, rows),
            ripple_part(self.cycles, wanted, self.orders),
            self._hardest(wanted),
            self.orders * self._revolutions_of_a_run,
        )

    @cached_property
    def _revolutions_of_a_run(self) -> float:
        """Median over the runs."""
        turned = [float(np.ptp(angle)) / (2.0 * np.pi) for angle in runs_of(self.cycles)]
        return float(np.median(turned)) if turned else 0.0

    def _hardest(self, wanted: tuple[int, ...]) -> float:
        rate = self.cycles.motion.sampling_rate_hz
        last = len(self.cycles.number) - 1
        by_cycle: dict[int, float] = {}
        for impact in self.impacts:
            cycle = int(self.cycles.number[min(round(impact.time_s * rate), last)])
            by_cycle[cycle] = max(by_cycle.get(cycle, 0.0), impact.speed_mps)
        found = [speed for cycle, speed in by_cycle.items() if cycle in wanted]
        return float(np.median(found)) if found else float("nan")


def spot_of(now: Told, other: Told) -> Spot:
    """Return the tooth and the order that changed most over what the others did.

    Teeth: the scatter of their changes, 1.4826 of the median deviation, so that a tooth is judged by the other teeth
    and not by what another make differs by. Orders: f (1 + (w₀/w)³), w the waves of an order in one run: the trend of a
    run of one revolution cannot be told from an order of four.
    """
    teeth, ripple = now.contact.teeth_um - other.contact.teeth_um, now.ripple - other.ripple
    known = teeth[np.isfinite(teeth)]
    scatter = 1.4826 * float(np.median(np.abs(known - np.median(known)))) if len(known) else 0.0
    tooth_step = float(np.hypot(scatter, TOOTH_PART * _deflection(now, other)))
    waves = np.maximum(np.minimum(now.ripple_waves, other.ripple_waves), 1e-3)
    steps = RIPPLE_PART * (1.0 + (FEW_WAVES / waves) ** 3)
    tooth = _largest(teeth)
    return Spot(tooth, _largest(ripple / steps), tooth_step, steps, max(float(np.nan_to_num(_but(teeth, tooth))), 0.0))


def change_of(now: Told, other: Told, curve_shape: FloatArray, at: Spot | None = None) -> FloatArray:
    """Return how far what is told changed, (n,) by `NAMES`; nan where it cannot be told.

    Levels (play, deflection, inertia, friction of the load, impact, scatter) in dB. What is ordinarily near zero and
    may have a sign is given as 20 lg e · asinh(x/2f), f what sound machines differ by: for large x in dB over it. Tooth
    and ripple are given over the next largest, f as `spot_of` says.

    Parameters
    ----------
    now, other : Told
        Of two machines, or one machine at two times; or measured and simulated.
    curve_shape : array
        Course of the compression over the mesh cycle that worn flanks give; its mean is 0.
    at : Spot or None
        Tooth and order to look at, and their steps. None: those that changed most.
    """
    c, d = now.contact, other.contact
    a, b = now.load, other.load
    spot = at or spot_of(now, other)
    teeth = (c.teeth_um - d.teeth_um) / spot.tooth_step_um
    ripple = (now.ripple - other.ripple) / spot.ripple_step
    deflection, drive = _deflection(now, other), b.drive_nm
    values = (
        _level(c.play_um, d.play_um),
        _level(c.deflection_um, d.deflection_um),
        _signed(_projected(c.curve_um - d.curve_um, curve_shape), CURVE_PART * deflection),
        _level(a.inertia_kg_m2, b.inertia_kg_m2),
        _level(a.friction_nm, b.friction_nm),
        _signed(a.flank_friction - b.flank_friction, FRICTION_STEP),
        _signed(_at(teeth, spot.tooth), 1.0) - _signed(_but(teeth, spot.tooth), 1.0),
        _signed(_but(teeth, spot.tooth), 1.0),
        _signed(_at(ripple, spot.order), 1.0) - _signed(_but(ripple, spot.order, BESIDE), 1.0),
        _signed(_but(ripple, spot.order, BESIDE), 1.0),
        _signed(_size(c.waves_um[:2] - d.waves_um[:2]), WAVE_PART * deflection),
        _signed(_size(c.waves_um[2:] - d.waves_um[2:]), WAVE_PART * deflection),
        _signed(_size(a.off_centre_nm - b.off_centre_nm), OFF_CENTRE_PART * drive),
        _level(now.impact_mps, other.impact_mps),
        _level(np.hypot(c.scatter_um, LEAST_SCATTER_UM), np.hypot(d.scatter_um, LEAST_SCATTER_UM)),
        _level(np.hypot(a.scatter_nm, LEAST_SCATTER_PART * drive), np.hypot(b.scatter_nm, LEAST_SCATTER_PART * drive)),
    )
    return np.array(values, dtype=np.float64)


def _deflection(now: Told, other: Told) -> float:
    """Return what a pair of teeth yields under the ordinary load; an ordinary value where no torque tells it."""
    known = (one.contact.deflection_um for one in (other, now) if np.isfinite(one.contact.deflection_um))
    return float(next(known, ORDINARY_DEFLECTION_UM))


def _level(now: float, other: float) -> float:
    return 20.0 * float(np.log10(now / other)) if now > 0.0 and other > 0.0 else float("nan")


def _signed(value: float, step: float) -> float:
    """Return 20 lg e · asinh(x/2f)."""
    return float(20.0 / np.log(10.0) * np.arcsinh(value / (2.0 * step))) if step > 0.0 else float("nan")


def _projected(curve: FloatArray, shape: FloatArray) -> float:
    """Return how far a curve runs along a shape of the same length, as the span between its ends."""
    known = np.isfinite(curve)
    if np.sum(known) < len(curve) // 2:
        return float("nan")
    s = shape[known] - np.mean(shape[known])
    c = curve[known] - np.mean(curve[known])
    return float(np.ptp(shape) * np.sum(s * c) / np.sum(s * s))


def _largest(values: FloatArray) -> int:
    return int(np.nanargmax(values)) if np.any(np.isfinite(values)) else 0


def _at(values: FloatArray, place: int) -> float:
    return float(values[place]) if len(values) else float("nan")


def _but(values: FloatArray, place: int, beside: int = 0) -> float:
    """Return the largest of the others, those beside it left out."""
    rest = np.delete(values, np.arange(max(place - beside, 0), min(place + beside + 1, len(values))))
    return float(np.nanmax(rest)) if np.any(np.isfinite(rest)) else float("nan")


def _size(vector: FloatArray) -> float:
    return float(np.hypot(*vector))
