"""Texts of a certificate as they were issued: JSON read strictly, and line ends that were changed on the way."""

from __future__ import annotations

import json
import math
import re
from functools import partial
from hashlib import sha256
from itertools import accumulate
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JSON_BYTES, JSON_DEPTH, NUMERAL, text_of

_FIX = "Ask whoever sent it for the file as cmm-uq wrote it"


def strict_json(content: bytes, where: str) -> dict[str, Any]:
    """The object of a JSON file: each key once, numbers that are numbers, nested within limits."""
    refusal = partial(CmmUqError, where=where, fix=_FIX)
    if len(content) > JSON_BYTES.most:
        raise refusal(f"is larger than {JSON_BYTES.most} bytes")
    text = text_of(content, where, _FIX)
    # brackets outside strings, before anything recurses
    steps = (1 if bracket in "[{" else -1 for bracket in re.findall(r"[\[{\]}]", _QUOTED.sub("", text)))
    if max(accumulate(steps), default=0) > JSON_DEPTH.most:
        raise refusal(f"is nested deeper than {JSON_DEPTH.most} levels")

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        if len(values) < len(pairs):
            names = [key for key, _ in pairs]
            raise refusal(f"has the key {next(key for i, key in enumerate(names) if key in names[:i])!r} twice")
        return values

    def numeral(of: type[int | float], text: str) -> Any:
        number = None if len(text) > NUMERAL.most else of(text)
        if number is None or not math.isfinite(number):
            raise refusal(f"has a number that is none: {text}")
        return number

    real = partial(numeral, float)
    try:
        data = json.loads(
            text, object_pairs_hook=once, parse_int=partial(numeral, int), parse_float=real, parse_constant=real
        )
    except json.JSONDecodeError as error:
        raise CmmUqError(f"is no JSON: {error.msg}", where=f"{where} line {error.lineno}", fix=_FIX) from None
    if not isinstance(data, dict):
        raise refusal("holds no JSON object")
    return data


def canonical(data: Any) -> bytes:
    """The bytes that this program writes of plain data whose numbers are rounded."""
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*+"?', re.DOTALL)


_MARK, _LINE, _OTHER_LINE = b"\xef\xbb\xbf", b"\n", b"\r\n"


def plain(content: bytes) -> bytes:
    """Without a mark at its beginning, and with line ends of one character where all are of two."""
    text = content.removeprefix(_MARK)
    return text.replace(_OTHER_LINE, _LINE) if text.count(_OTHER_LINE) == text.count(_LINE) else text


def with_ends(content: bytes, digest: str) -> bytes:
    """An input with the line ends and the mark with which it has its hash; as it is where it has it with none."""
    lines = plain(content)
    forms = (mark + lines.replace(_LINE, end) for mark in (b"", _MARK) for end in (_LINE, _OTHER_LINE))
    return next((form for form in (content, *forms) if sha256(form).hexdigest() == digest), content)
