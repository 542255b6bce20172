"""``U_um`` with its coverage factor ``k``, as certificates state an uncertainty, in place of ``u_um``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from cmm_uq.jobs.table import Table, Uncertainty


class ExpandedUncertainty(Table):
    """Keys that may stand together in place of ``u_um``."""

    U_um: Uncertainty
    """Expanded uncertainty, as a certificate states it, in place of `u_um`; needs `k`."""
    k: Annotated[float, Field(ge=1, le=10)]
    """Coverage factor of `U_um`."""


def with_standard_uncertainty(data: Any) -> Any:
    """A table with ``u_um`` in place of ``U_um`` and ``k``, or as it is where it has neither.

    Raises
    ------
    ValueError : one of them without the other, beside ``u_um``, or no number.
    """
    if not (isinstance(data, dict) and ("U_um" in data or "k" in data)):
        return data
    given = {key: data[key] for key in ("U_um", "k") if key in data}
    if len(given) < 2 or "u_um" in data:
        raise ValueError("give u_um, or U_um together with its coverage factor k")
    expanded, factor = given["U_um"], given["k"]
    numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (expanded, factor))
    if not numbers or not 1 <= factor <= 10:
        raise ValueError("give U_um as a number in µm, and k as one from 1 to 10")
    return {**{key: value for key, value in data.items() if key not in given}, "u_um": expanded / factor}
