"""Answers to what an export leaves open, kept by name for the next export with the same head.

What is of the format is kept (columns, unit, decimal sign); where lines lie is of one measurement, and asked again.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of
from cmm_uq.jobs.importing.cells.encodings import is_number
from cmm_uq.jobs.importing.format import Cell, ImportKeys, format_of
from cmm_uq.jobs.importing.header import LINES_BEFORE, text_of

_NAME = re.compile(r"[\w][\w.-]{0,63}")


def folder() -> Path:
    """Where answers are kept: ``CMM_UQ_FORMATS``, or ``~/.config/cmm-uq/formats``."""
    return Path(os.environ.get("CMM_UQ_FORMATS") or Path.home() / ".config" / "cmm-uq" / "formats")


def head_of(row: Sequence[Cell]) -> list[str]:
    """Texts of a head, by which an export of the same format is known."""
    return [text_of(cell) for cell in row if cell != "" and not is_number(cell)]


def path_of(name: str) -> Path:
    if not _NAME.fullmatch(name):
        raise CmmUqError(f"{name!r} is no name", where="--save-as", fix="Use letters, digits, - and _")
    return folder() / f"{name}.json"


def as_file(keys: ImportKeys, head: tuple[str, ...]) -> bytes:
    said = keys.model_dump(exclude={"lines"}, exclude_defaults=True)
    return (json.dumps({"head": head, "keys": said}, indent=2, ensure_ascii=False) + "\n").encode()


def matching(content: bytes, where: str) -> tuple[Path, ImportKeys] | None:
    """What is remembered of the format of a file; ``None`` where nothing is. Two that differ are refused."""
    found: list[tuple[Path, ImportKeys]] = []
    for path in sorted(folder().glob("*.json")) if folder().is_dir() else ():
        try:
            kept = json.loads(content_of(path, JOB_BYTES, "Remove it"))
            head, keys = list(kept["head"]), ImportKeys.model_validate(kept["keys"])
        except (ValueError, TypeError, KeyError):
            raise CmmUqError("is no remembered format", where=str(path), fix="Remove it, and save it again") from None
        with suppress(CmmUqError):  # a file that is not read with these keys is of another format
            sheets = format_of(content, where).read(content, where, keys)
            if any(head == head_of(row) for sheet in sheets for row in sheet.rows[:LINES_BEFORE]):
                found.append((path, keys))
    if len({keys.model_dump_json() for _, keys in found}) > 1:
        both = " and ".join(path.stem for path, _ in found[:2])
        fix = f"Remove one of them from {folder()}"
        raise CmmUqError(f"is remembered as {both}, which differ", where=where, fix=fix)
    return found[0] if found else None
