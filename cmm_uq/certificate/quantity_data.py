"""A quantity as plain data, as every results.json has it."""

from __future__ import annotations

from typing import Any

from cmm_uq.maths.uncertainty.quantity import Quantity


def quantity_data(quantity: Quantity) -> dict[str, Any]:
    """Value, standard uncertainty, 95 % interval, expanded uncertainty, coverage factor; its unit is in the key above it."""
    return {
        "value": quantity.value, "u": quantity.u, "interval95": list(quantity.interval95), "U": quantity.expanded,
        "k": quantity.coverage_factor,
    }  # fmt: skip
