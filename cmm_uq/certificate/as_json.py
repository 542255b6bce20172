"""Plain data as the bytes of ``results.json``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from cmm_uq.base.errors import CmmUqError


def as_json(data: Mapping[str, Any]) -> bytes:
    """Plain data as UTF-8 JSON with finite numbers of ten digits, so that the last bits of rounding do not show."""
    try:
        return (json.dumps(_rounded(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()
    except ValueError as error:
        raise CmmUqError(f"a figure is not finite: {error}", where="results.json",
                         fix="Look for a number in the input that no measurement gives") from error  # fmt: skip


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.10g}") if isinstance(value, float) else value
