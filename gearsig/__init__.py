"""gearsig: signal processing and diagnostics for gear vibration, simulated and measured.

The main job in three lines:

>>> import gearsig
>>> result = gearsig.analyze(gearsig.read_recording("gearbox.csv", rig=gearsig.read_rig("rig.toml")))  # doctest: +SKIP
>>> print(gearsig.analysis_text(result))  # doctest: +SKIP

Single methods take a recording and a channel's name, or a plain array and its sampling rate:

>>> recording = gearsig.read_recording("gearbox.csv")  # doctest: +SKIP
>>> gearsig.order_spectrum(recording, "a1"), gearsig.envelope_spectrum(recording, "a1")  # doctest: +SKIP
>>> import numpy as np
>>> tone = np.sin(2 * np.pi * 50.0 * np.arange(1000) / 1000.0)
>>> round(float(gearsig.amplitude_spectrum(tone, 1000.0).values[50]), 9)
1.0

Everything else is imported from its room, e.g. `from gearsig.orders import separate_shafts`.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

# The one table of names: type checkers follow it (`x as x` exports x), and `__getattr__` below reads it, so that a room
# is loaded when a name of it is first used and `import gearsig` stays light.
if TYPE_CHECKING:
    from gearsig.angle import AngleSignal as AngleSignal
    from gearsig.angle import ShaftAngle as ShaftAngle
    from gearsig.angle import find_shaft_angle as find_shaft_angle
    from gearsig.angle import resample_to_angle as resample_to_angle
    from gearsig.comparison import Comparison as Comparison
    from gearsig.comparison import compare as compare
    from gearsig.decompose import denoise as denoise
    from gearsig.decompose import suggest_modes as suggest_modes
    from gearsig.decompose import vmd as vmd
    from gearsig.diagnosis import Analysis as Analysis
    from gearsig.diagnosis import AnalysisSettings as AnalysisSettings
    from gearsig.diagnosis import CannotTell as CannotTell
    from gearsig.diagnosis import Finding as Finding
    from gearsig.diagnosis import analyze as analyze
    from gearsig.errors import GearsigError as GearsigError
    from gearsig.errors import InputError as InputError
    from gearsig.errors import RefusalError as RefusalError
    from gearsig.gap import diagnose_gap as diagnose_gap
    from gearsig.indicators import gear_indicators as gear_indicators
    from gearsig.indicators import time_indicators as time_indicators
    from gearsig.motion import estimate_forces as estimate_forces
    from gearsig.motion import examine_start_stop as examine_start_stop
    from gearsig.motion import measure_motion as measure_motion
    from gearsig.orders import order_map as order_map
    from gearsig.orders import order_spectrum as order_spectrum
    from gearsig.orders import synchronous_average as synchronous_average
    from gearsig.orders import track_orders as track_orders
    from gearsig.orders import track_vold_kalman as track_vold_kalman
    from gearsig.phase import delay_embedding as delay_embedding
    from gearsig.phase import kind_of_motion as kind_of_motion
    from gearsig.phase import largest_lyapunov_exponent as largest_lyapunov_exponent
    from gearsig.phase import phase_plane as phase_plane
    from gearsig.phase import poincare_section as poincare_section
    from gearsig.phase import recurrence_plot as recurrence_plot
    from gearsig.prepared import PreparedRecording as PreparedRecording
    from gearsig.recording import Channel as Channel
    from gearsig.recording import Recording as Recording
    from gearsig.recording import read_recording as read_recording
    from gearsig.recording import write_recording as write_recording
    from gearsig.report import analysis_text as analysis_text
    from gearsig.rig import Bearing as Bearing
    from gearsig.rig import ConstantSpeed as ConstantSpeed
    from gearsig.rig import EncoderChannel as EncoderChannel
    from gearsig.rig import GearPair as GearPair
    from gearsig.rig import OperatingPoint as OperatingPoint
    from gearsig.rig import PulseTimes as PulseTimes
    from gearsig.rig import Rig as Rig
    from gearsig.rig import Sensor as Sensor
    from gearsig.rig import Shaft as Shaft
    from gearsig.rig import SpeedChannel as SpeedChannel
    from gearsig.rig import TachometerChannel as TachometerChannel
    from gearsig.rig import read_rig as read_rig
    from gearsig.severity import CrackEstimate as CrackEstimate
    from gearsig.severity import NoCrackSeen as NoCrackSeen
    from gearsig.severity import estimate_crack as estimate_crack
    from gearsig.spectra import Spectrum as Spectrum
    from gearsig.spectra import amplitude_spectrum as amplitude_spectrum
    from gearsig.spectra import cepstrum as cepstrum
    from gearsig.spectra import envelope_spectrum as envelope_spectrum
    from gearsig.spectra import kurtogram as kurtogram
    from gearsig.spectra import power_density as power_density
    from gearsig.spectra import spectral_coherence as spectral_coherence
    from gearsig.timefreq import cwt as cwt
    from gearsig.timefreq import ridges as ridges
    from gearsig.timefreq import squeezed_cwt as squeezed_cwt
    from gearsig.timefreq import squeezed_stft as squeezed_stft
    from gearsig.timefreq import stft as stft

__version__ = "0.1.0"


def _rooms() -> dict[str, str]:
    """Return the room of each public name, as the table above says."""
    table = next(node for node in ast.parse(Path(__file__).read_text("utf-8")).body if isinstance(node, ast.If))
    return {name.name: str(node.module) for node in table.body for name in node.names}  # type: ignore[attr-defined]


_ROOMS = _rooms()

__all__ = sorted(_ROOMS)  # noqa: PLE0605 - a list of names


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module 'gearsig' has no attribute {name!r}")
    return getattr(import_module(_ROOMS[name]), name)


def __dir__() -> list[str]:
    return sorted([*_ROOMS, "__version__"])
