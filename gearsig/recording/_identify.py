"""Which format a file has: by its extension and by its first bytes, which must agree."""

from __future__ import annotations

import re
import stat
from pathlib import Path

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError

FORMAT_OF_EXTENSION = {
    ".csv": "CSV text",
    ".txt": "CSV text",
    ".tsv": "CSV text",
    ".dat": "CSV text",
    ".asc": "CSV text",
    ".mat": "MAT",
    ".wav": "WAV",
    ".wave": "WAV",
    ".h5": "HDF5",
    ".hdf5": "HDF5",
    ".hdf": "HDF5",
    ".parquet": "Parquet",
    ".pq": "Parquet",
    ".tdms": "TDMS",
    ".uff": "UFF58",
    ".unv": "UFF58",
    ".uf": "UFF58",
    ".u58": "UFF58",
}
"""What the extension promises."""

ALLOWED_EXTENSIONS = " ".join(FORMAT_OF_EXTENSION) + ", text also with .gz"

HEAD_BYTES = 4096

_MAGIC = (
    (b"\x89HDF\r\n\x1a\n", "HDF5"),
    (b"\x1f\x8b", "gzip"),
    (b"PAR1", "Parquet"),
    (b"TDSm", "TDMS"),
    (b"TDSh", "a TDMS index without its data"),
    (b"\x93NUMPY", "a NumPy array file"),
    (b"PK\x03\x04", "a ZIP archive (XLSX, NPZ, …)"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"fLaC", "FLAC audio"),
    (b"OggS", "Ogg audio"),
    (b"\x7fELF", "a program"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
)
_MAT_VERSIONS = {
    b"\x00\x01IM": "MAT v5",
    b"\x01\x00MI": "MAT v5",
    b"\x00\x02IM": "MAT v7.3",
    b"\x02\x00MI": "MAT v7.3",
}
_PICKLE_STARTS = (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
# Pickle protocols 0 and 1 are text: an opening mark, or a global "cmodule\nname\n".
_TEXT_PICKLE = re.compile(rb"\A(?:\((?:dp|lp|[dl]|i)\d*\n|c[\w.]+\n[\w.]+\n|[\])}]q|\(c[\w.]+\n[\w.]+\n)")
_MARKUP = re.compile(rb"\A\s*<(?:!doctype|html|\?xml|svg|script)", re.IGNORECASE)
_UFF = re.compile(rb"\A\s*-1[ \t]*\r?\n\s{0,5}\d{1,5}[b ]?")


def identify(path: Path) -> str:
    """Return the format of a regular file after checking that content and extension agree.

    Returns
    -------
    str
        "CSV text", "MAT v5", "MAT v7.3", "WAV", "HDF5", "Parquet", "TDMS" or "UFF58".

    Raises
    ------
    InputError
        If there is no such file, it is empty or no regular file, its extension is unknown, or its content is of
        another kind than the extension says.
    """
    _check_regular(path)
    promised = _promised(path)
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    found = content_kind(head)
    accepted = {"MAT": ("MAT v5", "MAT v7.3"), "CSV text": ("CSV text", "gzip"), "UFF58": ("UFF58",)}
    if found in accepted.get(promised, (promised,)):
        return promised if found == "gzip" else found
    hint = "the file was not written completely: copy or export it again"
    if "zero bytes" not in found:
        hint = "rename it if only the extension is wrong, or export it again"
    if found == "a Python pickle":
        hint = "pickles can run code and are never opened; export the data as CSV, MAT or HDF5"
    raise InputError(
        f"the extension says {promised}, but the content is {found}",
        where=path.name,
        allowed=f"content that fits {path.suffix or 'the extension'}",
        remedy=hint,
    )


def content_kind(head: bytes) -> str:
    """Name the kind of content from a file's first bytes, never by trying to open it."""
    if not head.strip(b"\0"):
        return "zero bytes"
    if head[:2] in _PICKLE_STARTS or _TEXT_PICKLE.match(head):
        return "a Python pickle"
    if head[:4] in (b"RIFF", b"RIFX", b"RF64"):
        return "WAV" if head[8:12] == b"WAVE" else "RIFF but not WAVE"
    if head[124:128] in _MAT_VERSIONS:
        return _MAT_VERSIONS[head[124:128]]
    known = [kind for magic, kind in _MAGIC if head.startswith(magic)]
    return known[0] if known else _text_kind(head)


def _text_kind(head: bytes) -> str:
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "CSV text"
    if _MARKUP.match(head):
        return "HTML or XML"
    if _UFF.match(head):
        return "UFF58"
    if b"\0" in head and b"\0" not in head.rstrip(b"\0"):
        return "text followed by zero bytes"
    if b"\0" in head or sum(c < 9 or 13 < c < 32 for c in head) > 0.01 * len(head):
        return "binary data of an unknown kind"
    return "CSV text"


def _check_regular(path: Path) -> None:
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        hint = ""
        if path.parent.is_dir() and path.name:
            hint = closest_match_hint(path.name, (other.name for other in path.parent.iterdir()))
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"cannot be opened ({reason})", where=path.name or str(path), allowed="a readable file", remedy=hint
        ) from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
        raise InputError(f"is {kind}", where=path.name or str(path), allowed="one file", remedy="name the file itself")
    if status.st_size == 0:
        raise InputError("is empty", where=path.name, allowed="a file with data", remedy="copy or export it again")


def _promised(path: Path) -> str:
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes[-1:] == [".gz"]:
        if len(suffixes) > 1 and FORMAT_OF_EXTENSION.get(suffixes[-2]) == "CSV text":
            return "CSV text"
        raise InputError(
            "only text files are read compressed",
            where=path.name,
            allowed=ALLOWED_EXTENSIONS,
            remedy="unpack it with gunzip",
        )
    promised = FORMAT_OF_EXTENSION.get(suffixes[-1] if suffixes else "")
    if promised is None:
        with path.open("rb") as file:
            found = content_kind(file.read(HEAD_BYTES))
        raise InputError(
            f"extension {path.suffix or '(none)'!r} is not known; the content looks like {found}",
            where=path.name,
            allowed=ALLOWED_EXTENSIONS,
            remedy="rename or convert the file",
        )
    return promised
