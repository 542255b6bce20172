"""Results as tables: frames for computing, and rows of text. Whoever asks for no frame does not wait for pandas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from cmm_uq.base.units import printed_unit
from cmm_uq.maths.uncertainty.rounding import rounded

if TYPE_CHECKING:
    import pandas as pd

QUANTITY = ("value", "u", "lower", "upper", "unit")


def quantities(results: Mapping[str, Any], units: Mapping[str, str]) -> pd.DataFrame:
    """Estimates of results.json: of effects and other errors, of the artefact's sizes, of the noise where it is estimated.

    Parameters
    ----------
    results : contents of results.json.
    units : as printed, by name; of what is missing there, the unit is that in which its name ends.
    """
    owners: dict[str, Any] = {**results.get("estimates", {}), "artefact": results.get("artefact", {})}
    stated = {key: item for key, item in results.get("noise", {}).items() if _is_quantity(item) and item["u"] > 0}
    found = {
        f"{owner}.{name}": item for owner, items in {**owners, "noise": stated}.items()
        for name, item in items.items() if _is_quantity(item)
    }  # fmt: skip
    return quantity_frame(found, units)


def quantity_frame(found: Mapping[str, Mapping[str, Any]], units: Mapping[str, str]) -> pd.DataFrame:
    """Quantities of results.json as rows of value, u, ends of the 95 % interval, and unit."""
    import pandas as pd

    rows = [
        (item["value"], item["u"], *item["interval95"], units.get(name, printed_unit(name)))
        for name, item in found.items()
    ]
    return pd.DataFrame(rows, index=pd.Index(list(found), name="quantity"), columns=list(QUANTITY))


def _is_quantity(item: object) -> bool:
    return isinstance(item, Mapping) and {"value", "u", "interval95"} <= item.keys()


def shown(frame: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    """Rows of text of quantities: name, value ± U, unit; U is the larger part of the 95 % interval."""
    for name, value, u, lower, upper, unit in frame.itertuples():
        text, expanded = rounded(value, max(upper - value, value - lower)) if u > 0 else (f"{value:.6g}", "0")
        yield str(name), f"{text} ± {expanded}", str(unit)
