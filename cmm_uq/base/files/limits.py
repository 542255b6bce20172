"""The limits of what is read, each with its reason; docs/limits.md prints this table.

They are far beyond what a calibration needs, and near enough that whatever keeps to them is read, or refused, within seconds.

Files read whole: regular ones only, without waiting for a pipe or a device, and never more than their limit.
"""

from __future__ import annotations

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.values import dataclass


@dataclass(frozen=True)
class Limit:
    """What is limited, the most that is still read of it, in which unit, and why."""

    most: int
    unit: str
    what: str
    why: str


JOB_BYTES = Limit(1_000_000, "bytes", "job.toml, truth.toml", "a job is a few kilobytes of text")
MODEL_BYTES = Limit(4_000_000, "bytes", "model file of a budget", "holds 250 000 draws of an earlier Monte Carlo")
TABLE_BYTES = Limit(64_000_000, "bytes", "recording, temperature log", "100 000 rows of 30 columns take half of it")
UNPACKED = Limit(400_000_000, "bytes", "workbook once it is unpacked", "200 000 rows of 30 columns take half of it")
MAP_BYTES = Limit(4_000_000, "bytes", "error map", "30 000 positions")
LOGO_BYTES = Limit(500_000, "bytes", "logo of a laboratory", "it stands on every certificate, and is attached to it")
LOGO_PIXELS = Limit(4_000, "pixels", "side of a logo", "three times what a printer shows of it")
LOGO_ELEMENTS = Limit(5_000, "elements", "logo as SVG", "a coat of arms has a tenth")
DCC_BYTES = Limit(
    64_000_000, "bytes", "digital certificate", "attached files and its human-readable copy take a few of them"
)
SECRET_BYTES = Limit(4_096, "bytes", "file with a secret", "a password is one line")
KEY_BYTES = Limit(
    1_000_000, "bytes", "file with a key, certificates or revocations", "a key with its chain takes ten thousand"
)
SIGNED_BYTES = Limit(64_000_000, "bytes", "signed PDF or XML", "a certificate with its inputs takes a few million")
ROWS = Limit(200_000, "rows", "CSV file", "a scanned surface; larger ones are point clouds")
MAP_ROWS = Limit(30_000, "rows", "error map", "10 m of each axis by the millimetre")
COLUMNS = Limit(200, "columns", "CSV file", "every column is searched by a diagnosis")
CELLS = Limit(5_000_000, "cells", "CSV file", "100 000 rows of 30 columns are 3 000 000")
OBSERVATIONS = Limit(300_000, "observations", "estimate", "100 000 points of three coordinates each")
FREEDOMS = Limit(
    6_000, "freedoms", "placings of an artefact together", "each is eliminated anew for every size of noise"
)
CELL = Limit(500, "characters", "cell of a CSV file", "a number needs 25, a remark a sentence")
LINE = Limit(100_000, "characters", "line of a CSV file", "200 columns of 500 characters")
LINES = Limit(500_000, "lines", "CSV file", "rows, comments and empty lines")
COLUMN_NAME = Limit(60, "characters", "name of a column", "it stands in tables, plots and messages")
NUMERAL = Limit(
    100, "characters", "number, date or bare key", "a double has 17 digits; longer integers take Python minutes"
)

DEPTH = Limit(20, "levels", "brackets in TOML, parts of a dotted key", "the deepest key of a job is at 4")
TOML_KEY = Limit(100, "characters", "key in TOML", "it stands in messages")
TEXT = Limit(10_000, "characters", "text in TOML", "three pages of remarks; the longest expression")
WORD = Limit(
    500, "characters", "word of a text in a job", "a page breaks lines between words; web addresses are shorter"
)
FILE_NAME = Limit(200, "characters", "file name in a job", "file systems take 255 bytes")
EFFECTS = Limit(100, "entries", "effects, rivals or tolerances of a model", "no recording tells as many apart")
STATED = Limit(20, "entries", "[[effect]]", "each is one more explanation that every diagnosis tries")
MAPS = Limit(20, "entries", "error maps of a machine", "one a degree")
CONFORMITY = Limit(50, "entries", "[[conformity]]", "each is a section of the certificate")
LISTED = Limit(10_000, "entries", "other lists of a job", "measurements to set aside, shifts, lengths, directions")
DRAWS = Limit(250_000, "entries", "samples of an input", "draws of an earlier Monte Carlo")
INPUTS = Limit(500, "entries", "inputs, outputs or correlations of a budget", "its matrix of correlations is square")

PDF_BYTES = Limit(
    100_000_000, "bytes", "PDF that is verified", "a certificate with a large recording inside has ten million"
)
PDF_OBJECTS = Limit(200_000, "objects", "PDF that is verified", "ten thousand rows of a table make 100 000")
PDF_PAGES = Limit(2_000, "pages", "PDF that is verified", "a certificate has a dozen")
PDF_UNPACKED = Limit(
    400_000_000, "bytes", "PDF that is verified, once it is unpacked", "ten times the largest certificate"
)
HTML_BYTES = Limit(64_000_000, "bytes", "HTML that is verified", "a certificate with crowded pictures has ten million")
HTML_DEPTH = Limit(100, "levels", "tags in HTML that is verified", "a cell of a table is at 10")
JSON_BYTES = Limit(64_000_000, "bytes", "results.json", "the figures of the largest recording take half of it")
JSON_DEPTH = Limit(40, "levels", "brackets in results.json", "the deepest figure is at 8")
GIVEN = Limit(1_000, "files", "files that are verified together", "a job names a few dozen")
XML_ELEMENTS = Limit(500_000, "elements", "XML file", "a certificate with 10 000 lengths has a tenth")
XML_DEPTH = Limit(60, "levels of elements", "XML file", "a certificate has 15")
XML_ATTRIBUTES = Limit(50, "attributes of an element", "XML file", "a certificate has 4")

LIMITS = tuple(value for value in list(globals().values()) if isinstance(value, Limit))
"""All of them, in the order of docs/limits.md."""


_KINDS = (
    (stat.S_ISDIR, "is a folder, not a file"),
    (stat.S_ISFIFO, "is a pipe, not a file"),
    (stat.S_ISSOCK, "is a socket, not a file"),
    (stat.S_ISCHR, "is a device, not a file"),
    (stat.S_ISBLK, "is a device, not a file"),
)
_OPEN = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


def content_of(path: Path, limit: Limit, fix: str) -> bytes:
    where = str(path)
    try:
        descriptor = os.open(path, _OPEN)
        try:
            _refuse_other_than_a_file(os.fstat(descriptor).st_mode, where, fix)
            with os.fdopen(descriptor, "rb", closefd=False) as file:
                content = file.read(limit.most + 1)
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        raise CmmUqError("no such file", where=where, fix=fix) from None
    except IsADirectoryError:
        raise CmmUqError("is a folder, not a file", where=where, fix=fix) from None
    except OSError as error:
        raise CmmUqError(f"cannot be read: {error.strerror}", where=where, fix=fix) from error
    except ValueError as error:  # a name with a zero character
        raise CmmUqError(f"cannot be read: {error}", where=where, fix=fix) from error
    if len(content) > limit.most:
        raise CmmUqError(
            f"is larger than the {limit.most} {limit.unit} that are read of such a file", where=where,
            fix="Check that it is the right file",
        )  # fmt: skip
    return content


def check_file(path: Path, fix: str) -> None:
    """Refuse what is no regular file, for a file that is too large to be read whole."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        what = error.strerror if isinstance(error, OSError) else str(error)
        raise CmmUqError(f"cannot be read: {what}", where=str(path), fix=fix) from None
    _refuse_other_than_a_file(mode, str(path), fix)


def check_permitted(path: Path, fix: str) -> None:
    """Refuse a folder that this user may not enter, or a file that may not be read."""
    folder = path.is_dir()
    if (folder or path.is_file()) and not os.access(path, os.R_OK | (os.X_OK if folder else 0)):
        problem = "may not be entered" if folder else "cannot be read"
        raise CmmUqError(f"{problem}: Permission denied", where=str(path), fix=fix)


def text_of(content: bytes, where: str, fix: str = "Save it as UTF-8") -> str:
    """Text of a file's bytes, UTF-8 with or without a byte-order mark."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CmmUqError("is not UTF-8 text", where=f"{where} line {line}", fix=fix) from None
    if "\0" in text:
        raise CmmUqError("contains zero bytes: it is no text file", where=where, fix=fix)
    return text


def value_of(text: str) -> Any:
    """A value as TOML has it; a text without quotes as it is."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def _refuse_other_than_a_file(mode: int, where: str, fix: str) -> None:
    for is_kind, problem in _KINDS:
        if is_kind(mode):
            raise CmmUqError(problem, where=where, fix=fix)
