"""Rows of the population of the gap diagnosis from random gearboxes: healthy, with effects, with signatures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from zlib import crc32

import numpy as np
import typer

from app.studies.drawn_rigs import SAMPLING_RATE_HZ, DrawnHousingMode, DrawnRig, draw_rig, simulate_rig, turns_before
from app.studies.gap.by_hand import (
    SIGNATURES,
    made_by_hand,
    rig_of,
    scene_of,
    vibrations,
    with_foreign_vibration,
    with_signature,
)
from gearsig.cache import write_whole
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap import (
    BY_HAND,
    INDEPENDENT,
    NONE,
    UNKNOWN,
    Features,
    OperatingCondition,
    ReducedRecording,
    change_features,
    features_of,
    reduce_recording,
    run_length_s,
    tooth_load_n_per_mm,
    with_channels_of,
)
from gearsig.recording import MAINS_HZ, Recording
from sims.blind import CATALOGUE, draw_case, record_case
from sims.cracked import STEP_ANGLE_RAD, CrackedTwin
from sims.effects import EffectSetting, effects, largest_runout_um, pitch_of_all_teeth, textbook
from sims.gear_pair import BODY_SHAPES, body_gain
from sims.machine import log_uniform, nominal_of

# --------------------
# Random gearboxes, and their state on another day.
# --------------------


LIGHT_SHARE, LIGHT_TORQUE = 0.4, (0.0005, 0.3)
"""Share of machines at light load, and their torque relative to that of the others: down to idling."""

DURATION_S = (3.0, 7.0)
MOUNTED_ANEW_SHARE = 0.6
"""Share of recordings whose sensors were removed after the reference and mounted again."""

COUPLING_BENDING_SHARES = (0.002, 0.05)
"""Bending stiffness of a coupling over the torsional stiffness of its shaft; catalogues, steel discs to elastomers."""

RIGID_SHARE = 0.25
MOUNTS_HZ, MOUNTS_DAMPING, BODY_KG = (4.0, 40.0), (0.05, 0.3), (20.0, 120.0)
"""For machines not on rigid ground: mounts or frames, and mass of the housing with attached parts, at module 2."""

SPEED_SCATTER, TORQUE_SCATTER = 0.006, 0.05
GAIN_SCATTER, MODE_SCATTER, MODE_GAIN_SCATTER = 0.10, 0.03, 0.20
"""Relative standard deviations of the effects of remounting: gain per channel, mode frequency, gain per mode."""

NOISE_SCATTER = 0.12
"""Standard deviation of the natural logarithm of the sensor noise."""

WANDER_PERCENT, WANDER_HZ, WANDER_SCATTER = (0.005, 0.3), (0.03, 1.0), 0.4
"""Speed wander of every drive: amplitude, frequency, and scatter of the log amplitude between days."""


@dataclass(frozen=True)
class OperatingDay:
    """State and operation of a machine on one day.

    Parameters
    ----------
    drawn : DrawnRig
        The machine with the path and noise of that day.
    speed_factor, torque_factor : float
    gains : tuple of float
        Gains of the channels.
    wander : EffectSetting
        Speed wander, which every drive has.
    """

    drawn: DrawnRig
    speed_factor: float
    torque_factor: float
    gains: tuple[float, float]
    wander: EffectSetting


def draw_machine(rng: np.random.Generator) -> DrawnRig:
    """Draw a healthy gearbox, fully or lightly loaded, with the length of its recordings.

    Gears are arranged side by side, above each other or obliquely, and each housing mode has its own direction, so that
    forces across the line of action are measured as well. Most housings stand on a compliant support, so that low
    shaft orders are measured, too.
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
    """Return the first day, with the machine as drawn."""
    return OperatingDay(drawn, 1.0, 1.0, (1.0, 1.0), _wander(drawn, rng))


def another_day(drawn: DrawnRig, rng: np.random.Generator) -> OperatingDay:
    """Return the machine on another day: at nearly the same operating point, perhaps with remounted sensors."""
    speed, torque = (1.0 + s * float(rng.standard_normal()) for s in (SPEED_SCATTER, TORQUE_SCATTER))
    noise = float(drawn.parameters["noise_mps2"]) * float(np.exp(NOISE_SCATTER * rng.standard_normal()))
    parameters, wander = {**drawn.parameters, "noise_mps2": noise}, _wander(drawn, rng)
    if rng.uniform() >= MOUNTED_ANEW_SHARE:
        return OperatingDay(replace(drawn, parameters=parameters), speed, torque, (1.0, 1.0), wander)
    first, second = np.exp(GAIN_SCATTER * rng.standard_normal(2))
    # If the whole housing moves, the mounting of a sensor matters little.
    modes = tuple(_remounted(mode, rng) if mode.frequency_hz > MOUNTS_HZ[1] else mode for mode in drawn.modes)
    return OperatingDay(
        replace(drawn, parameters=parameters, modes=modes), speed, torque, (float(first), float(second)), wander
    )


def _wander(drawn: DrawnRig, rng: np.random.Generator) -> EffectSetting:
    """Return the speed wander of the drive on one day; its character belongs to the machine."""
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
# Properties of every machine, healthy or not: run-out, unbalance, uneven pitch, a housing that damps high frequencies.
#
# The simulated machines are too perfect: few shaft lines, few sidebands, most of the vibration at high mesh harmonics.
# Measured ones have sidebands 15 to 35 dB below the mesh and most energy at its first two harmonics. So each machine of
# the population gets its own tolerances and paths, the same on every day, which the twin does not know.
#
# Source of typical values: ISO 21940-11:2016 (unbalance), ISO 1328-1:2013 (run-out and pitch, grades 5 to 8);
# R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 2.
# --------------------


SWINGS, LINES, PITCH, PULLS = (0.005, 0.2), (0.0006, 0.1), (0.006, 0.4), (0.003, 0.1)
"""Sizes, as in `sims.effects.Signature`: mesh modulation per revolution, shaft line, uneven pitch (the part repeated
with the teeth is 30 dB below the mesh for good teeth, equal to it at light load), torque variation of the drive."""

CORNER_MESH_ORDERS, STEEPEST, FLAT_SHARE = (0.4, 4.0), 3, 0.2
"""Corner of a falling path, in mesh frequencies; maximum slope, in 6 dB per octave; share of flat paths."""

NOISE, HUM = (0.0004, 0.1), (0.0005, 0.05)
"""Noise and hum of a sensor, relative to the vibration."""

MOUNTING_GAIN, MOUNTING_CORNER, MOUNTING_LINES = 0.12, 0.05, 0.08
"""Standard deviations of the log changes by remounting a sensor: gain, corner of the path, each mesh harmonic."""

TACHOMETER_REV = (5e-6, 1e-3)
"""Timing error of a tachometer mark, in revolutions: marks, thresholds and clocks are not exact."""


@dataclass(frozen=True)
class Ordinary:
    """The tolerances of one machine.

    Parameters
    ----------
    seed : int
        Seed of the machine.
    scales : tuple of float
        Standard deviations of the channels when the machine was new, to which all sizes are relative.
    paths : tuple of (int, float)
        Slope of each channel (0: flat) and corner frequency in Hz, independent of speed.
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
        """Return a recording with the tolerances of this machine; noise and the phase of the hum vary by day.

        Parameters
        ----------
        recording : Recording
        turns : int
            Driver revolutions before the recording begins, which determine the angle of the driven shaft.
        rng : numpy.random.Generator
        changed_paths : sequence of PathChange
            One for each vibration channel; empty: unchanged.
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
        """Return a tachometer signal with jitter on each of its pulses."""
        from scipy.ndimage import map_coordinates

        spread_rev = log_uniform(np.random.default_rng([self.seed, 14]), *TACHOMETER_REV)
        turn = np.floor(scene.revolutions - np.floor(scene.revolutions[0]) + 0.5).astype(np.intp)
        late_rev = spread_rev * rng.standard_normal(turn[-1] + 1)[turn]
        turns_per_sample = (scene.revolutions[-1] - scene.revolutions[0]) / (len(pulses) - 1)
        places = np.arange(len(pulses)) + late_rev / turns_per_sample
        return np.asarray(map_coordinates(pulses, [places], order=1, mode="nearest"))


def mounted_anew(recording: Recording, rng: np.random.Generator) -> Recording:
    """Return a recording as measured by remounted sensors."""
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
    """Return values filtered by a path whose corner moved: (1 + jf/f0)/(1 + jf/f1)."""
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
    answer = (1.0 + 1j * frequency / corner_hz) / (1.0 + 1j * frequency / moved_hz)
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * answer, len(values)))


def _mains_hz(seed: int) -> float:
    return float(np.random.default_rng([seed, 13]).choice(MAINS_HZ))


def _paths(seed: int, scene: textbook.SyntheticScene, n_channels: int) -> list[tuple[int, float]]:
    """Return the slope (0: flat) and corner frequency in Hz of each channel."""
    rng = np.random.default_rng([seed, 10])
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_hz = scene.teeth[0] * turns_hz
    flat, steep = rng.uniform() < FLAT_SHARE, int(rng.integers(1, STEEPEST + 1))
    corner = log_uniform(rng, *CORNER_MESH_ORDERS)
    # Sensors on one housing differ less than different housings.
    return [(0 if flat else steep, mesh_hz * corner * log_uniform(rng, 0.6, 1.6)) for _ in range(n_channels)]


def _filtered(values: FloatArray, path: tuple[int, float], rate_hz: float) -> FloatArray:
    from scipy.signal import butter, sosfilt

    steep, corner_hz = path
    if not steep or corner_hz >= 0.45 * rate_hz:
        return values
    return np.asarray(sosfilt(butter(steep, corner_hz, fs=rate_hz, output="sos"), values))


def _tolerances(scene: textbook.SyntheticScene, rng: np.random.Generator) -> list[textbook.Signature]:
    """Return the signatures of the machine's own shafts, gears and drive."""
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


# --------------------
# One recording of the population, reduced and compared, and the table of all recordings.
# --------------------


SEED = 4107

ONE_SENSOR_SHARE = 0.4
"""Share of machines with only one known sensor."""

Recorded = tuple[str, str, float, Recording, float]
"""Label, detail, severity, recording and torque."""
Made = tuple[Recording, ReducedRecording, Iterable[Recorded]]


@dataclass(frozen=True)
class PopulationSample:
    """One recording, reduced.

    Parameters
    ----------
    simulator : str
        Simulator of the machine.
    rig : int
    label, detail : str
        Effect, "none" or "unknown"; `BY_HAND`, options, or the foreign vibration's name.
    severity, torque_nm : float
    load_n_per_mm : float
        Tooth load.
    change, features, simulated : Features
        Change from the healthy reference; features of the recording; features of the twin, which knows only the rig
        file.
    """

    simulator: str
    rig: int
    label: str
    detail: str
    severity: float
    torque_nm: float
    load_n_per_mm: float
    change: Features
    features: Features
    simulated: Features


def samples_of(simulator: str, rig: int, made: Callable[[], Made]) -> list[PopulationSample]:
    """Return the samples of a simulated machine; what cannot be made or reduced is reported and left out.

    Parameters
    ----------
    simulator : str
    rig : int
    made : callable
        Makes the healthy reference, the reduced run of the twin, which knows only the rig file, and all recordings.
    """
    samples: list[PopulationSample] = []
    try:
        reference, run, recordings = made()
        healthy, twin = reduced(reference, rig), _alone(features_of(run))
    except (InputError, RefusalError) as error:
        typer.echo(f"machine {rig}: {error}")
        return samples
    for label, detail, severity, recording, torque_nm in recordings:
        try:
            now = reduced(recording, rig)
            load = tooth_load_n_per_mm(now.frame.pair, torque_nm)
            shown = _alone(change_features(now, healthy)), _alone(features_of(now)), twin
        except (InputError, RefusalError) as error:
            typer.echo(f"machine {rig}, {label}: {error}")
            continue
        samples.append(PopulationSample(simulator, rig, label, detail, severity, torque_nm, load, *shown))
    return samples


def _alone(features: Features) -> Features:
    return replace(features, left_out=())


def reduced(recording: Recording, rig: int) -> ReducedRecording:
    """Return a recording reduced to its sums, with the known channels of its machine."""
    reduced_recording = reduce_recording(recording, rig_of(recording))
    draw = np.random.default_rng([SEED, rig, 1])
    if draw.uniform() >= ONE_SENSOR_SHARE:
        return reduced_recording
    name = str(draw.choice(sorted(reduced_recording.channels)))
    return reduced_recording.of_channels([name])


def put_in_by_hand(
    healthy: Sequence[Recording], n_foreign: int, n_by_hand: int, torque_nm: float, rng: np.random.Generator
) -> Iterator[Recorded]:
    """Yield the healthy recordings, in turn, with foreign vibration, then with `n_by_hand` different signatures."""
    for i in range(n_foreign):
        recording, foreign = with_foreign_vibration(healthy[i % len(healthy)], rng)
        yield UNKNOWN, foreign, 0.0, recording, torque_nm
    names = rng.choice(made_by_hand(healthy[0], torque_nm), n_by_hand, replace=False)
    for i, name in enumerate(map(str, names)):
        yield name, BY_HAND, 0.0, with_signature(healthy[i % len(healthy)], name, rng)[0], torque_nm


def write(path: Path, samples: Sequence[PopulationSample]) -> None:
    """Write the table of samples as arrays of numbers and text."""
    columns = ("simulator", "rig", "label", "detail", "severity", "torque_nm", "load_n_per_mm")
    rows = {key: np.array([getattr(s, key) for s in samples]) for key in columns}
    for name, stem in (("change", "change"), ("features", "feature"), ("simulated", "simulated")):
        figures = [getattr(s, name) for s in samples]
        rows[name] = np.array([f.values for f in figures], dtype=np.float32)
        rows[f"{stem}_scatter"] = np.array([f.scatter for f in figures], dtype=np.float32)
    names = {"change_names": np.array(samples[0].change.names), "feature_names": np.array(samples[0].features.names)}
    write_whole(path, lambda file: np.savez_compressed(file, allow_pickle=False, **names, **rows))


AT_THE_END = ("clipping", "transfer_path")
"""Effects of the measurement chain: added only as signatures, because the machine's tolerances act before them."""


@dataclass(frozen=True)
class PopulationModel:
    """A simulator's part of the population.

    Parameters
    ----------
    name : str
    first_rig : int
        Number of its first gearbox.
    n_mounted_anew, n_foreign, n_by_hand : int
        Recordings of each gearbox: healthy with remounted sensors, with foreign vibration, of each signature.
    simulated : tuple of float
        For each recording with a simulated effect, the share of the range of severities that is left out, see
        `PairTwin.draw`: weak effects carry no information, and most are weak compared with the usual tolerances.
    """

    name: str
    first_rig: int
    n_mounted_anew: int
    n_foreign: int
    n_by_hand: int
    simulated: tuple[float, ...]


CRACKED = PopulationModel("cracked", 0, 4, 7, 3, (0.3, 0.6))
REDUCED = PopulationModel("reduced-fe", 50_000, 3, 4, 1, (0.3, 0.6))
PLAY_SHARE = 0.5
"""Maximum share of the play that a run-out may use: other run-outs and pitch errors need some as well."""
N_HEALTHY = 3
N_PATHS = 2
"""Number of changed paths for each signature: no other recordings contain them."""


def one_rig(model: PopulationModel, index: int) -> list[PopulationSample]:
    """Return the samples of one random gearbox; none if its teeth cannot be made."""
    rig = model.first_rig + index

    def made() -> Made:
        rng = np.random.default_rng([SEED, rig])
        drawn = draw_machine(rng)
        new = _record(model, first_day(drawn, rng), 0)
        ordinary = Ordinary.of(new, rig)
        reference = ordinary.on(new, 0, rng)
        known = rig_of(reference)
        twin = CrackedTwin(known, nominal_of(known))
        point = OperatingCondition(drawn.speed_rpm, drawn.torque_nm)
        run = twin.run(point, seed=rig, duration_s=drawn.duration_s, sampling_rate_hz=SAMPLING_RATE_HZ, noise=1)
        return reference, reduced(run, rig), _recordings(model, drawn, twin, ordinary, rig)

    return samples_of(model.name, rig, made)


def _recordings(
    model: PopulationModel, drawn: DrawnRig, twin: CrackedTwin, ordinary: Ordinary, rig: int
) -> Iterator[Recorded]:
    """Yield all recordings of one gearbox.

    Each has its own seed: if one effect is drawn differently, the others stay the same.
    """
    bare: list[Recording] = []
    healthy: list[Recording] = []
    for run in range(1, N_HEALTHY + 1):
        rng = _chance(rig, NONE, run)
        day = another_day(drawn, rng)
        bare.append(_record(model, day, run))
        healthy.append(ordinary.on(bare[-1], turns_before(drawn, run), rng))
        yield NONE, "", 0.0, healthy[-1], drawn.torque_nm * day.torque_factor
    for i in range(model.n_mounted_anew):
        recording = mounted_anew(healthy[i % N_HEALTHY], _chance(rig, "mounted anew", i))
        yield NONE, "mounted anew", 0.0, recording, drawn.torque_nm
    for i in range(model.n_foreign):
        recording, name = with_foreign_vibration(healthy[i % N_HEALTHY], _chance(rig, UNKNOWN, i))
        yield UNKNOWN, name, 0.0, recording, drawn.torque_nm
    for name in made_by_hand(healthy[0], drawn.torque_nm):
        for i in range(model.n_by_hand):
            recording, strength = with_signature(healthy[i % N_HEALTHY], name, _chance(rig, f"{name} {BY_HAND}", i))
            yield name, BY_HAND, strength, recording, drawn.torque_nm
    for i in range(N_PATHS * model.n_by_hand):
        turns, rng = turns_before(drawn, i % N_HEALTHY + 1), _chance(rig, f"transfer_path {BY_HAND}", i)
        healthy_now, strength = bare[i % N_HEALTHY], float(rng.uniform())
        size, rate_hz = textbook.path_size(strength), healthy_now.sampling_rate_hz
        paths = textbook.draw_path_changes(len(vibrations(healthy_now)), size, rate_hz, rng)
        yield "transfer_path", BY_HAND, strength, ordinary.on(healthy_now, turns, rng, paths), drawn.torque_nm
    names = [e for e in effects() if e not in AT_THE_END]
    for run, (above, name) in enumerate(((a, e) for a in model.simulated for e in names), start=N_HEALTHY + 1):
        rng = _chance(rig, name, run)
        day = another_day(drawn, rng)
        try:
            added = twin.draw(name, rng, above=above)
            setting = EffectSetting(name, _turning(name, added.severity, drawn, twin), dict(added.options))
            recording = ordinary.on(_record(model, day, run, setting), turns_before(drawn, run), rng)
        except (InputError, RefusalError) as error:
            typer.echo(f"{name}: {error}")
            continue
        detail = ", ".join(f"{k}={v}" for k, v in setting.options.items())
        yield name, detail, setting.severity, recording, drawn.torque_nm * day.torque_factor


def _turning(name: str, severity: float, drawn: DrawnRig, twin: CrackedTwin) -> float:
    """Return a severity at which this machine, whose play the twin does not know, turns freely at any load."""
    if name != "eccentricity":
        return severity
    play_um = 2.0 * float(drawn.parameters["half_backlash_um"])
    return min(severity, largest_runout_um(play_um, twin.nominal.pressure_angle_deg, PLAY_SHARE))


def _chance(rig: int, name: str, i: int) -> np.random.Generator:
    return np.random.default_rng([SEED, rig, crc32(name.encode()), i])


def _record(model: PopulationModel, day: OperatingDay, run: int, setting: EffectSetting | None = None) -> Recording:
    recording = simulate_rig(
        day.drawn,
        model=model.name,
        severity=0.0,
        run=run,
        speed_factor=day.speed_factor,
        torque_factor=day.torque_factor,
        further=[day.wander, *([setting] if setting is not None else [])],
        step_angle_rad=STEP_ANGLE_RAD,
    )
    gains = iter(day.gains)
    factors = np.array([next(gains) if c.is_vibration else 1.0 for c in recording.channels])
    return replace(recording, samples=recording.samples * factors[:, None])


# --------------------
# Cases of the independent rig's development gears for the population of the gap diagnosis.
#
# The signs of an effect differ between simulators: learning from several generalises better to a machine unlike any of
# them. The gears of the calibration and evaluation cases are not among these, nor are the independent rig's effects
# outside the catalogue: unknown causes must be recognised by being unlike all known ones.
# --------------------


FIRST_RIG, MAX_CONDITIONS = 100_000, 2
MIN_LEVEL = 0.25
"""Minimum level, 0 (barely noticeable) to 1 (strong)."""
ROUND = (*CATALOGUE, NONE)
N_BY_HAND = 2


def one_case(index: int) -> list[PopulationSample]:
    """Return the samples of one case: with its effect, without it, and some with signatures added to the latter."""
    rng = np.random.default_rng([SEED, 2, index])
    cause = ROUND[index % len(ROUND)]
    case = draw_case(
        rng,
        "development",
        kind=NONE if cause == NONE else "single",
        effect=None if cause == NONE else cause,
        level=None if cause == NONE else float(rng.uniform(MIN_LEVEL, 1.0)),
        with_reference=True,
    )
    recorded = record_case(case)
    severity = case.faults[0].severity if case.faults else 0.0
    samples: list[PopulationSample] = []
    for i, now in enumerate(recorded.conditions):
        rig, healthy = FIRST_RIG + MAX_CONDITIONS * index + i, (recorded.twins or recorded.conditions)[i]
        three = now, healthy, recorded.references[i]
        made = partial(_condition, rig, cause, severity, case.conditions[i].stated_nm, three, rng)
        samples += samples_of(INDEPENDENT, rig, made)
    return samples


def _condition(
    rig: int,
    cause: str,
    severity: float,
    torque_nm: float,
    recordings: tuple[Recording, Recording, Recording],
    rng: np.random.Generator,
) -> Made:
    """Return the reference of one condition, the twin at its speed and stated torque, and the recordings to compare."""
    now, healthy, reference = recordings

    def compared() -> Iterator[Recorded]:
        yield NONE, "", 0.0, healthy, torque_nm
        if cause != NONE:
            yield cause, "", severity, now, torque_nm
        for name, detail, _, recording, torque in put_in_by_hand([healthy], 1, N_BY_HAND, torque_nm, rng):
            yield name, detail, severity if name == cause else 0.0, recording, torque

    return reference, reduced_twin(now, rig, torque_nm), compared()


def reduced_twin(recording: Recording, rig: int, torque_nm: float) -> ReducedRecording:
    """Return the reduced run of the twin at a recording's speed and the stated torque, with its channel names."""
    reduced_recording, known = reduced(recording, rig), rig_of(recording)
    simulated = CrackedTwin(known, nominal_of(known)).run(
        OperatingCondition(60.0 * reduced_recording.speed_hz, torque_nm),
        seed=rig,
        duration_s=run_length_s(reduced_recording),
        sampling_rate_hz=recording.sampling_rate_hz,
        noise=1,
    )
    return with_channels_of(reduce_recording(simulated, known), reduced_recording)
