"""The arrays, structs, cells and texts in the elements of a MAT v5 file.

This is decoded here because the C code behind `scipy.io.loadmat` (scipy 1.17) trusts the codes in the file: one damaged
byte can end the whole program with a segmentation fault, and with it a run over many files. Source of the layout:
MathWorks, MAT-File Format, "Level 5 MAT-File Format".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from math import prod
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.raw_table import NumberArray

MATRIX = 14
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types that numbers are stored in; a variable of another class may be stored in a smaller one."""
TEXT = {1: "latin-1", 2: "latin-1", 3: "utf-16", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
NUMERIC = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
COMPLEX = 0x0800
MAX_DEPTH = 32

Part = tuple[int, memoryview]


class Unreadable:
    """Stands for a value that holds no signal here: a sparse array, a function, an object of a class."""


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
        If codes or lengths are not as the format says; the caller adds file and place.
    """
    return _matrix(body, order, MAX_DEPTH)


def tags(body: memoryview, order: str) -> Iterator[Part]:
    """Yield type and content of the elements that follow one another."""
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
            raise _damage("an element is longer than what holds it")
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
    """Return a dict for a single struct, a list of dicts for an array of them."""
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
