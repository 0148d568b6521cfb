"""Read and write MATLAB's MAT files: version 5 (saved with -v6 or -v7) is read and written, version 7.3 only read."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._limits import CHUNK_BYTES, check_decoded
from gearsig.recording._table import NamedArrays, NumberArray, RawTable, refuse_spectrum, table_from_arrays
from gearsig.recording._types import Recording
from gearsig.recording.formats._format import OWN_NAME, FileFormat, metadata_json, table_from_metadata
from gearsig.recording.formats._hdf5 import decoded_bytes, load_dataset, own_datasets

# --------------------
# The arrays, structs, cells and texts in the elements of a MAT v5 file.
#
# This is decoded here because the C code behind `scipy.io.loadmat` (scipy 1.17) trusts the codes in the file: one
# damaged byte can end the whole program with a segmentation fault, and with it a run over many files. Source of the
# layout: MathWorks, MAT-File Format, "Level 5 MAT-File Format".
# --------------------


MATRIX = 14
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types in which numbers are stored; a variable may be stored in a smaller type than its class."""
TEXT = {1: "latin-1", 2: "latin-1", 3: "utf-16", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
NUMERIC = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
COMPLEX = 0x0800
MAX_DEPTH = 32

Part = tuple[int, memoryview]


class Unreadable:
    """Placeholder for a value that holds no signal: a sparse array, a function or an object of a class."""


def decode_variable(body: memoryview, order: str) -> tuple[str, Any]:
    """Return name and value of one variable.

    Parameters
    ----------
    body : memoryview
        The content of a matrix element, without its tag.
    order : str
        "<" or ">".

    Returns
    -------
    tuple
        The value is an array, a text, a dict (struct), a list (cell, array of structs) or `Unreadable`.

    Raises
    ------
    InputError
        If codes or lengths violate the format; the caller adds file and place.
    """
    return _matrix(body, order, MAX_DEPTH)


def tags(body: memoryview, order: str) -> Iterator[Part]:
    """Yield the type and content of consecutive elements."""
    at = 0
    while at < len(body):
        if at + 8 > len(body):
            raise _damage("an element is cut off")
        code, size = struct.unpack_from(order + "II", body, at)
        if code >> 16:  # small element: length and type in one word, content in the next
            code, size, start, step = code & 0xFFFF, code >> 16, at + 4, 8
        else:
            start, step = at + 8, 8 + size + (-size % 8 if code != MATRIX else 0)
        if code not in STORED and code not in TEXT and code != MATRIX:
            raise _damage(f"an element is of the unknown type {code}")
        if start + size > len(body) or (start == at + 4 and size > 4):
            raise _damage("an element is longer than the one that contains it")
        yield code, body[start : start + size]
        at += step


def _matrix(body: memoryview, order: str, depth: int) -> tuple[str, Any]:
    if len(body) == 0:
        return "", np.empty((0, 0))
    if depth == 0:
        raise _damage(f"arrays are nested more than {MAX_DEPTH} deep")
    parts = list(tags(body, order))
    if len(parts) < 3 or len(parts[0][1]) != 8:
        raise _damage("an array has no description")
    flags = struct.unpack_from(order + "I", parts[0][1])[0]
    kind = flags & 0xFF
    if kind in (SPARSE, FUNCTION, OPAQUE):
        return bytes(parts[1 if kind == OPAQUE else 2][1]).decode("latin-1"), Unreadable()
    shape = tuple(int(n) for n in _numbers(parts[1], order))
    if len(shape) < 2 or min(shape) < 0 or prod(shape) > len(body):
        raise _damage(f"an array of shape {shape} is stored in {len(body)} bytes")
    name = bytes(parts[2][1]).decode("latin-1")
    rest = parts[3:]
    if kind in NUMERIC:
        return name, _array(rest, shape, NUMERIC[kind], bool(flags & COMPLEX), order)
    if kind == CHAR:
        return name, _text(rest, order) if prod(shape) else ""
    if kind == CELL:
        return name, [_matrix(part, order, depth - 1)[1] for part in _matrices(rest, prod(shape))]
    if kind in (STRUCT, OBJECT):
        return name, _struct(rest if kind == STRUCT else rest[1:], prod(shape), order, depth)
    raise _damage(f"an array is of the unknown class {kind}")


def _numbers(part: Part, order: str) -> NumberArray:
    code, content = part
    if code not in STORED or len(content) % np.dtype(STORED[code]).itemsize:
        raise _damage(f"numbers are stored as type {code} in {len(content)} bytes")
    return np.frombuffer(content, order + STORED[code])


def _array(parts: Sequence[Part], shape: tuple[int, ...], dtype: str, is_complex: bool, order: str) -> NumberArray:
    values = [_numbers(part, order) for part in parts]
    if len(values) != 1 + is_complex or any(len(v) != prod(shape) for v in values):
        raise _damage(f"an array of shape {shape} holds {[len(v) for v in values]} numbers")
    with np.errstate(invalid="ignore"):  # a NaN in single precision may be a signalling one
        real = values[0].astype(dtype)
    whole: NumberArray = real + 1j * values[1] if is_complex else real
    return whole.reshape(shape, order="F")


def _text(parts: Sequence[Part], order: str) -> str:
    if len(parts) != 1 or parts[0][0] not in TEXT:
        raise _damage("a text is stored as something else")
    code, content = parts[0]
    suffix = ("-le" if order == "<" else "-be") if code in (3, 4, 17, 18) else ""
    return bytes(content).decode(TEXT[code] + suffix, errors="replace").strip("\0 ")


def _struct(parts: Sequence[Part], n_elements: int, order: str, depth: int) -> Any:
    """Return a dict for a single struct, a list of dicts for a struct array."""
    if len(parts) < 2:
        raise _damage("a struct has no field names")
    lengths, text = _numbers(parts[0], order), bytes(parts[1][1])
    length = int(lengths[0]) if len(lengths) == 1 else 0
    if length < 1 or len(text) % length:
        raise _damage("the field names of a struct are damaged")
    names = [text[i : i + length].split(b"\0")[0].decode("latin-1") for i in range(0, len(text), length)]
    contents = _matrices(parts[2:], n_elements * len(names))
    values = [_matrix(part, order, depth - 1)[1] for part in contents]
    structs = [dict(zip(names, values[i * len(names) :], strict=False)) for i in range(n_elements)]
    return structs[0] if len(structs) == 1 else structs


def _matrices(parts: Sequence[Part], n: int) -> list[memoryview]:
    if len(parts) != n or any(code != MATRIX for code, _ in parts):
        raise _damage(f"{n} arrays are stated, {len(parts)} are there")
    return [part for _, part in parts]


def _damage(what: str) -> InputError:
    return InputError(what)


# --------------------
# The variables of a MAT v5 file, one after another, unpacked.
# --------------------


HEADER_BYTES = 128
COMPRESSED = 15


def variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each variable, as `decode_variable` returns them.

    Raises
    ------
    InputError
        If the file is truncated, damaged or does not fit into memory; the error names the byte where the variable
        begins.
    """
    n_bytes = path.stat().st_size
    total = 0
    with path.open("rb") as file:
        order = ">" if file.read(HEADER_BYTES)[126:128] == b"MI" else "<"
        at = HEADER_BYTES
        while at < n_bytes:
            file.seek(at)
            tag = file.read(8)
            if not tag.strip(b"\0"):
                _fail(path.name, at, "zero bytes where a variable should begin")
            if len(tag) < 8:
                _fail(path.name, at, "the last variable is cut off")
            kind, size = struct.unpack(order + "II", tag)
            if at + 8 + size > n_bytes:
                _fail(path.name, at, f"a variable of {size} bytes is cut off")
            check_decoded(total + size, path)
            body = tag + file.read(size)
            if kind == COMPRESSED:
                body = _unpacked(body[8:], path, at, total)
            total += len(body)
            yield _decoded(memoryview(body), order, path.name, at)
            at += 8 + size
    if total == 0:
        _fail(path.name, HEADER_BYTES, "there is no variable after the header")


def _decoded(body: memoryview, order: str, where: str, at: int) -> tuple[str, Any]:
    try:
        elements = list(tags(body, order))
        if len(elements) != 1 or elements[0][0] != MATRIX:
            _fail(where, at, "no variable begins where one should")
        return decode_variable(elements[0][1], order)
    except InputError as error:
        if error.where:
            raise
        _fail(where, at, error.what)


def _unpacked(packed: bytes, path: Path, at: int, before: int) -> bytes:
    """Decompress in chunks, so that a decompression bomb is noticed early."""
    stream = zlib.decompressobj()
    chunks: list[bytes] = []
    size = 0
    try:
        while packed and not stream.eof:
            chunks.append(stream.decompress(packed, CHUNK_BYTES))
            packed = stream.unconsumed_tail
            size += len(chunks[-1])
            check_decoded(before + size, path)
    except zlib.error as error:
        _fail(path.name, at, f"a compressed variable is damaged ({error})")
    if not stream.eof:
        _fail(path.name, at, "a compressed variable is cut off")
    return b"".join(chunks)


def _fail(where: str, at: int, what: str) -> NoReturn:
    raise InputError(
        f"{what} (byte {at})",
        where=where,
        allowed="a complete MAT file",
        remedy="the file was damaged or not written completely: save it again",
    )


READER = "gearsig MAT v5 reader"


def read_mat5(path: Path) -> RawTable:
    """Return the signals of a MAT file.

    Variables and fields of structs become channels if they are vectors or matrices; single numbers named like a
    sampling rate (fs, sr, SampFreq, dt, …) give the rate. Of a variable that occurs twice, the copy that is not all
    zeros is used.

    Raises
    ------
    InputError
        If the file is damaged, holds only objects or text, or does not fit into memory.
    """
    where = path.name
    values, notes = _load(path)
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    unreadable: list[str] = []
    for name, value in values.items():
        _flatten(name, value, arrays, texts, unreadable)
    if OWN_NAME in texts and "samples" in arrays:
        return table_from_metadata(texts[OWN_NAME], list(arrays["samples"].T), READER, where)
    if unreadable:
        notes.append(f"sparse arrays, functions or objects were left out: {', '.join(unreadable[:8])}")
    return table_from_arrays(NamedArrays(arrays, texts, warnings=tuple(notes)), READER, where)


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the variables by name, of copies the last that is not blank, and warnings."""
    chosen: dict[str, Any] = {}
    doubled: dict[str, None] = {}
    differ: dict[str, None] = {}
    for name, value in variables(path):
        if name in chosen:
            doubled[name] = None
            if _is_blank(value):
                continue
            if not _is_blank(chosen[name]) and not _equal(value, chosen[name]):
                differ[name] = None
        chosen[name] = value
    notes = []
    if doubled:
        names = ", ".join(doubled)
        notes.append(f"variables occur more than once in the file; the copy that is not all zeros was used: {names}")
    if differ:
        notes.append(f"the copies of {', '.join(differ)} differ: the last was used")
    return chosen, notes


def _is_blank(value: Any) -> bool:
    """Whether an array is empty or all zeros; a struct or cell is blank if all its contents are."""
    if isinstance(value, dict):
        return all(_is_blank(item) for item in value.values())
    if isinstance(value, list):
        return all(_is_blank(item) for item in value)
    return not isinstance(value, np.ndarray) or not value.any()


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return bool(np.array_equal(a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_equal(a[name], b[name]) for name in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_equal, a, b))
    return type(a) is type(b) and (isinstance(a, Unreadable) or bool(a == b))


def _flatten(
    path: str, value: Any, arrays: dict[str, NumberArray], texts: dict[str, str], unreadable: list[str]
) -> None:
    """Collect numbers and texts from nested structs and cells under their paths."""
    if isinstance(value, dict) and isinstance(axis := value.get("x_values"), dict):
        value = _function(value, axis)
    if isinstance(value, dict):
        name = next((text for key in ("Name", "Label") if isinstance(text := value.get(key), str)), "")
        data = next((key for key in ("Data", "Values", "Value") if _is_signal(value.get(key))), None)
        if name and data is not None:  # an element of a list of channels, which states its name
            value = {**value, name.replace(".", "_"): value[data], "unit": value.get("Unit", value.get("Units", ""))}
            del value[data]
        for name, item in value.items():
            _flatten(f"{path}.{name}", item, arrays, texts, unreadable)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _flatten(path if len(value) == 1 else f"{path}({i + 1})", item, arrays, texts, unreadable)
    elif isinstance(value, str):
        texts[path] = value
    elif isinstance(value, Unreadable):
        unreadable.append(path or "an object")
    elif value.size and value.ndim <= 2:
        arrays[path] = value


def _is_signal(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size > 1


def _function(value: dict[str, Any], axis: dict[str, Any]) -> dict[str, Any]:
    """Return the signals, their unit and the step of a function over an axis, as Simcenter Testlab exports it.

    Raises
    ------
    InputError
        If the axis is frequency or order.
    """

    def label(of: Any) -> str:
        quantity = of.get("quantity") if isinstance(of, dict) else None
        text = quantity.get("label") if isinstance(quantity, dict) else ""
        return text if isinstance(text, str) else ""

    refuse_spectrum([f"x unit: {label(axis)}"])
    ordinate, record = value.get("y_values"), value.get("function_record")
    values = ordinate.get("values") if isinstance(ordinate, dict) else None
    names = record.get("name") if isinstance(record, dict) else None
    names = [names] if isinstance(names, str) else names
    signals: dict[str, Any] = {"values": values}
    if isinstance(values, np.ndarray) and isinstance(names, list) and all(isinstance(n, str) for n in names):
        over_time = values if values.ndim == 2 and values.shape[1] == len(names) else values.T
        if over_time.ndim == 2 and over_time.shape[1] == len(names) == len(set(names)):
            signals = {name.replace(".", "_"): over_time[:, i] for i, name in enumerate(names)}
    return {**signals, "dt": axis.get("increment", ""), "unit": label(ordinate)}


# --------------------
# MATLAB's MAT files of version 7.3, which are HDF5 files with MATLAB's conventions.
# --------------------


MAT73_READER = "gearsig MAT v7.3 reader"
MAX_TEXT = 10_000


def read_mat73(path: Path) -> RawTable:
    """Return the signals of a MAT v7.3 file; names are treated as in MAT v5.

    Structs are followed, cells and struct arrays are not: MATLAB keeps those behind references.

    Raises
    ------
    InputError
        If the file is damaged, holds no plain arrays, or does not fit into memory.
    """
    import h5py

    where = path.name
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    skipped: list[str] = []
    with h5py.File(path, "r", locking=False) as file:
        datasets = own_datasets(file, skipped)
        check_decoded(sum(decoded_bytes(dataset) for _, dataset in datasets if dataset.dtype.kind in "fiub"), path)
        for name, dataset in datasets:
            if dataset.size == 0 or dataset.ndim > 2 or "MATLAB_empty" in dataset.attrs:
                continue
            if _matlab_class(dataset) == "char":
                texts[name] = _text73(dataset)
            elif dataset.dtype.kind in "fiub":
                # MATLAB stores by columns, HDF5 by rows: every matrix arrives transposed.
                arrays[name] = np.atleast_2d(load_dataset(dataset, where)).T
            else:
                skipped.append(name)
    notes = (f"left out (cells, objects, complex numbers or links): {', '.join(skipped[:8])}",) if skipped else ()
    return table_from_arrays(NamedArrays(arrays, texts, warnings=notes), MAT73_READER, where)


def _matlab_class(dataset: Any) -> str:
    # A text of variable length may be damaged in ways that crash the library; MATLAB writes none.
    is_fixed = "MATLAB_class" in dataset.attrs and dataset.attrs.get_id("MATLAB_class").dtype.kind == "S"
    value = dataset.attrs["MATLAB_class"] if is_fixed else b""
    return value.decode("ascii", errors="replace") if isinstance(value, bytes) else str(value)


def _text73(dataset: Any) -> str:
    """Return the text of a char array, which MATLAB stores as UTF-16 code units."""
    if dataset.size > MAX_TEXT or dataset.dtype.kind != "u":
        return ""
    units = np.asarray(dataset[()]).reshape(-1).astype("<u2")
    return units.tobytes().decode("utf-16-le", errors="replace").strip()


def write_mat(recording: Recording, path: Path) -> None:
    """Write the variables samples (time, channel), fs, channel_names and gearsig_recording (JSON)."""
    from scipy.io import savemat

    if recording.samples.nbytes >= 2**31:
        raise InputError(
            f"{recording.samples.nbytes / 1e9:.3g} GB do not fit", where="MAT", allowed="below 2 GB", remedy="write .h5"
        )
    contents = {
        "samples": recording.samples.T,
        "fs": float(recording.sampling_rate_hz),
        "channel_names": np.array([c.name for c in recording.channels], dtype=object),
        OWN_NAME: metadata_json(recording),
    }
    savemat(path, contents)


_VERSIONS = {b"\x00\x01IM": "MAT v5", b"\x01\x00MI": "MAT v5", b"\x00\x02IM": "MAT v7.3", b"\x02\x00MI": "MAT v7.3"}


def _sniff(head: bytes) -> str:
    return _VERSIONS.get(head[124:HEADER_BYTES], "")


def read_mat(path: Path) -> RawTable:
    """Read a MAT file of either version."""
    with path.open("rb") as file:
        version = _sniff(file.read(HEADER_BYTES))
    return read_mat5(path) if version == "MAT v5" else read_mat73(path)


MAT = FileFormat("MAT", (".mat",), _sniff, read_mat, write_mat, (".mat",))
