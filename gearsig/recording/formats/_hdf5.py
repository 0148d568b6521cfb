"""HDF5 files, gearsig's own and others."""

from __future__ import annotations

import re
import struct
from concurrent.futures.process import BrokenProcessPool
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.processes import call_apart
from gearsig.recording._limits import FREE_BYTES, check_decoded
from gearsig.recording._table import NamedArrays, NumberArray, RawTable, table_from_arrays
from gearsig.recording._types import Recording, stated_rate_hz
from gearsig.recording.formats._format import OWN_NAME, FileFormat, begins, metadata_json, table_from_metadata

READER = "gearsig HDF5 reader"
OWN_SAMPLES = "samples"
MAX_DEPTH = 8
MAX_DATASETS = 10_000
UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units", "unit_string")


def read_hdf5(path: Path, part: slice | None = None) -> RawTable:
    """Return the signals of an HDF5 file.

    One- and two-dimensional datasets of numbers become channels; single numbers and attributes named like a sampling
    rate give the rate; an attribute "unit" or "units" of a dataset gives its unit. Only the file itself is read:
    external links, external storage and virtual datasets, which could name any file, are not followed.

    Parameters
    ----------
    path : Path
    part : slice or None
        Samples of each signal, along its longer side.

    Raises
    ------
    InputError
        If the file is damaged or does not fit into memory.
    """
    import h5py

    where = path.name
    with h5py.File(path, "r", locking=False) as file:
        arrays: dict[str, NumberArray] = {}
        rates_hz = _rates_of(file.attrs, "")
        skipped: list[str] = []
        datasets = own_datasets(file, skipped)
        by_path = dict(datasets)
        is_own = OWN_NAME in by_path and OWN_SAMPLES in by_path and by_path[OWN_NAME].shape == ()
        datasets = [(p, d) for p, d in datasets if d.dtype.kind in "fiubc" and d.ndim <= 2 and d.size]
        read = [d for p, d in datasets if not is_own or p == OWN_SAMPLES]
        chunk_bytes = max((prod(d.chunks or (0,)) * d.dtype.itemsize for d in read), default=0)
        check_decoded(sum(map(decoded_bytes, read)), path, at_once_bytes=None if part is None else chunk_bytes)
        if is_own:
            samples = load_dataset(by_path[OWN_SAMPLES], where, part)
            return table_from_metadata(_own_text(by_path[OWN_NAME], path), list(np.atleast_2d(samples)), READER, where)
        for dataset_path, dataset in datasets:
            arrays[dataset_path] = np.atleast_1d(load_dataset(dataset, where, part))
            rates_hz |= _rates_of(dataset.attrs, dataset_path)
        units = _units_of(path, datasets)
    notes = [f"links that were not followed: {', '.join(skipped[:8])}"] if skipped else []
    return table_from_arrays(NamedArrays(arrays, {}, units, rates_hz, tuple(notes)), READER, where)


def _own_text(dataset: Any, path: Path) -> str:
    """Return the single text of a dataset, decoded from the file's heap without the library.

    The library allocates as much memory as a damaged reference says, and loops for ever in a damaged heap. A reference
    consists of length (4 bytes), address of the collection (8) and number of the object (4). A collection begins with
    "GCOL", version and size, 16 bytes in all; each object with number, count, 4 unused bytes and size, 16 bytes in all,
    and is padded to a multiple of 8. Source: The HDF Group, *HDF5 File Format Specification*, version 3.0, III.E.
    """
    at, n_bytes = dataset.id.get_offset(), path.stat().st_size
    with path.open("rb") as file:
        file.seek(at or 0)
        length, place, index = struct.unpack("<IQI", file.read(16))
        file.seek(min(place, n_bytes))
        mark, size = struct.unpack("<4s4xQ", file.read(16))
        heap = file.read(min(size, n_bytes)) if mark == b"GCOL" else b""
    place = 0
    while at is not None and place + 16 <= len(heap):
        number, size = struct.unpack_from("<H6xQ", heap, place)
        if number == index and length <= size <= len(heap) - place - 16:
            return heap[place + 16 : place + 16 + length].decode("utf-8", "replace")
        place += 16 + size + -size % 8
    raise InputError(
        f"dataset {dataset.name!r} is damaged", where=path.name, allowed="a text", remedy="write the file again"
    )


def own_datasets(group: Any, skipped: list[str], prefix: str = "", depth: int = MAX_DEPTH) -> list[tuple[str, Any]]:
    """Return the datasets under a group that the file itself holds, by path with dots."""
    import h5py

    datasets: list[tuple[str, Any]] = []
    for name in group:
        path = f"{prefix}{name}"
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            skipped.append(path)
            continue
        item = group[name]
        if isinstance(item, h5py.Group) and depth > 1 and not name.startswith("#"):  # "#refs#" is MATLAB's own store
            datasets += own_datasets(item, skipped, f"{path}.", depth - 1)
        elif isinstance(item, h5py.Dataset):
            if item.is_virtual or item.external:
                skipped.append(path)
            else:
                datasets.append((path, item))
        if len(datasets) > MAX_DATASETS:
            raise InputError(
                f"holds more than {MAX_DATASETS} datasets", allowed="one recording", remedy="split the file"
            )
    return datasets


def decoded_bytes(dataset: Any) -> int:
    """Return the bytes that reading a dataset takes; chunks are unpacked whole, even if the dataset is smaller."""
    return int(max(dataset.size, prod(dataset.chunks or (0,))) * dataset.dtype.itemsize)


def load_dataset(dataset: Any, where: str, part: slice | None = None) -> NumberArray:
    """Return a dataset's values after checking that they were written."""
    if dataset.size > 1 and dataset.id.get_storage_size() == 0:
        raise InputError(
            f"dataset {dataset.name!r} was allocated but never written",
            where=where,
            allowed="datasets with data",
            remedy="the file was not written completely: export it again",
        )
    chosen: Any = ()
    if part is not None and dataset.size > 1:
        longer = int(np.argmax(dataset.shape))
        chosen = tuple(part if axis == longer else slice(None) for axis in range(dataset.ndim))
    values: NumberArray = np.asarray(dataset[chosen])
    return values


def hdf5_length(path: Path) -> int:
    """Return the number of samples of the longest signal."""
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        signals = (d for _, d in own_datasets(file, []) if d.dtype.kind in "fiub" and 1 <= d.ndim <= 2)
        return max((max(d.shape) for d in signals), default=0)


def _rates_of(attributes: Any, path: str) -> dict[str, float]:
    rates: dict[str, float] = {}
    numbers = (name for name in attributes if attributes.get_id(name).dtype.kind in "fiu")
    for name, value in ((name, attributes[name]) for name in numbers):
        if np.size(value) != 1:
            continue
        if (rate_hz := stated_rate_hz(name, float(np.reshape(value, -1)[0]))) is not None:
            rates[path] = rate_hz
    return rates


def _units_of(path: Path, datasets: list[tuple[str, Any]]) -> dict[str, str]:
    """Return the units that attributes state, by the datasets' paths.

    Texts of variable length are read in another process: the library allocates as much memory as a damaged reference
    says, loops for ever in a damaged heap, and ends the process on an unknown type.
    """
    import h5py

    held: dict[str, tuple[Any, str]] = {}
    kinds = set()
    for place, dataset in datasets:
        for name in UNIT_ATTRIBUTES:
            if name in dataset.attrs and (kind := h5py.check_string_dtype(dataset.attrs.get_id(name).dtype)):
                held[place] = dataset, name
                kinds.add(kind.length)
                break
    if None not in kinds:
        return _texts_of(held)
    names = {place: (dataset.name, name) for place, (dataset, name) in held.items()}
    try:
        return call_apart(_texts_in, path, names, longest_s=2.0, most_bytes=FREE_BYTES)
    except (BrokenProcessPool, MemoryError):
        raise InputError(
            "is damaged: the units of its datasets cannot be read",
            where=path.name,
            allowed="a complete HDF5 file",
            remedy="export it again",
        ) from None


def _texts_in(path: Path, names: dict[str, tuple[str, str]]) -> dict[str, str]:
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        return _texts_of({place: (file[dataset], name) for place, (dataset, name) in names.items()})


def _texts_of(held: dict[str, tuple[Any, str]]) -> dict[str, str]:
    """Return the texts of datasets' attributes."""
    values = {place: dataset.attrs[name] for place, (dataset, name) in held.items()}
    return {k: v.decode("utf-8", errors="replace") if isinstance(v, bytes) else str(v) for k, v in values.items()}


def write_hdf5(recording: Recording, path: Path) -> None:
    """Write the datasets /samples (channel, time) and /gearsig_recording (JSON).

    /samples carries the attributes sampling_rate_hz, channel_names and units for other software.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    import h5py

    try:
        with h5py.File(path, "w") as file:
            samples = file.create_dataset(OWN_SAMPLES, data=recording.samples)
            samples.attrs["sampling_rate_hz"] = recording.sampling_rate_hz
            # HDF5 texts end at a NUL.
            samples.attrs["channel_names"] = [c.name.replace("\0", " ") for c in recording.channels]
            samples.attrs["units"] = [c.unit.replace("\0", " ") for c in recording.channels]
            file.create_dataset(OWN_NAME, data=metadata_json(recording))
    except RuntimeError as error:  # when a file cannot be closed, e.g. on a full disk
        number = re.search(r"errno = (\d+)", str(error))
        raise (OSError(int(number[1]), str(error)) if number else OSError(str(error))) from error


HDF5 = FileFormat(
    "HDF5",
    (".h5", ".hdf5", ".hdf"),
    begins("HDF5", b"\x89HDF\r\n\x1a\n"),
    read_hdf5,
    write_hdf5,
    (".h5", ".hdf5"),
    read_hdf5,
    hdf5_length,
)
