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

import lazy_loader

# `__init__.pyi` is the one table of names, for type checkers and at run time: a room is loaded when a name of it is
# first used, so that `import gearsig` stays light.
__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
