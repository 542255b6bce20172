"""Rows written to a Parquet file as they come, a group at a time, so that memory does not grow with their number.

The file is there when it is whole, and not before. Its bytes follow from its rows and from the version of pyarrow.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.new_file import new_file, refuse_taken

Row = tuple[Any, ...]
GROUP = 20_000  # rows in a group: a few megabytes, and few enough groups


Columns = Sequence[tuple[str, str, str]]
"""Name, Arrow type and meaning of each column; a ``word`` is text that is said again and again, and kept once."""


def check_parquet(path: Path, *, force: bool) -> None:
    """Make sure, before there are any rows, that they could be written."""
    arrow("pyarrow")
    if not force:
        refuse_taken(path)


def write_parquet(path: Path, columns: Columns, rows: Iterable[Row], *, force: bool) -> None:
    module, parquet, left = arrow("pyarrow"), arrow("pyarrow.parquet"), iter(rows)
    schema = module.schema(
        [module.field(name, _type(module, kind), metadata={"meaning": told}) for name, kind, told in columns]
    )
    with (
        new_file(path, force=force) as unfinished,
        parquet.ParquetWriter(unfinished, schema, compression="zstd") as file,
    ):
        while group := list(islice(left, GROUP)):
            arrays = [
                module.array(column, type=field.type)
                for column, field in zip(zip(*group, strict=True), schema, strict=True)
            ]
            file.write_batch(module.record_batch(arrays, schema=schema))


def arrow(module: str) -> ModuleType:
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise CmmUqError("Parquet needs pyarrow", where="--parquet", fix="Install it: pip install pyarrow") from None


def _type(module: Any, kind: str) -> Any:
    return module.dictionary(module.int32(), module.string()) if kind == "word" else getattr(module, kind)()
