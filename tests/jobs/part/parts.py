"""Jobs of parts for tests: the plate that a new job begins with, with what a test says otherwise."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Any

from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.jobs.part.feature import FeatureFacts
from cmm_uq.jobs.part.job import TABLES, PartJob, part_of
from cmm_uq.jobs.part.probed import Probed, probed

NOBODY = {"by": "the test", "reason": "nothing is"}
SIMPLE: dict[str, Any] = {
    "placing": None, "probing": None, "environment": {"u_part_k": 0.1, "u_scales_k": 0.1, "scales_cte_per_k": 0.0},
    "negligible": dict.fromkeys(("clamping", "operators", "gradients"), NOBODY),
}  # fmt: skip
"""The plate with fewer causes."""


def tables(**changes: Any) -> dict[str, Any]:
    """Tables of the plate; a table that is given stands in place of its own, ``None`` takes it away."""
    whole: dict[str, Any] = {"job": {"id": "plate", "date": dt.date(2026, 5, 31)}, **TABLES, **SIMPLE, **changes}
    return {name: table for name, table in whole.items() if table is not None}


def plate(files: Mapping[str, bytes] | None = None, **changes: Any) -> PartJob:
    """The plate as it is read, without its machine."""
    return part_of({"job.toml": as_toml(tables(**changes), "job.toml"), **(files or {})}, machine=False)


def feature(kind: str, **keys: Any) -> Probed:
    """A feature with its contact points."""
    return probed(FeatureFacts.model_validate({"name": kind, "kind": kind, **keys}), "feature")
