"""Point clouds larger than memory: read from disk in blocks, transformed, and written as they go.

A cloud is one ``.csv`` or ``.npy`` file, a folder of ``.npy`` files in the order of their names, or (with pyarrow installed)
one ``.parquet`` file. Its rows are numbers in the columns that the transformation takes, such as u, v, D, E, F of a
digitizer; the result has columns x, y, z. Memory stays that of one block whatever the length of the cloud; the target is
written whole or not at all.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.content import check_file
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.cloud_csv import csv_blocks, csv_header, csv_length, written_csv

DIGITIZER_COLUMNS = ("u_mm", "v_mm", "d_mm", "e_mm", "f_mm")
COORDINATES = ("x_mm", "y_mm", "z_mm")

BLOCK = 262_144
"""Rows read at a time."""


def transform_cloud(
    source: Path,
    target: Path,
    transform: Callable[[Floats], Floats],
    *,
    columns: Sequence[str] = DIGITIZER_COLUMNS,
    names: Sequence[str] = COORDINATES,
    mark: str = "",
    progress: Callable[[float], None] | None = None,
    block: int = BLOCK,
) -> int:
    """Write the transformed cloud, x, y, z in mm, beside or instead of the one read.

    Parameters
    ----------
    source : ``.npy`` file with rows of ``columns``, folder of such files, or ``.csv`` or ``.parquet`` file with columns of
        these names.
    target : ``.csv``, ``.npy`` or ``.parquet`` file to write.
    transform : from rows (b, k) to coordinates (b, 3), such as :meth:`Digitizer.transform`.
    columns : names of the k columns.
    names : of the columns that the transformation gives.
    mark : first line, or metadata, that says where the result comes from; arrays have no room for it.
    progress : told the part done.
    block : rows at a time.

    Returns
    -------
    number of points written.

    Raises
    ------
    CmmUqError : a file cannot be read or is no such cloud, or the transformation refuses a point (with its row).
    OutputError : the target cannot be written.
    """
    unfinished = target.with_name(f".unfinished-{target.name}")
    writer = {".parquet": _written_parquet, ".csv": written_csv}.get(target.suffix, _written_npy)
    length = cloud_length(source) if progress is not None else 0.0
    count = 0
    try:
        with writer(unfinished, names, mark) as write:
            for rows in cloud_blocks(source, columns, block=block):
                try:
                    write(transform(rows))
                except CmmUqError as error:
                    raise CmmUqError(
                        error.problem, where=f"{source}, rows from {count + 1}: {error.where or ''}", fix=error.fix
                    ) from error
                count += len(rows)
                if progress is not None:
                    progress(min(1.0, count / max(length, 1.0)))
        unfinished.replace(target)
    except OSError as error:
        raise OutputError(
            f"cannot be written: {error.strerror}", where=str(target), fix="Free the disk, or choose another place"
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)
    return count


def cloud_blocks(source: Path, columns: Sequence[str] = DIGITIZER_COLUMNS, *, block: int = BLOCK) -> Iterator[Floats]:
    """Rows (b, k) of a cloud, b ≤ ``block``, one block after another.

    Raises
    ------
    CmmUqError : the source is no cloud of these columns.
    """
    for file in cloud_files(source):
        if source.suffix == ".parquet":
            yield from _parquet_blocks(file, columns, block)
        elif source.suffix == ".csv":
            yield from csv_blocks(file, columns, block)
        else:
            yield from _npy_blocks(file, len(columns), block)


def cloud_files(source: Path) -> list[Path]:
    """Files of a cloud, in the order in which they are read.

    Raises
    ------
    CmmUqError : there is none, or one is no regular file.
    """
    files = sorted(source.glob("*.npy")) if source.is_dir() else [source]
    if not files:
        raise CmmUqError("no .npy files in this folder", where=str(source), fix="Name the folder that holds the cloud")
    for file in files:
        check_file(file, "Check the name of the cloud")
    return files


def cloud_header(source: Path) -> tuple[str, ...] | None:
    """Names of the columns of a cloud; ``None`` for arrays, which have none.

    Raises
    ------
    CmmUqError : it cannot be read.
    """
    (first, *_) = cloud_files(source)
    if source.suffix == ".csv":
        return csv_header(first)
    if source.suffix == ".parquet":
        with _parquet_file(first) as file:
            return tuple(file.schema_arrow.names)
    return None


def cloud_length(source: Path) -> float:
    """How many points a cloud has; of a CSV roughly."""
    files = cloud_files(source)
    if source.suffix == ".csv":
        return csv_length(files[0])
    if source.suffix == ".parquet":
        with _parquet_file(files[0]) as file:
            return float(file.metadata.num_rows)
    return sum(file.stat().st_size for file in files) / (8.0 * len(DIGITIZER_COLUMNS))


def _npy_blocks(path: Path, width: int, block: int) -> Iterator[Floats]:
    # read, not mapped: the pages of a mapped file stay in memory as long as there is room
    try:
        with path.open("rb") as file:
            shape, fortran, dtype = _npy_header(file, path)
            if len(shape) != 2 or shape[1] != width or fortran or dtype.kind != "f":
                raise CmmUqError(
                    f"holds {dtype} of shape {shape}" + (", column by column" if fortran else ""),
                    where=str(path),
                    fix=f"A cloud is rows of {width} floating-point numbers, row by row",
                )
            left = shape[0]
            while left:
                rows = min(left, block)
                values = np.fromfile(file, dtype=dtype, count=rows * width)
                if len(values) < rows * width:
                    raise CmmUqError("ends before its last row", where=str(path), fix="Copy the file again")
                yield values.reshape(rows, width).astype(np.float64, copy=False)
                left -= rows
    except OSError as error:
        raise CmmUqError(
            f"cannot be read: {error.strerror}", where=str(path), fix="Check the name of the cloud"
        ) from error


def _npy_header(file: Any, path: Path) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    try:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        return read(file)
    except ValueError as error:
        raise CmmUqError(f"is no .npy file ({error})", where=str(path), fix="Write it with numpy.save") from None


@contextlib.contextmanager
def _written_npy(path: Path, names: Sequence[str], mark: str) -> Iterator[Callable[[Floats], None]]:
    """Append rows to an ``.npy`` file; the number of rows is put into its header at the end."""
    count = 0

    def header() -> bytes:
        text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, {len(names)}), }}"
        return b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little") + text.ljust(117).encode() + b"\n"

    with path.open("wb") as file:
        file.write(header())

        def write(rows: Floats) -> None:
            nonlocal count
            np.ascontiguousarray(rows, dtype="<f8").tofile(file)
            count += len(rows)

        yield write
        file.seek(0)
        file.write(header())


def _parquet_blocks(path: Path, columns: Sequence[str], block: int) -> Iterator[Floats]:
    with _parquet_file(path) as file:
        missing = [name for name in columns if name not in file.schema_arrow.names]
        if missing:
            raise CmmUqError(f"has no column {missing[0]}", where=str(path), fix=f"A cloud has {', '.join(columns)}")
        for batch in file.iter_batches(batch_size=block, columns=list(columns)):
            yield _numbers([batch.column(name) for name in columns], columns, path)


def _numbers(cells: Sequence[Any], columns: Sequence[str], path: Path) -> Floats:
    try:
        return np.column_stack([column.to_numpy(zero_copy_only=False) for column in cells]).astype(np.float64)
    except (TypeError, ValueError):
        kinds = ", ".join(f"{name}: {column.type}" for name, column in zip(columns, cells, strict=True))
        raise CmmUqError(f"has columns that are no numbers ({kinds})", where=str(path), fix="Write numbers") from None


def _parquet_file(path: Path) -> Any:
    parquet = _pyarrow("pyarrow.parquet")
    try:
        return parquet.ParquetFile(path)
    except ValueError as error:  # pyarrow's ArrowInvalid is one
        raise CmmUqError(f"is no Parquet file ({error})", where=str(path), fix="Write it again") from None


@contextlib.contextmanager
def _written_parquet(path: Path, names: Sequence[str], mark: str) -> Iterator[Callable[[Floats], None]]:
    arrow, parquet = _pyarrow("pyarrow"), _pyarrow("pyarrow.parquet")
    origin = {"origin": mark.lstrip("# ").rstrip()} if mark else None
    schema = arrow.schema([(name, arrow.float64()) for name in names], metadata=origin)
    with parquet.ParquetWriter(path, schema) as writer:
        yield lambda rows: writer.write_table(arrow.table(dict(zip(names, rows.T, strict=True)), schema=schema))


def _pyarrow(module: str) -> ModuleType:
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise CmmUqError(
            "Parquet needs pyarrow", fix="Install it (pip install pyarrow), or save the cloud as .npy"
        ) from None
