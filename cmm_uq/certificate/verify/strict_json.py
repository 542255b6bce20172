"""``results.json`` read strictly: within limits, every key once, every number finite, and as this program writes it."""

from __future__ import annotations

import json
import math
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import text_of
from cmm_uq.base.files.limits import JSON_BYTES, JSON_DEPTH, NUMERAL

_FIX = "Ask whoever sent it for the file as cmm-uq wrote it"


def strict_json(content: bytes, where: str) -> dict[str, Any]:
    """The object of a JSON file.

    Parameters
    ----------
    content : the file's bytes.
    where : of the file.

    Raises
    ------
    CmmUqError : it is no JSON object, too large or too deep, has a key twice, or a number that is none.
    """
    if len(content) > JSON_BYTES.most:
        raise CmmUqError(f"is larger than {JSON_BYTES.most} bytes", where=where, fix=_FIX)
    text = text_of(content, where, _FIX)
    _refuse_depth(text, where)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            twice = next(key for i, (key, _) in enumerate(pairs) if key in {name for name, _ in pairs[:i]})
            raise CmmUqError(f"has the key {twice!r} twice", where=where, fix=_FIX)
        return found

    def numeral(of: type[int | float], text: str) -> Any:
        number = None if len(text) > NUMERAL.most else of(text)
        if number is None or not math.isfinite(number):
            raise CmmUqError(f"has a number that is none: {text}", where=where, fix=_FIX)
        return number

    try:
        data = json.loads(
            text, object_pairs_hook=once, parse_int=lambda text: numeral(int, text),
            parse_float=lambda text: numeral(float, text), parse_constant=lambda text: numeral(float, text),
        )  # fmt: skip
    except json.JSONDecodeError as error:
        raise CmmUqError(f"is no JSON: {error.msg}", where=f"{where} line {error.lineno}", fix=_FIX) from None
    if not isinstance(data, dict):
        raise CmmUqError("holds no JSON object", where=where, fix=_FIX)
    return data


def canonical(data: Any) -> bytes:
    """The bytes that this program writes of plain data whose numbers are rounded."""
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


def _refuse_depth(text: str, where: str) -> None:
    """Count brackets outside strings, before anything recurses."""
    depth, quoted, escaped = 0, False, False
    for c in text:
        if quoted:
            if escaped:
                escaped = False
            elif c == "\\":
                escaped = True
            elif c == '"':
                quoted = False
        elif c == '"':
            quoted = True
        elif c in "[{":
            depth += 1
            if depth > JSON_DEPTH.most:
                raise CmmUqError(f"is nested deeper than {JSON_DEPTH.most} levels", where=where, fix=_FIX)
        elif c in "]}":
            depth -= 1
