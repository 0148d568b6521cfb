"""File formats, one module each; to add one, write a module with a `FileFormat` and list it here."""

from gearsig.recording.formats._csv import CSV
from gearsig.recording.formats._format import FileFormat
from gearsig.recording.formats._hdf5 import HDF5
from gearsig.recording.formats._mat import MAT
from gearsig.recording.formats._mf4 import MF4
from gearsig.recording.formats._parquet import PARQUET
from gearsig.recording.formats._tdms import TDMS
from gearsig.recording.formats._uff58 import UFF58
from gearsig.recording.formats._wav import WAV

FORMATS: tuple[FileFormat, ...] = (CSV, MAT, WAV, HDF5, PARQUET, TDMS, UFF58, MF4)
"""In the order shown to users; content is tested from the last to the first, because all text looks like CSV."""

__all__ = ["CSV", "FORMATS", "FileFormat"]
