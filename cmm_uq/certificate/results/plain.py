"""Quantities as plain data, the text of a JSON file, and the file of the posterior draws."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.origin import file_name
from cmm_uq.maths.inference.draws import Draws
from cmm_uq.maths.uncertainty.quantity import Quantity


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


def quantity_data(quantity: Quantity) -> dict[str, Any]:
    """Value, standard uncertainty, 95 % interval, expanded uncertainty, coverage factor; its unit is in the key above it."""
    return {
        "value": quantity.value, "u": quantity.u, "interval95": list(quantity.interval95), "U": quantity.expanded,
        "k": quantity.coverage_factor,
    }  # fmt: skip


MOST_NUMBERS = 2**16
"""In the file, of four bytes each: several thousand effective draws of eight quantities, and a certificate to be mailed."""


@dataclass(frozen=True)
class PosteriorFile:
    """The file, and what results.json says of it."""

    name: str
    content: bytes
    entry: dict[str, Any]


def posterior_name(origin: str) -> str:
    return file_name("posterior.npz", origin)


def posterior_file(draws: Draws, origin: str) -> PosteriorFile:
    """Draws thinned to what a certificate can carry; ``rhat_max``, ``ess_bulk_min`` of all, each walker a chain (ArviZ)."""
    kept = draws.thinned(MOST_NUMBERS)
    content, name = kept.as_npz(), posterior_name(origin)
    chains, count, _ = kept.array.shape
    return PosteriorFile(name, content, {
        "file": name, "sha256": hashlib.sha256(content).hexdigest(), "parameters": kept.names, "units": dict(kept.units),
        "chains": chains, "draws": count, "every": kept.every,
        "rhat_max": draws.rhat_max if isfinite(draws.rhat_max) else None,
        "ess_bulk_min": draws.ess_bulk_min if isfinite(draws.ess_bulk_min) else None,
    })  # fmt: skip
