"""Transmission error of a gear pair from encoders or fine tachometers on both shafts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import cos, gcd, pi, radians

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle, find_pulse_edges, pulse_train_angle, tachometer_edges
from gearsig.checks import FloatArray, freeze
from gearsig.errors import InputError, RefusalError
from gearsig.motion._measure import find_roles, role_values, side_of
from gearsig.orders import SynchronousAverage, order_spectrum
from gearsig.recording import Channel, Recording
from gearsig.results import Result
from gearsig.rig import SIDES, GearPair, PulseTimes, Rig, TachometerChannel
from gearsig.spectra import Spectrum

NAME, UNIT = "transmission error", "um"

USUAL_PRESSURE_ANGLE_DEG = 20.0
LARGEST_STEPS, SMALLEST_STEPS = 32, 4
"""Steps per tooth pitch: more show nothing further of the mesh, fewer do not resolve it."""
MIN_TURNS = 2.0
"""Minimum revolutions of the slower gear to separate what each gear repeats."""


@dataclass(frozen=True)
class TransmissionError(Result):
    """δ = r_b1 θ1 − r_b2 θ2 over the driver's tooth pitches, and the parts of it that each gear repeats.

    δ is the lag of the driven gear behind perfect transmission along the line of action, with its mean removed; δ/r_b2
    is the lag as an angle. Textbooks that count the driven gear's lead have the opposite sign.

    Parameters
    ----------
    cycles_um : array, (n_cycles, n_steps)
        δ; row n is the driver's pitch `first_pitch` + n from its angle 0.
    first_pitch, first_driven_pitch : int
        Pitch of each gear, from its angle 0, at the first row; modulo the number of teeth it gives the tooth.
    mesh_um : array, (n_steps,)
        Pattern common to all tooth pairs, mean 0.
    driver_um, driven_um : arrays, (z, n_steps)
        Deviation of each tooth of that gear, mean 0 at each step.
    driver_error_um, driven_error_um : arrays, (z, n_steps)
        Standard errors of these, from the residual.
    base_radii_m : (float, float)
    shafts : (str, str)
    time_s : array, (n_cycles,)
        Middle of each row.
    notes : tuple of str
    """

    cycles_um: FloatArray
    first_pitch: int
    first_driven_pitch: int
    mesh_um: FloatArray
    driver_um: FloatArray
    driven_um: FloatArray
    driver_error_um: FloatArray
    driven_error_um: FloatArray
    base_radii_m: tuple[float, float]
    shafts: tuple[str, str]
    time_s: FloatArray
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "cycles_um", "driver_um", "driven_um", "driver_error_um", "driven_error_um", ndim=2)
        freeze(self, "mesh_um", "time_s")

    def __repr__(self) -> str:
        swings = f"mesh {np.ptp(self.mesh_um):.3g}, driver {np.ptp(self.driver_um):.3g}"
        return (
            f"TransmissionError({swings}, driven gear {np.ptp(self.driven_um):.3g} um peak to peak, "
            f"{len(self.cycles_um)} mesh cycles at {self.speed_rpm:.4g} rpm)"
        )

    @property
    def teeth(self) -> tuple[int, int]:
        """Numbers of teeth of driver and driven gear."""
        return len(self.driver_um), len(self.driven_um)

    @property
    def n_steps(self) -> int:
        """Number of steps per tooth pitch."""
        return int(self.cycles_um.shape[1])

    @property
    def speed_rpm(self) -> float:
        """Mean speed of the driver."""
        n = len(self.time_s) - 1
        return 60.0 * n / self.teeth[0] / float(self.time_s[-1] - self.time_s[0])

    @property
    def mesh_hz(self) -> float:
        """Mesh frequency."""
        return self.speed_rpm / 60.0 * self.teeth[0]

    @cached_property
    def residual_um(self) -> FloatArray:
        """Part that neither the mesh nor a gear repeats, (n_cycles, n_steps)."""
        return np.asarray(self.cycles_um - self.mesh_um - self.driver_um[self.tooth(0)] - self.driven_um[self.tooth(1)])

    def tooth(self, side: int) -> np.ndarray:
        """Tooth of the driver (0) or the driven gear (1) in each row's pitch, from 0, (n_cycles,)."""
        first = (self.first_pitch, self.first_driven_pitch)[side]
        return np.asarray((first + np.arange(len(self.cycles_um))) % self.teeth[side])

    def average(self, side: int) -> SynchronousAverage:
        """Return one revolution of the part of the driver (0) or the driven gear (1), without the mesh."""
        values, error = ((self.driver_um, self.driver_error_um), (self.driven_um, self.driven_error_um))[side]
        n_revolutions = int(len(self.cycles_um) / self.teeth[side])
        highest = self.teeth[side] * self.n_steps / 2.0
        return SynchronousAverage(
            values.reshape(-1), error.reshape(-1), n_revolutions, self.shafts[side], NAME, UNIT, "residual", highest
        )

    def signal(self) -> AngleSignal:
        """Return δ over the driver's angle, for order spectra, maps and averages."""
        z1 = self.teeth[0]
        pitches = self.first_pitch + np.arange(len(self.cycles_um)) + 0.5
        speed = np.gradient(pitches / z1, self.time_s)
        angle = ShaftAngle(self.shafts[0], self.time_s, pitches / z1, speed, "encoder")
        per_revolution = z1 * self.n_steps
        start = self.first_pitch / z1 + 0.5 / per_revolution
        values = self.cycles_um.reshape(1, -1)
        return AngleSignal(values, per_revolution, angle, start, (NAME,), (UNIT,), per_revolution / 2.0)

    def spectrum(self) -> Spectrum:
        """Return the spectrum of peak amplitudes over orders of the driver."""
        return order_spectrum(self.signal(), NAME)


def transmission_error(
    recording: Recording, rig: Rig | None = None, *, pair: str = "", use: Mapping[str, str] | None = None
) -> TransmissionError:
    """Return the transmission error of a gear pair, separated into mesh, driver and driven gear.

    δ = r_b1 θ1 − r_b2 θ2, r_b = m z cos α/2. Sampled over the driver's angle it is separated as

    δ(n, s) = mesh(s) + driver(n mod z1, s) + driven(n mod z2, s) + residual,

    with n the mesh cycle and s the position in it, by least squares at each s. Patterns that both gears repeat, because
    their tooth counts have a common divisor, are divided evenly.

    Parameters
    ----------
    recording : Recording
        With an encoder, an angle or a tachometer of many pulses on each shaft.
    rig : Rig or None
        With teeth and module; default: the recording's own.
    pair : str
        Name of the gear pair; default: the rig's only one.
    use : mapping or None
        "driver angle", "driven angle" → channel; the others are found by position or name.

    Raises
    ------
    InputError
        If several channels fit, a unit is not known, or both angles do not belong to one pair.
    RefusalError
        If an angle, the teeth or the module are missing, a shaft turns back, the recording is too short, or a tooth
        pitch holds fewer than four readings.

    Notes
    -----
    The result is quasi-static if the mesh harmonics of interest are well below the first resonance with tooth
    deflection; otherwise it is the dynamic transmission error.

    An encoder's own errors repeat with its shaft and are in that gear's part: an eccentric disc looks like an eccentric
    gear (order 1), line errors look like pitch errors. Neither changes with load, and both cancel in the difference of
    two recordings unless the encoder was moved in between. Errors within a line repeat many times per tooth and average
    out. Encoders at a distance from their gears add the twist of the shaft between.

    Sources: J. D. Smith, *Gear Noise and Vibration*, 2nd ed., ch. 7 and 8; D. R. Houser, "Gear noise sources and their
    prediction using mathematical models", 1990.
    """
    known = rig or recording.rig
    if known is None:
        raise RefusalError("no rig is known", remedy="give a rig file with teeth and module of the pair")
    gears = _pair_of(known, pair)
    teeth, radii_m = _geometry(gears)
    (t1, angle_1), (t2, angle_2), notes = _both_angles(recording, known, gears, use or {})

    # Both angles at the recording's samples, wherever both are known.
    rate = recording.sampling_rate_hz
    low, high = max(t1[0], t2[0]), min(t1[-1], t2[-1])
    time_s = np.arange(np.ceil(low * rate), np.floor(high * rate) + 1) / rate
    if len(time_s) < 2:
        raise RefusalError("both angles are not known at the same time", remedy="record both shafts together")
    theta = np.interp(time_s, t1, angle_1), np.interp(time_s, t2, angle_2)
    pitches, driven_pitches = (theta[side] * teeth[side] / (2.0 * pi) for side in (0, 1))
    _check_pair(pitches, driven_pitches, teeth)
    error_um = 1e6 * (radii_m[0] * theta[0] - radii_m[1] * theta[1])

    # Means over equal steps of the driver's angle: a low-pass filter that averages the readings in each step.
    turned = float(pitches[-1] - pitches[0])
    readings = [turned / len(time_s), *(float(np.ptp(a)) * z / (2.0 * pi) / len(t) for t, a, z in
                ((t1, angle_1, teeth[0]), (t2, angle_2, teeth[1])))]  # fmt: skip
    n_steps = _n_steps(max(readings), gears)
    rows, first_row, row_time_s = _over_pitches(error_um, pitches, time_s, n_steps)
    offset = float(np.mean(driven_pitches - pitches))
    _check_length(len(rows), teeth)
    rows = rows - rows.mean()
    driven_row = first_row + round(offset)
    parts = _parts(rows, first_row, driven_row, teeth)
    return TransmissionError(
        rows,
        first_row,
        driven_row,
        *parts,
        radii_m,
        (gears.driver, gears.driven),
        row_time_s,
        tuple(notes),
    )


def _pair_of(rig: Rig, name: str) -> GearPair:
    if name:
        return rig.pair(name)
    if len(rig.pairs) != 1:
        names = ", ".join(repr(p.name) for p in rig.pairs) or "none"
        raise InputError(f"the rig has {len(rig.pairs)} gear pairs", where="pair", allowed=f"the name of one: {names}")
    return rig.pairs[0]


def _geometry(pair: GearPair) -> tuple[tuple[int, int], tuple[float, float]]:
    if pair.driver_teeth is None or pair.driven_teeth is None or pair.module_mm is None:
        raise RefusalError(
            f"pair {pair.name!r} lacks teeth or module, from which the base radii follow",
            remedy="add driver_teeth, driven_teeth and module_mm to its [[pair]] table",
        )
    teeth = pair.driver_teeth, pair.driven_teeth
    half_mm = 0.5 * pair.module_mm * cos(radians(pair.pressure_angle_deg or USUAL_PRESSURE_ANGLE_DEG))
    return teeth, (1e-3 * half_mm * teeth[0], 1e-3 * half_mm * teeth[1])


# --------------------
# From channels to the angle of each gear: times and continuous angles.
# --------------------

Angle = tuple[FloatArray, FloatArray]


def _both_angles(
    recording: Recording, rig: Rig, pair: GearPair, use: Mapping[str, str]
) -> tuple[Angle, Angle, list[str]]:
    roles, notes = find_roles(recording, pair, use), []
    angles: dict[str, Angle] = {}
    for side, shaft in zip(SIDES, (pair.driver, pair.driven), strict=True):
        if f"{side} angle" in roles:
            name = roles[f"{side} angle"]
            angles[side] = _from_encoder(role_values(recording, rig, f"{side} angle", name), recording, name)
        elif (stated := _stated_pulses(recording, rig, shaft)) is not None:
            angles[side] = stated
    for side, opposite in (SIDES, SIDES[::-1]):
        channels = [c for c in recording.channels if c.quantity == "tachometer" and side_of(c, pair) == side]
        if side not in angles and len(channels) == 1 and opposite in angles:
            ratio = (pair.driven_teeth or 1) / (pair.driver_teeth or 1)
            angles[side] = _counted(
                recording, channels[0], angles[opposite], ratio if side == "driver" else 1.0 / ratio
            )
    missing = [side for side in SIDES if side not in angles]
    if missing:
        raise RefusalError(
            f"the angle of the {missing[0]} gear was not measured: a transmission error needs both",
            remedy="fit an encoder to each shaft, and give its channel the shaft's name as position in its [[sensor]] "
            f'table, or use it as "{missing[0]} angle"',
        )
    if not pair.pressure_angle_deg:
        notes.append(f"the pressure angle is not stated: {USUAL_PRESSURE_ANGLE_DEG:g}° is assumed")
    for side, (time_s, angle) in list(angles.items()):
        if angle[-1] < angle[0]:
            angles[side] = time_s, -angle
            notes.append(f"the {side} angle counts down; its sign was reversed")
    return angles["driver"], angles["driven"], notes


def _from_encoder(angle_rad: FloatArray, recording: Recording, name: str) -> Angle:
    """Read an angle at its samples; if it is constant between counts, at the times of the counts."""
    angle, step_s = np.unwrap(angle_rad), 1.0 / recording.sampling_rate_hz
    steps = np.diff(angle)
    sizes = np.unique(np.abs(steps))
    largest = float(sizes[-1])
    apart = np.diff(sizes, prepend=0.0)
    count_rad = float(np.min(apart[apart > 1e-3 * largest], initial=largest))
    moved = np.abs(steps) > 0.5 * count_rad
    if largest == 0.0:
        raise RefusalError(f"the angle in channel {name!r} is constant", remedy="record while it turns")
    if np.mean(moved) < 0.5:  # only the time of each count is known, to within a sample
        at = np.flatnonzero(moved)
        return (at + 0.5) * step_s, 0.5 * (angle[at] + angle[at + 1])
    return np.arange(len(angle)) * step_s, angle


def _stated_pulses(recording: Recording, rig: Rig, shaft: str) -> Angle | None:
    """Return the angle from the speed source if that is pulses on this shaft."""
    source = recording.speed_source if recording.speed_source is not None else rig.speed
    if isinstance(source, PulseTimes | TachometerChannel) and (source.shaft or rig.reference_shaft) == shaft:
        if isinstance(source, PulseTimes):
            return _from_pulses(source.times_s, source.pulses_per_revolution, 0.0)
        edges = tachometer_edges(recording, source)
        if len(edges.times_s) > 1:
            return _from_pulses(edges.times_s, source.pulses_per_revolution, edges.tick_s)
    return None


def _counted(recording: Recording, channel: Channel, counterpart: Angle, ratio: float) -> Angle:
    """Return the angle from a tachometer; the other gear's angle and the teeth give its pulses per revolution."""
    edges = find_pulse_edges(recording.values(channel.name), recording.sampling_rate_hz)
    ends = edges.times_s[[0, -1]] if len(edges.times_s) > 1 else np.zeros(2)
    turned = abs(float(np.diff(np.interp(ends, counterpart[0], counterpart[1]))[0])) / (2.0 * pi) * ratio
    pulses = (len(edges.times_s) - 1) / turned if turned > 0.0 else 0.0
    if pulses < 1.0 or abs(pulses - round(pulses)) > 0.1:
        raise RefusalError(
            f"tachometer {channel.name!r} gives {pulses:.4g} pulses per revolution by the teeth, which is not a whole "
            "number",
            remedy="check teeth and pulses, and record longer",
        )
    return _from_pulses(edges.times_s, round(pulses), edges.tick_s)


def _from_pulses(times_s: FloatArray, per_revolution: int, tick_s: float) -> Angle:
    angle = pulse_train_angle(times_s, per_revolution, tick_s=tick_s)
    return angle.time_s, 2.0 * pi * angle.revolutions


# --------------------
# Averages over the driver's pitches, and the parts that each gear repeats.
# --------------------


def _check_pair(pitches: FloatArray, driven: FloatArray, teeth: tuple[int, int]) -> None:
    """Refuse a shaft that turns backwards, and angles that do not belong to one pair of gears in mesh."""
    back = float(np.max(np.maximum.accumulate(pitches) - pitches))
    if back > 0.5:
        raise RefusalError(
            f"the driver turns back by {back:.3g} tooth pitches",
            remedy="cut the recording where it does; `gearsig start-stop` is for machines that turn back",
        )
    between = driven - pitches
    if float(np.ptp(between)) > 0.5:
        turned, follows = float(pitches[-1] - pitches[0]), float(driven[-1] - driven[0])
        raise InputError(
            f"the driver turns by {turned:.6g} tooth pitches and the driven gear by {follows:.6g}",
            where="angles",
            allowed=f"the same, with {teeth[0]} and {teeth[1]} teeth",
            remedy="check teeth, units and scales, and whether both channels belong to this pair",
        )


def _n_steps(pitches_per_reading: float, pair: GearPair) -> int:
    n = min(int(1.0 / pitches_per_reading), LARGEST_STEPS)
    if n < SMALLEST_STEPS:
        raise RefusalError(
            f"a tooth pitch of pair {pair.name!r} holds {1.0 / pitches_per_reading:.2g} readings of an angle; at least "
            f"{SMALLEST_STEPS} are needed",
            remedy="use encoders or tachometers with more lines, a lower speed, or a higher sampling rate",
        )
    return n


def _check_length(n_cycles: int, teeth: tuple[int, int]) -> None:
    if n_cycles < MIN_TURNS * max(teeth):
        raise RefusalError(
            f"the recording holds {n_cycles} tooth pitches; {MIN_TURNS:g} revolutions of the slower gear are "
            f"{MIN_TURNS * max(teeth):.0f}",
            remedy="record longer",
        )


def _over_pitches(
    error_um: FloatArray, pitches: FloatArray, time_s: FloatArray, n_steps: int
) -> tuple[FloatArray, int, FloatArray]:
    """Return means over steps of the pitch, (n_cycles, n_steps), the first pitch, and the mean time of each pitch."""
    place = np.floor(pitches * n_steps).astype(np.int64)
    start = int(place.min() // n_steps)
    place -= start * n_steps
    n_rows = int(place.max() // n_steps) + 1
    size = n_rows * n_steps
    n = np.bincount(place, minlength=size).reshape(n_rows, n_steps)
    sums = np.bincount(place, error_um, minlength=size).reshape(n_rows, n_steps)
    times = np.bincount(place, time_s, minlength=size).reshape(n_rows, n_steps)
    # Steps hardly longer than a reading are sometimes empty: a single one is interpolated from its neighbours.
    empty = n.ravel() == 0
    means = np.interp(np.arange(size), np.flatnonzero(~empty), sums.ravel()[~empty] / n.ravel()[~empty])
    full = np.flatnonzero(~(empty & np.roll(empty, 1)).reshape(n_rows, n_steps).any(axis=1) & (n.sum(axis=1) > 0))
    full = full[(full > 0) & (full < n_rows - 1)]  # the first and last pitch may be incomplete
    if len(full) and np.any(np.diff(full) > 1):  # the longest run without a gap
        runs = np.split(full, np.flatnonzero(np.diff(full) > 1) + 1)
        full = max(runs, key=len)
    if not len(full):
        return np.empty((0, n_steps)), start, np.empty(0)
    rows = means.reshape(n_rows, n_steps)[full]
    return rows, start + int(full[0]), times[full].sum(axis=1) / n[full].sum(axis=1)


def _parts(
    rows: FloatArray, first: int, first_driven: int, teeth: tuple[int, int]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Separate rows into mesh, driver teeth and driven teeth, with standard errors of both.

    The normal equations contain how often each tooth and each pair of teeth occurred; their pseudo-inverse gives the
    minimum-norm solution, which divides evenly what both gears repeat.
    """
    z1, z2 = teeth
    n = np.arange(len(rows))
    i, k = (first + n) % z1, (first_driven + n) % z2
    met = np.bincount(i * z2 + k, minlength=z1 * z2).reshape(z1, z2).astype(np.float64)
    normal = np.block([[np.diag(met.sum(axis=1)), met], [met.T, np.diag(met.sum(axis=0))]])
    mesh = rows.mean(axis=0)
    sums = np.zeros((z1 + z2, rows.shape[1]))
    np.add.at(sums, i, rows - mesh)
    np.add.at(sums, z1 + k, rows - mesh)
    inverse = np.linalg.pinv(normal, rcond=1e-9, hermitian=True)
    profiles = inverse @ sums
    driver, driven = profiles[:z1], profiles[z1:]
    shift = driver.mean(axis=0) + driven.mean(axis=0)
    driver, driven, mesh = driver - driver.mean(axis=0), driven - driven.mean(axis=0), mesh + shift
    residual = rows - mesh - driver[i] - driven[k]
    spare = max(len(rows) - (z1 + z2 - gcd(z1, z2)), 1)
    scatter = np.sqrt(np.square(residual).sum(axis=0) / spare)
    error = np.sqrt(np.maximum(np.diag(inverse), 0.0))[:, None] * scatter
    return mesh - mesh.mean(), driver, driven, error[:z1], error[z1:]
