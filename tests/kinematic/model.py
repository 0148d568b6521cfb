"""The kinematic model: everything that is put into a signal, as plain numbers.

What it represents: vibration that is a known function of shaft angle (mesh harmonics with modulation, a damaged tooth,
bearing impacts, shaft orders), passed through fixed filters, with noise.

What it does not represent: dynamics. Nothing here follows from masses, stiffness or load: amplitudes do not change with
torque, damage does not change stiffness, backlash and friction do not exist, resonances are excited only through the
fixed path and the ring-downs, and shaft angles are free of transmission error. Use it to test analyses against closed
forms and for samples, not to learn how large the signature of a fault is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray
from gearsig.rig import Rig, known_ratio
from sims.measure import ColouredNoise, MainsHum, Tachometer
from tests.kinematic.speed import SpeedProfile

# --------------------
# A local defect in a rolling bearing: impacts at the ball-pass order, with slip.
# --------------------


_ORDER_OF = {"outer": "BPFO", "inner": "BPFI"}


@dataclass(frozen=True)
class BearingFault:
    """A local defect on one race.

    The angle between two impacts is that of the kinematics times 1 + s ε, ε standard normal and independent: the train
    is not periodic but drifts, as slipping rolling elements make it. An inner-race defect turns through the load zone:
    its impacts are weighted with (1 + cos 2πθ)/2 of its shaft's angle θ.

    Parameters
    ----------
    bearing : str
        A bearing of the rig, with known geometry or orders.
    race : str
        "outer" or "inner".
    impulse_mps2 : float
        Envelope of the ring-down at its start.
    resonance_hz, damping_ratio : float
        The mode that rings.
    slip_fraction : float
        s, 0 to 0.2; 0.01 is usual.
    impulse_spread : float
        Standard deviation of the impacts over their mean.

    Notes
    -----
    Source: J. Antoni, R. B. Randall, "A stochastic model for simulation and diagnostics of rolling element bearings
    with localized faults", J. Vib. Acoust. 125 (2003).
    """

    bearing: str
    race: str
    impulse_mps2: float
    resonance_hz: float = 3500.0
    damping_ratio: float = 0.05
    slip_fraction: float = 0.01
    impulse_spread: float = 0.1

    @property
    def order_name(self) -> str:
        """BPFO or BPFI."""
        return _ORDER_OF[self.race]


def knock_angles(
    order: float, slip_fraction: float, first_rev: float, last_rev: float, rng: np.random.Generator
) -> FloatArray:
    """Shaft angles of the impacts in revolutions: a random first one, then steps of (1 + s ε)/order, never negative."""
    n = int(np.ceil((last_rev - first_rev) * order * 1.2)) + 20
    steps = np.maximum(1 + slip_fraction * rng.standard_normal(n), 0.0) / order
    angles = first_rev + rng.uniform() / order + np.concatenate([[0.0], np.cumsum(steps)])
    inside: FloatArray = angles[angles < last_rev]
    return inside


def load_zone_weight(race: str, shaft_rev: FloatArray) -> FloatArray:
    """1 for a defect that stands in the load zone (outer race), (1 + cos 2πθ)/2 for one that turns through it."""
    if race == "outer":
        return np.ones(np.shape(shaft_rev))
    turning: FloatArray = 0.5 * (1 + np.cos(2 * np.pi * np.asarray(shaft_rev)))
    return turning


# --------------------
# The transfer path from the mesh to a sensor: a gain and a few resonances.
# --------------------


@dataclass(frozen=True)
class PathResonance:
    """One mode of the path: adds `gain` times the direct signal at its frequency, in phase.

    Parameters
    ----------
    frequency_hz : float
    damping_ratio : float
        Half the relative half-power bandwidth.
    gain : float
    """

    frequency_hz: float
    damping_ratio: float
    gain: float


@dataclass(frozen=True)
class TransferPath:
    """H(f) = G (1 + Σ g_i R_i(f)), R_i a resonator with R_i(f_i) = 1.

    Parameters
    ----------
    gain : float
        G.
    resonances : tuple of Resonance
    """

    gain: float = 1.0
    resonances: tuple[PathResonance, ...] = ()

    def apply(self, signal: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Filter a signal causally, (n,) → (n,)."""
        from scipy.signal import lfilter

        total = np.array(signal, dtype=np.float64)
        for mode in self.resonances:
            b, a = _resonator(mode, sampling_rate_hz)
            total += mode.gain * lfilter(b, a, signal)
        return self.gain * total

    def response(self, frequency_hz: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Complex H at the given frequencies, as `apply` realises it."""
        from scipy.signal import freqz

        total = np.ones(np.shape(frequency_hz), dtype=complex)
        for mode in self.resonances:
            b, a = _resonator(mode, sampling_rate_hz)
            total += mode.gain * freqz(b, a, worN=np.asarray(frequency_hz), fs=sampling_rate_hz)[1]
        result: FloatArray = self.gain * total
        return result


def _resonator(mode: PathResonance, sampling_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Second-order peak filter: gain 1 and phase 0 at its frequency, -3 dB bandwidth 2 ζ f."""
    from scipy.signal import iirpeak

    b, a = iirpeak(mode.frequency_hz, 1 / (2 * mode.damping_ratio), fs=sampling_rate_hz)
    return b, a


# --------------------
# What a sensor adds: its path, coloured noise and mains hum.
# --------------------


@dataclass(frozen=True)
class SensorChannel:
    """One accelerometer: value = path applied to the machine's vibration + hum + noise.

    Parameters
    ----------
    name : str
    path : TransferPath
    noise : ColouredNoise
    hum : MainsHum
    position : str
    """

    name: str = "a1"
    path: TransferPath = field(default_factory=TransferPath)
    noise: ColouredNoise = field(default_factory=ColouredNoise)
    hum: MainsHum = field(default_factory=MainsHum)
    position: str = ""


# --------------------
# Mesh vibration: harmonics of the tooth passage, modulated once per revolution and from tooth to tooth.
# --------------------


@dataclass(frozen=True)
class MeshHarmonics:
    """Harmonics of a pair's mesh order, before modulation and transfer path.

    Parameters
    ----------
    pair : str
    amplitudes_mps2 : tuple of float
        Peak amplitude of harmonics 1, 2, …; independent of speed and load.
    phases_rad : tuple of float
        Of the cosine at angle 0; missing ones are 0.
    """

    pair: str
    amplitudes_mps2: tuple[float, ...]
    phases_rad: tuple[float, ...] = ()


@dataclass(frozen=True)
class MeshModulation:
    """A gear's once-per-revolution (or `order` times) modulation of its mesh, as eccentricity causes it.

    The amplitude is multiplied by 1 + a cos(2π k θ + φ), and harmonic h of the mesh is shifted by h b sin(2π k θ + φ).

    Parameters
    ----------
    pair, shaft : str
        The gear.
    amplitude_fraction : float
        a, 0 to 1: each first-order sideband is a/2 of its carrier.
    phase_deviation_rad : float
        b, of the first mesh harmonic. Run-out e of the pitch circle gives about b = e/(m/2) rad for module m.
    order : int
        k, cycles per revolution of the gear.
    angle_rad : float
        φ.
    """

    pair: str
    shaft: str
    amplitude_fraction: float = 0.0
    phase_deviation_rad: float = 0.0
    order: int = 1
    angle_rad: float = 0.0


@dataclass(frozen=True)
class ToothVariation:
    """Ordinary differences between the teeth of a gear, as manufacture leaves them.

    Each tooth gets a Gaussian amplitude factor and phase; between teeth they are interpolated by the gear's own
    Fourier series up to half the tooth number.

    Parameters
    ----------
    pair, shaft : str
        The gear.
    amplitude_fraction_rms, phase_rms_rad : float
        Standard deviation over the teeth.
    """

    pair: str
    shaft: str
    amplitude_fraction_rms: float = 0.02
    phase_rms_rad: float = 0.02


def harmonic_sum(
    mesh: MeshHarmonics, mesh_cycles: FloatArray, amplitude_factor: FloatArray, phase_rad: FloatArray
) -> FloatArray:
    """Σ_h A_h g(t) cos(2π h c(t) + φ_h + h ψ(t)).

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c, mesh cycles since angle 0.
    amplitude_factor, phase_rad : arrays, (n,)
        g and ψ.
    """
    phases = (*mesh.phases_rad, *(0.0,) * (len(mesh.amplitudes_mps2) - len(mesh.phases_rad)))
    total = np.zeros_like(mesh_cycles)
    for h, (amplitude, phase) in enumerate(zip(mesh.amplitudes_mps2, phases, strict=True), start=1):
        total += amplitude * np.cos(h * (2 * np.pi * mesh_cycles + phase_rad) + phase)
    return amplitude_factor * total


def modulation_terms(modulation: MeshModulation, shaft_rev: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(a cos, b sin) of a modulation at the given angles of its shaft."""
    angle = 2 * np.pi * modulation.order * shaft_rev + modulation.angle_rad
    return modulation.amplitude_fraction * np.cos(angle), modulation.phase_deviation_rad * np.sin(angle)


def tooth_values(n_teeth: int, standard_deviation: float, rng: np.random.Generator) -> FloatArray:
    """Zero-mean Gaussian value for each tooth, (n_teeth,)."""
    values = rng.standard_normal(n_teeth)
    result: FloatArray = standard_deviation * (values - values.mean())
    return result


def between_teeth(values: FloatArray | Sequence[float], shaft_rev: FloatArray) -> FloatArray:
    """Trigonometric interpolation of one value per tooth, at any angle.

    Tooth k stands at angle (k + ½)/Z, the middle of its engagement.
    """
    v = np.asarray(values, dtype=np.float64)
    z = len(v)
    coefficients = 2.0 * np.fft.rfft(v) / z
    # The mean, and with an even tooth number the term at half of it, count once.
    coefficients[0] /= 2.0
    if z % 2 == 0:
        coefficients[-1] /= 2.0
    # Horner's scheme in exp(2πjθ): two transcendental functions a sample instead of two for each term.
    turn = np.exp(2j * np.pi * (shaft_rev - 0.5 / z))
    total: FloatArray = np.polynomial.polynomial.polyval(turn, coefficients).real
    return total


# --------------------
# Vibration at low multiples of shaft speed: unbalance, misalignment, looseness.
# --------------------


@dataclass(frozen=True)
class ShaftOrder:
    """One shaft order.

    Parameters
    ----------
    shaft : str
    amplitude_mps2 : float
        Peak amplitude at `at_rpm`, or at every speed where that is None.
    order : float
        Cycles per revolution of `shaft`; 1 for unbalance.
    phase_rad : float
    at_rpm : float or None
        Speed of `shaft` at which the amplitude holds; elsewhere it goes with speed squared, as unbalance does.
    """

    shaft: str
    amplitude_mps2: float
    order: float = 1.0
    phase_rad: float = 0.0
    at_rpm: float | None = None


def shaft_vibration(part: ShaftOrder, shaft_rev: FloatArray, speed_rpm: FloatArray) -> FloatArray:
    """A (n/n₀)² cos(2π k θ + φ), (n_samples,) in m/s²."""
    growth = 1.0 if part.at_rpm is None else (speed_rpm / part.at_rpm) ** 2
    wave: FloatArray = part.amplitude_mps2 * growth * np.cos(2 * np.pi * part.order * shaft_rev + part.phase_rad)
    return wave


# --------------------
# A damaged tooth: an impact at each engagement and a local change of the mesh vibration.
# --------------------


@dataclass(frozen=True)
class ToothDamage:
    """One damaged tooth on one gear.

    Severity is in plain numbers: the first amplitude of the ring-down, and how far the mesh vibration dips while the
    tooth is engaged. A crack mostly dips (lower stiffness); a chip or a spall mostly impacts.

    Parameters
    ----------
    pair, shaft : str
        The gear.
    angle_rev : float
        Shaft angle at which the middle of the damaged tooth is engaged, 0 to 1. Teeth count from 1 at angle 0: this is
        tooth floor(angle_rev Z) + 1.
    impulse_mps2 : float
        Envelope of the ring-down at its start, before the transfer path.
    resonance_hz, damping_ratio : float
        The mode that rings.
    impulse_spread : float
        Standard deviation of the impacts over their mean; negative draws are set to 0.
    mesh_dip_fraction : float
        Part of the mesh amplitude that is missing at the middle of the engagement, 0 to 1.
    width_teeth : float
        Full width of the dip in tooth pitches; raised cosine.
    """

    pair: str
    shaft: str
    angle_rev: float
    impulse_mps2: float = 0.0
    resonance_hz: float = 3000.0
    damping_ratio: float = 0.05
    impulse_spread: float = 0.1
    mesh_dip_fraction: float = 0.0
    width_teeth: float = 2.0


def engagement_window(shaft_rev: FloatArray, angle_rev: float, width_rev: float) -> FloatArray:
    """Raised cosine of full width `width_rev` about `angle_rev`, once per revolution: 1 in the middle, 0 outside."""
    distance = (np.asarray(shaft_rev) - angle_rev + 0.5) % 1.0 - 0.5
    window: FloatArray = np.where(np.abs(distance) < width_rev / 2, np.cos(np.pi * distance / width_rev) ** 2, 0.0)
    return window


def passages(angle_rev: float, first_rev: float, last_rev: float) -> FloatArray:
    """Angles k + angle_rev of the shaft between `first_rev` and `last_rev`."""
    return np.arange(np.ceil(first_rev - angle_rev), np.floor(last_rev - angle_rev) + 1) + angle_rev


def impacts(n: int, mean: float, spread: float, rng: np.random.Generator) -> FloatArray:
    """Strengths of `n` impacts: Gaussian about `mean`, not below 0."""
    strengths: FloatArray = np.maximum(mean * (1 + spread * rng.standard_normal(n)), 0.0)
    return strengths


@dataclass(frozen=True)
class KinematicModel:
    """Parts of a signal; each may be left out.

    Parameters
    ----------
    speed : SpeedProfile
        Of the rig's reference shaft, or of its first shaft where the rig names none.
    meshes, modulations, tooth_variations, tooth_damages
        Per pair and gear, see their own classes.
    bearing_faults, shaft_orders
    channels : tuple of SensorChannel
        At least one; all see the same machine through their own path, with independent noise.
    tachometer : Tachometer or None
    """

    speed: SpeedProfile
    meshes: tuple[MeshHarmonics, ...] = ()
    modulations: tuple[MeshModulation, ...] = ()
    tooth_variations: tuple[ToothVariation, ...] = ()
    tooth_damages: tuple[ToothDamage, ...] = ()
    bearing_faults: tuple[BearingFault, ...] = ()
    shaft_orders: tuple[ShaftOrder, ...] = ()
    channels: tuple[SensorChannel, ...] = (SensorChannel(),)
    tachometer: Tachometer | None = None

    def shaft_revolutions(self, rig: Rig, shaft: str, time_s: FloatArray) -> FloatArray:
        """Return the exact angle of `shaft` in revolutions at `time_s` (0 at time 0); empty: the reference shaft."""
        return ratio_of(rig, shaft) * self.speed.revolutions(np.asarray(time_s, dtype=np.float64))

    def shaft_speed_rpm(self, rig: Rig, shaft: str, time_s: FloatArray) -> FloatArray:
        """Return the exact speed of `shaft` in rpm at `time_s`; empty: the reference shaft."""
        return ratio_of(rig, shaft) * self.speed.speed_rpm(np.asarray(time_s, dtype=np.float64))


def ratio_of(rig: Rig, shaft: str) -> float:
    """Revolutions of `shaft` per revolution of the reference shaft, which an empty name means."""
    return known_ratio(rig, shaft or rig.reference_shaft)
