# ruff: noqa: I001 - one import a room; the names of `gearsig`, read by type checkers and by `__init__.py` at run time
from . import (
    angle as angle,
    comparison as comparison,
    decompose as decompose,
    diagnosis as diagnosis,
    fleet as fleet,
    gap as gap,
    indicators as indicators,
    methods as methods,
    motion as motion,
    orders as orders,
    phase as phase,
    plot as plot,
    prepared as prepared,
    recording as recording,
    report as report,
    rig as rig,
    severity as severity,
    spectra as spectra,
    timefreq as timefreq,
)
from .angle import (
    AngleSignal as AngleSignal,
    ShaftAngle as ShaftAngle,
    find_shaft_angle as find_shaft_angle,
    resample_to_angle as resample_to_angle,
)
from .comparison import (
    Comparison as Comparison,
    compare as compare,
)
from .decompose import (
    denoise as denoise,
    suggest_modes as suggest_modes,
    vmd as vmd,
)
from .diagnosis import (
    Analysis as Analysis,
    AnalysisSettings as AnalysisSettings,
    CannotTell as CannotTell,
    Finding as Finding,
    analyze as analyze,
)
from .errors import (
    GearsigError as GearsigError,
    InputError as InputError,
    RefusalError as RefusalError,
)
from .fleet import open_fleet as open_fleet
from .gap import diagnose_gap as diagnose_gap
from .indicators import (
    gear_indicators as gear_indicators,
    time_indicators as time_indicators,
)
from .motion import (
    estimate_forces as estimate_forces,
    examine_start_stop as examine_start_stop,
    measure_motion as measure_motion,
)
from .orders import (
    order_map as order_map,
    order_spectrum as order_spectrum,
    synchronous_average as synchronous_average,
    track_orders as track_orders,
    track_vold_kalman as track_vold_kalman,
)
from .phase import (
    delay_embedding as delay_embedding,
    kind_of_motion as kind_of_motion,
    largest_lyapunov_exponent as largest_lyapunov_exponent,
    phase_plane as phase_plane,
    poincare_section as poincare_section,
    recurrence_plot as recurrence_plot,
)
from .prepared import PreparedRecording as PreparedRecording
from .recording import (
    Channel as Channel,
    Recording as Recording,
    read_recording as read_recording,
    write_recording as write_recording,
)
from .report import analysis_text as analysis_text
from .results import to_frame as to_frame
from .rig import (
    Bearing as Bearing,
    ConstantSpeed as ConstantSpeed,
    EncoderChannel as EncoderChannel,
    GearPair as GearPair,
    OperatingPoint as OperatingPoint,
    PulseTimes as PulseTimes,
    Rig as Rig,
    Sensor as Sensor,
    Shaft as Shaft,
    SpeedChannel as SpeedChannel,
    TachometerChannel as TachometerChannel,
    read_rig as read_rig,
)
from .severity import (
    CrackEstimate as CrackEstimate,
    NoCrackSeen as NoCrackSeen,
    estimate_crack as estimate_crack,
)
from .spectra import (
    Spectrum as Spectrum,
    amplitude_spectrum as amplitude_spectrum,
    cepstrum as cepstrum,
    envelope_spectrum as envelope_spectrum,
    kurtogram as kurtogram,
    power_density as power_density,
    spectral_coherence as spectral_coherence,
)
from .timefreq import (
    cwt as cwt,
    ridges as ridges,
    squeezed_cwt as squeezed_cwt,
    squeezed_stft as squeezed_stft,
    stft as stft,
)

__version__: str
