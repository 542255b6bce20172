"""The draws of a posterior as a file beside results.json, for histories and parts that need more than a covariance."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from math import isfinite
from typing import Any

from cmm_uq.certificate.origin import file_name
from cmm_uq.maths.inference.draws import Draws

MOST_NUMBERS = 2**16
"""In the file, of four bytes each: several thousand effective draws of eight quantities, and a certificate to be mailed."""


@dataclass(frozen=True)
class PosteriorFile:
    """The file, and what results.json says of it."""

    name: str
    content: bytes
    entry: dict[str, Any]


def posterior_name(origin: str) -> str:
    """Of the file."""
    return file_name("posterior.npz", origin)


def posterior_file(draws: Draws, origin: str) -> PosteriorFile:
    """Draws as a file, thinned to a size that a certificate can carry.

    ``rhat_max`` and ``ess_bulk_min`` are those of all draws, each walker a chain, as ArviZ computes them.
    """
    kept = draws.thinned(MOST_NUMBERS)
    content, name = kept.as_npz(), posterior_name(origin)
    chains, count, _ = kept.array.shape
    return PosteriorFile(name, content, {
        "file": name, "sha256": hashlib.sha256(content).hexdigest(), "parameters": kept.names, "units": dict(kept.units),
        "chains": chains, "draws": count, "every": kept.every,
        "rhat_max": _finite(draws.rhat_max), "ess_bulk_min": _finite(draws.ess_bulk_min),
    })  # fmt: skip


def _finite(figure: float) -> float | None:
    return figure if isfinite(figure) else None
