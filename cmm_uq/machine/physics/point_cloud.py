"""Point clouds larger than memory: read in blocks, transformed, and written as they came.

A cloud is one ``.csv`` or ``.npy`` file, a folder of ``.npy`` files in the order of their names, or (with pyarrow installed)
one ``.parquet`` file. Memory stays that of one block; the target is written whole or not at all.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.csv_table import column_problem, numbers
from cmm_uq.base.files.limits import COLUMNS, LINE, check_file
from cmm_uq.base.points import Floats

CHUNK = 2**20  # bytes read at a time, some 20 000 lines
_FIX = "Save the cloud as CSV in UTF-8: a line of names, then one line a point"


def csv_blocks(path: Path, columns: Sequence[str], block: int) -> Iterator[Floats]:
    """Rows (b, k) of some columns, b ≤ ``block``; empty lines and those that begin with # are passed over."""
    with _opened(path) as file:
        header, number = _header(file, path)
        _refuse_missing(columns, header, path)
        places = [header.index(name) for name in columns]
        for lines, first in _lines(file, path, number + 1):
            at = [first + i for i, line in enumerate(lines) if line and line[0] != "#"]
            given = lines if len(at) == len(lines) else [lines[i - first] for i in at]
            if given:
                values = _values(given, at, header, places, path)
                for start in range(0, len(values), block):
                    yield values[start : start + block]


@contextlib.contextmanager
def written_csv(path: Path, names: Sequence[str], mark: str) -> Iterator[Callable[[Floats], None]]:
    """Append rows to a CSV file: coordinates to 0.1 nm."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{mark}{','.join(names)}\n")
        form = ",".join("%.7f" if name.endswith("_mm") else "%d" for name in names) + "\n"

        def write(rows: Floats) -> None:
            file.write(form * len(rows) % tuple(rows.ravel().tolist()))

        yield write


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
        raise CmmUqError(problem, where=str(path), fix="Check the name of the cloud") from error


def _values(lines: list[str], at: list[int], header: Sequence[str], places: Sequence[int], path: Path) -> Floats:
    width = len(header)
    other = next((i for i, line in enumerate(lines) if line.count(",") != width - 1), None)
    if other is not None:
        problem = f"has {lines[other].count(',') + 1} cells where the header has {width}"
        raise CmmUqError(problem, where=f"{path} line {at[other]}", fix="Complete the row")
    cells = ",".join(lines).split(",")
    if any(" " in line or "\t" in line for line in lines):
        cells = [cell.strip() for cell in cells]

    def column(place: int) -> Floats:
        return numbers(cells[place::width], lambda row: f"{path} line {at[row]}, column {header[place]}")

    return np.column_stack([column(place) for place in places])


def _header(file: BinaryIO, path: Path) -> tuple[tuple[str, ...], int]:
    number = 0
    while line := _line(file, path, number + 1):
        number += 1
        text = line.removeprefix("\ufeff").strip()
        if text and not text.startswith("#"):
            break
    else:
        raise CmmUqError("has no rows", where=str(path), fix=_FIX)
    header = tuple(cell.strip() for cell in text.split(","))
    where = f"{path} line {number}"
    if len(header) > COLUMNS.most:
        raise CmmUqError(f"has {len(header)} cells, {COLUMNS.most} are the most", where=where, fix=_FIX)
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise CmmUqError(f"column {twice!r} is there twice", where=where, fix="Keep one")
    if problem := next(filter(None, map(column_problem, header)), None):
        raise CmmUqError(problem, where=where, fix="Name it with letters, digits and _")
    return header, number


def _lines(file: BinaryIO, path: Path, number: int) -> Iterator[tuple[list[str], int]]:
    """Lines without the blanks around them, some at a time, and the number of the first; the first of all is ``number``."""
    rest = b""
    while chunk := file.read(CHUNK):
        whole, newline, rest = (rest + chunk).rpartition(b"\n")
        if newline:
            lines = _texts(whole.split(b"\n"), path, number)
            yield lines, number
            number += len(lines)
        _check_length(rest, path, number)
    if rest:
        yield _texts([rest], path, number), number


def _texts(lines: list[bytes], path: Path, number: int) -> list[str]:
    longest = max(lines, key=len)
    _check_length(longest, path, number + lines.index(longest))
    try:
        return [line.strip() for line in b"\n".join(lines).decode().split("\n")]
    except UnicodeDecodeError as error:
        before = error.object[: error.start].count(b"\n")
        raise CmmUqError("is not UTF-8 text", where=f"{path} line {number + before}", fix=_FIX) from None


def _check_length(line: bytes, path: Path, number: int) -> None:
    if len(line) > LINE.most:
        raise CmmUqError(f"the line is longer than {LINE.most} characters", where=f"{path} line {number}", fix=_FIX)


def _line(file: BinaryIO, path: Path, number: int) -> str:
    line = file.readline(LINE.most + 1)
    return f"{_texts([line.rstrip()], path, number)[0]}\n" if line else ""


DIGITIZER_COLUMNS = ("u_mm", "v_mm", "d_mm", "e_mm", "f_mm")
COORDINATES = ("x_mm", "y_mm", "z_mm")
BLOCK = 262_144  # rows read at a time


def transform_cloud(
    source: Path, target: Path, transform: Callable[[Floats], Floats], *, columns: Sequence[str] = DIGITIZER_COLUMNS,
    names: Sequence[str] = COORDINATES, mark: str = "", progress: Callable[[float], None] | None = None, block: int = BLOCK,
) -> int:  # fmt: skip
    """Write the transformed cloud, x, y, z in mm, beside or instead of the one read; gives the number of its points.

    ``source``: ``.npy`` file with rows of ``columns``, folder of such files, or ``.csv`` or ``.parquet`` file with columns
    of these names. ``target``: ``.csv``, ``.npy`` or ``.parquet`` file to write. ``transform``: from rows (b, k) to
    coordinates (b, 3), such as :meth:`Digitizer.transform`. ``columns``: names of the k columns. ``names``: of the columns
    that the transformation gives. ``mark``: first line, or metadata, that says where the result comes from; arrays have no
    room for it. ``progress``: told the part done. ``block``: rows at a time.
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
                    where = f"{source}, rows from {count + 1}: {error.where or ''}"
                    raise CmmUqError(error.problem, where=where, fix=error.fix) from error
                count += len(rows)
                if progress is not None:
                    progress(min(1.0, count / max(length, 1.0)))
        unfinished.replace(target)
    except OSError as error:
        problem = f"cannot be written: {error.strerror}"
        raise OutputError(problem, where=str(target), fix="Free the disk, or choose another place") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return count


def cloud_blocks(source: Path, columns: Sequence[str] = DIGITIZER_COLUMNS, *, block: int = BLOCK) -> Iterator[Floats]:
    """Rows (b, k) of a cloud, b ≤ ``block``, one block after another."""
    for file in cloud_files(source):
        if source.suffix == ".parquet":
            with _parquet_file(file) as opened:
                _refuse_missing(columns, opened.schema_arrow.names, file)
                for batch in opened.iter_batches(batch_size=block, columns=list(columns)):
                    yield _numbers([batch.column(name) for name in columns], columns, file)
        elif source.suffix == ".csv":
            yield from csv_blocks(file, columns, block)
        else:
            yield from _npy_blocks(file, len(columns), block)


def cloud_files(source: Path) -> list[Path]:
    files = sorted(source.glob("*.npy")) if source.is_dir() else [source]
    if not files:
        raise CmmUqError("no .npy files in this folder", where=str(source), fix="Name the folder that holds the cloud")
    for file in files:
        check_file(file, "Check the name of the cloud")
    return files


def cloud_header(source: Path) -> tuple[str, ...] | None:
    """Names of the columns of a cloud; ``None`` for arrays, which have none."""
    (first, *_) = cloud_files(source)
    if source.suffix == ".csv":
        with _opened(first) as file:
            return _header(file, first)[0]
    if source.suffix == ".parquet":
        with _parquet_file(first) as file:
            return tuple(file.schema_arrow.names)
    return None


def cloud_length(source: Path) -> float:
    """How many points a cloud has; of a CSV roughly, from the length of its first lines."""
    files = cloud_files(source)
    size = sum(file.stat().st_size for file in files)
    if source.suffix == ".csv":
        with _opened(files[0]) as file:
            head = file.read(2**16)
        return size * max(head.count(b"\n"), 1) / max(len(head), 1)
    if source.suffix == ".parquet":
        with _parquet_file(files[0]) as file:
            return float(file.metadata.num_rows)
    return size / (8.0 * len(DIGITIZER_COLUMNS))


def _npy_blocks(path: Path, width: int, block: int) -> Iterator[Floats]:
    # read, not mapped: the pages of a mapped file stay in memory as long as there is room
    with _opened(path) as file:
        try:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, fortran, dtype = read(file)
        except ValueError as error:
            raise CmmUqError(f"is no .npy file ({error})", where=str(path), fix="Write it with numpy.save") from None
        if len(shape) != 2 or shape[1] != width or fortran or dtype.kind != "f":
            problem = f"holds {dtype} of shape {shape}" + (", column by column" if fortran else "")
            fix = f"A cloud is rows of {width} floating-point numbers, row by row"
            raise CmmUqError(problem, where=str(path), fix=fix)
        left = shape[0]
        while left:
            rows = min(left, block)
            values = np.fromfile(file, dtype=dtype, count=rows * width)
            if len(values) < rows * width:
                raise CmmUqError("ends before its last row", where=str(path), fix="Copy the file again")
            yield values.reshape(rows, width).astype(np.float64, copy=False)
            left -= rows


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


def _refuse_missing(columns: Sequence[str], there: Sequence[str], path: Path) -> None:
    if missing := [name for name in columns if name not in there]:
        raise CmmUqError(f"has no column {missing[0]}", where=str(path), fix=f"A cloud has {', '.join(columns)}")


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
        fix = "Install it (pip install pyarrow), or save the cloud as .npy"
        raise CmmUqError("Parquet needs pyarrow", fix=fix) from None
