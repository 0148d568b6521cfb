"""The file formats, one module each; a further format is a module with a `FileFormat` and its line here."""

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
"""In the order in which users are told them; content is tried against them from the last: all text looks like CSV."""

__all__ = ["CSV", "FORMATS", "FileFormat"]
