"""Gearboxes drawn at random for the population of the gap diagnosis, and how they stand on another day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.studies.drawn_rigs import DrawnHousingMode, DrawnRig, draw_rig
from app.studies.gap.by_hand import SIGNATURES, scene_of, vibrations
from gearsig.checks import FloatArray
from gearsig.recording import MAINS_HZ, Recording
from sims.effects import EffectSetting, pitch_of_all_teeth, textbook
from sims.gear_pair import BODY_SHAPES, body_gain
from sims.machine import log_uniform

LIGHT_SHARE, LIGHT_TORQUE = 0.4, (0.0005, 0.3)
"""Machines that run at light load, and their torque over that of the others: down to what idling takes."""

DURATION_S = (3.0, 7.0)
MOUNTED_ANEW_SHARE = 0.6
"""Recordings between which and their reference the sensors were taken off."""

COUPLING_BENDING_SHARES = (0.002, 0.05)
"""Bending stiffness of a coupling over its shaft's torsional one, by catalogues of steel discs to elastomers."""

RIGID_SHARE = 0.25
MOUNTS_HZ, MOUNTS_DAMPING, BODY_KG = (4.0, 40.0), (0.05, 0.3), (20.0, 120.0)
"""Machines on rigid ground; mounts or frames of the others, and their housings with what moves along, at module 2."""

SPEED_SCATTER, TORQUE_SCATTER = 0.006, 0.05
GAIN_SCATTER, MODE_SCATTER, MODE_GAIN_SCATTER = 0.10, 0.03, 0.20
"""Relative standard deviations of what a changed mounting changes; gains are those of each channel and mode."""

NOISE_SCATTER = 0.12
"""Of the natural logarithm of the sensors' noise."""

WANDER_PERCENT, WANDER_HZ, WANDER_SCATTER = (0.005, 0.3), (0.03, 1.0), 0.4
"""Of every drive's speed: amplitude and frequency, and by how much the amplitude's logarithm differs on another day."""


@dataclass(frozen=True)
class OperatingDay:
    """How a machine stands and runs on one day.

    Parameters
    ----------
    drawn : DrawnRig
        With that day's path and noise.
    speed_factor, torque_factor : float
    gains : tuple of float
        Of the channels.
    wander : EffectSetting
        Of the speed, as every drive's.
    """

    drawn: DrawnRig
    speed_factor: float
    torque_factor: float
    gains: tuple[float, float]
    wander: EffectSetting


def draw_machine(rng: np.random.Generator) -> DrawnRig:
    """Draw a healthy gearbox, full or lightly loaded, with the length of its recordings.

    Gears lie side by side, above each other or aslant, and a housing's modes move each in a direction of their own:
    what pushes across the line of action is heard as well. Most housings stand on something that yields, so that the
    low orders of the shafts are heard, too.
    """
    drawn = draw_rig(rng, for_the_check=False, even=bool(rng.uniform() < 0.1))
    aslant = np.random.default_rng([drawn.seed, 6])
    bends = log_uniform(aslant, *COUPLING_BENDING_SHARES) * float(drawn.parameters["torsional_stiffness_nm_per_rad"])
    lies = {"line_of_action_deg": float(aslant.uniform(-180.0, 180.0)), "coupling_bending_nm_per_rad": bends}
    modes = (*drawn.modes, *_on_mounts(drawn, aslant))
    modes = tuple(replace(mode, direction_deg=float(aslant.uniform(0.0, 180.0))) for mode in modes)
    drawn = replace(drawn, parameters={**drawn.parameters, **lies}, modes=modes)
    if rng.uniform() < LIGHT_SHARE:
        drawn = replace(drawn, torque_nm=drawn.torque_nm * log_uniform(rng, *LIGHT_TORQUE))
    return replace(drawn, depth_mm=0.0, duration_s=float(np.clip(1.2 * drawn.duration_s, *DURATION_S)))


def _on_mounts(drawn: DrawnRig, rng: np.random.Generator) -> tuple[DrawnHousingMode, ...]:
    """Return heave and pitch of the housing as a rigid body, see `sims.gear_pair.body_on_mounts`; rarely none."""
    size = float(drawn.parameters["module_mm"]) / 2.0
    frequency_hz, damping_ratio = log_uniform(rng, *MOUNTS_HZ), rng.uniform(*MOUNTS_DAMPING)
    mass_kg = log_uniform(rng, *BODY_KG) * size**2
    if rng.uniform() < RIGID_SHARE:
        return ()
    gain = body_gain(float(drawn.parameters["bearing_stiffness_n_per_m"]), mass_kg, frequency_hz)
    return tuple(DrawnHousingMode(frequency_hz, damping_ratio, gain, shape) for shape in BODY_SHAPES)


def first_day(drawn: DrawnRig, rng: np.random.Generator) -> OperatingDay:
    """Return the machine as it was drawn."""
    return OperatingDay(drawn, 1.0, 1.0, (1.0, 1.0), _wander(drawn, rng))


def another_day(drawn: DrawnRig, rng: np.random.Generator) -> OperatingDay:
    """Return the machine as it stands on another day: nearly the same point, perhaps with sensors mounted anew."""
    speed, torque = (1.0 + s * float(rng.standard_normal()) for s in (SPEED_SCATTER, TORQUE_SCATTER))
    noise = float(drawn.parameters["noise_mps2"]) * float(np.exp(NOISE_SCATTER * rng.standard_normal()))
    parameters, wander = {**drawn.parameters, "noise_mps2": noise}, _wander(drawn, rng)
    if rng.uniform() >= MOUNTED_ANEW_SHARE:
        return OperatingDay(replace(drawn, parameters=parameters), speed, torque, (1.0, 1.0), wander)
    first, second = np.exp(GAIN_SCATTER * rng.standard_normal(2))
    # Where the whole housing moves, it matters little how a sensor sits.
    modes = tuple(_remounted(mode, rng) if mode.frequency_hz > MOUNTS_HZ[1] else mode for mode in drawn.modes)
    return OperatingDay(
        replace(drawn, parameters=parameters, modes=modes), speed, torque, (float(first), float(second)), wander
    )


def _wander(drawn: DrawnRig, rng: np.random.Generator) -> EffectSetting:
    """Return the drive's wander on one day: its kind belongs to the machine."""
    machine_rng = np.random.default_rng([drawn.seed, 5])
    percent, frequency_hz = (log_uniform(machine_rng, *span) for span in (WANDER_PERCENT, WANDER_HZ))
    today = float(np.exp(WANDER_SCATTER * rng.standard_normal()))
    return EffectSetting("speed_fluctuation", percent * today, {"frequency_hz": frequency_hz})


def _remounted(mode: DrawnHousingMode, rng: np.random.Generator) -> DrawnHousingMode:
    return replace(
        mode,
        frequency_hz=mode.frequency_hz * float(np.exp(MODE_SCATTER * rng.standard_normal())),
        gain=mode.gain * float(np.exp(MODE_GAIN_SCATTER * rng.standard_normal())),
        damping_ratio=mode.damping_ratio * float(np.exp(MODE_GAIN_SCATTER * rng.standard_normal())),
    )


# --------------------
# What every machine has, healthy or not: run-out, unbalance, uneven pitch, a housing that swallows high frequencies.
#
# The simulated machines are too good: few lines of their shafts, few sidebands, most of the vibration at high multiples
# of the mesh. Measured ones have sidebands 15 to 35 dB below the mesh and most energy at its first two harmonics. So
# each machine of the population gets tolerances and paths of its own, the same on every day; the twin knows nothing of
# them.
#
# Source of what is usual: ISO 21940-11:2016 (unbalance), ISO 1328-1:2013 (run-out and pitch, grades 5 to 8);
# R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 2.
# --------------------


SWINGS, LINES, PITCH, PULLS = (0.005, 0.2), (0.0006, 0.1), (0.006, 0.4), (0.003, 0.1)
"""Sizes, as in `sims.effects.Signature`: of a swing of the mesh per turn, of a shaft's line, of uneven pitch
(what the teeth repeat by themselves is 30 dB below the mesh with good ones, as loud as the mesh at light load), of the
drive's pulling."""

CORNER_MESH_ORDERS, STEEPEST, FLAT_SHARE = (0.4, 4.0), 3, 0.2
"""Where a path begins to fall, in mesh frequencies; by how many 6 dB per octave; paths that do not."""

NOISE, HUM = (0.0004, 0.1), (0.0005, 0.05)
"""Of a sensor, over the vibration."""

MOUNTING_GAIN, MOUNTING_CORNER, MOUNTING_LINES = 0.12, 0.05, 0.08
"""Standard deviations of the logarithms of what a sensor that was mounted anew changes: its gain, its path's corner,
each mesh harmonic by itself."""

TACHOMETER_REV = (5e-6, 1e-3)
"""By which a mark comes too early or too late, in revolutions: marks, thresholds and clocks are not exact."""


@dataclass(frozen=True)
class Ordinary:
    """The tolerances of one machine.

    Parameters
    ----------
    seed : int
        Of the machine.
    scales : tuple of float
        The channels' standard deviations when the machine was new, which all sizes are relative to.
    paths : tuple of (int, float)
        Each channel's steepness, 0: flat, and corner frequency in Hz, the same whatever the day's speed.
    """

    seed: int
    scales: tuple[float, ...]
    paths: tuple[tuple[int, float], ...]

    @classmethod
    def of(cls, reference: Recording, seed: int) -> Ordinary:
        """Draw the tolerances of the machine of a healthy recording."""
        scene = scene_of(reference)
        paths = _paths(seed, scene, len(reference.channels))
        return cls(
            seed,
            tuple(
                float(_filtered(row, path, reference.sampling_rate_hz).std())
                for row, path in zip(reference.samples, paths, strict=True)
            ),
            tuple(paths),
        )

    def on(
        self,
        recording: Recording,
        turns: int,
        rng: np.random.Generator,
        changed_paths: Sequence[textbook.PathChange] = (),
    ) -> Recording:
        """Return a recording as this machine makes it; noise and the phase of the hum are that day's.

        Parameters
        ----------
        recording : Recording
        turns : int
            Of the driver, before the recording begins: what belongs to the driven shaft comes at its own place.
        rng : numpy.random.Generator
        changed_paths : sequence of PathChange
            One for each vibration channel; none: they are as ever.
        """
        scene = scene_of(recording)
        scene = replace(scene, revolutions=scene.revolutions + turns)
        mains_hz = _mains_hz(self.seed)
        signatures = _tolerances(scene, np.random.default_rng([self.seed, 11]))
        samples = recording.samples.copy()
        for k, i in enumerate(vibrations(recording)):
            machine_rng, scale = np.random.default_rng([self.seed, 12, i]), self.scales[i]
            values = _filtered(samples[i], self.paths[i], recording.sampling_rate_hz)
            for signature in signatures:
                values = signature.on(values, scene, machine_rng, scale)
            if changed_paths:
                values = changed_paths[k].of(values, recording.sampling_rate_hz)
            values = values + log_uniform(machine_rng, *NOISE) * scale * rng.standard_normal(len(values))
            for n in (1, 2, 3):
                hum = np.sin(2 * np.pi * (n * mains_hz * scene.time_s + rng.uniform()))
                values = values + log_uniform(machine_rng, *HUM) / n * scale * hum
            samples[i] = values
        for i, channel in enumerate(recording.channels):
            if channel.quantity == "tachometer":
                samples[i] = self._jittered(samples[i], scene, rng)
        return replace(recording, samples=samples)

    def _jittered(self, pulses: FloatArray, scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
        """Return a tachometer's signal with each of its pulses a little off."""
        from scipy.ndimage import map_coordinates

        spread_rev = log_uniform(np.random.default_rng([self.seed, 14]), *TACHOMETER_REV)
        turn = np.floor(scene.revolutions - np.floor(scene.revolutions[0]) + 0.5).astype(np.intp)
        late_rev = spread_rev * rng.standard_normal(turn[-1] + 1)[turn]
        turns_per_sample = (scene.revolutions[-1] - scene.revolutions[0]) / (len(pulses) - 1)
        places = np.arange(len(pulses)) + late_rev / turns_per_sample
        return np.asarray(map_coordinates(pulses, [places], order=1, mode="nearest"))


def mounted_anew(recording: Recording, rng: np.random.Generator) -> Recording:
    """Return a recording as sensors would give it that were taken off and put back."""
    scene = scene_of(recording)
    samples = recording.samples.copy()
    for i in vibrations(recording):
        gains = np.exp(MOUNTING_LINES * rng.standard_normal(textbook.N_MESH_HARMONICS))
        signature = textbook.Signature(mesh_gains=tuple(gains.tolist()))
        corner_hz = 0.2 * recording.sampling_rate_hz
        moved = corner_hz * float(np.exp(MOUNTING_CORNER * rng.standard_normal()))
        values = signature.on(samples[i], scene, rng, 0.0)
        values = _shelf(values, corner_hz, moved, recording.sampling_rate_hz)
        samples[i] = values * float(np.exp(MOUNTING_GAIN * rng.standard_normal()))
    return replace(recording, samples=samples)


def _shelf(values: FloatArray, corner_hz: float, moved_hz: float, rate_hz: float) -> FloatArray:
    """Return values through a path whose corner moved: (1 + jf/f0)/(1 + jf/f1)."""
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
    answer = (1.0 + 1j * frequency / corner_hz) / (1.0 + 1j * frequency / moved_hz)
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * answer, len(values)))


def _mains_hz(seed: int) -> float:
    return float(np.random.default_rng([seed, 13]).choice(MAINS_HZ))


def _paths(seed: int, scene: textbook.SyntheticScene, n_channels: int) -> list[tuple[int, float]]:
    """Return each channel's steepness, 0: flat, and corner frequency in Hz."""
    rng = np.random.default_rng([seed, 10])
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_hz = scene.teeth[0] * turns_hz
    flat, steep = rng.uniform() < FLAT_SHARE, int(rng.integers(1, STEEPEST + 1))
    corner = log_uniform(rng, *CORNER_MESH_ORDERS)
    # Sensors on one housing differ less than housings do.
    return [(0 if flat else steep, mesh_hz * corner * log_uniform(rng, 0.6, 1.6)) for _ in range(n_channels)]


def _filtered(values: FloatArray, path: tuple[int, float], rate_hz: float) -> FloatArray:
    from scipy.signal import butter, sosfilt

    steep, corner_hz = path
    if not steep or corner_hz >= 0.45 * rate_hz:
        return values
    return np.asarray(sosfilt(butter(steep, corner_hz, fs=rate_hz, output="sos"), values))


def _tolerances(scene: textbook.SyntheticScene, rng: np.random.Generator) -> list[textbook.Signature]:
    """Return what the machine's own shafts, gears and drive do."""
    tolerances = []
    for order in scene.shaft_orders:
        swing, late = log_uniform(rng, *SWINGS), log_uniform(rng, *SWINGS)
        lines = [log_uniform(rng, *LINES) * textbook.tone(n * order, scene, rng) for n in (1, 2, 3)]
        tolerances.append(
            textbook.Signature(
                1.0 + swing * textbook.tone(order, scene, rng),
                textbook.MAX_ADVANCE * late / scene.teeth[0] * textbook.tone(order, scene, rng),
                tuple(lines),
            )
        )
    tolerances += [pitch_of_all_teeth(scene, log_uniform(rng, *PITCH), rng) for _ in scene.shaft_orders]
    return [*tolerances, SIGNATURES["torque_ripple"](scene, log_uniform(rng, *PULLS), rng)]
