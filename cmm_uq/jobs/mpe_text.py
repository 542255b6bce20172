"""A maximum permissible error as standards and data sheets write it: ``3 + L/300``, ``2.5 + 4·L/1000``, ``min(3 + L/300; 8)``.

L is in mm and the error in µm. ISO 10360 writes A + L/K, VDI/VDE 2617 A + K·L: ``3 + 0.004·L`` is ``3 + L/250``. A decimal
comma is taken as one, so what stands beside each other in ``min`` is then separated by a semicolon. ``1,000`` and
``L/1.000``, which may be a thousand or one, are refused.
"""

from __future__ import annotations

import re

_NUMBER = r"(?:\d+(?:[.,]\d+)?|[.,]\d+)"
_FORM = re.compile(
    rf"(?P<a>{_NUMBER})(?:\+(?:(?P<slope>{_NUMBER})[*·×]?)?L/(?P<k>{_NUMBER})|\+(?P<per_mm>{_NUMBER})[*·×]?L)?"
)
_SLOPE_ONLY = re.compile(rf"(?:(?P<slope>{_NUMBER})[*·×]?)?L/(?P<k>{_NUMBER})|(?P<per_mm>{_NUMBER})[*·×]?L")
_LEAST = re.compile(r"min\((?P<first>[^;]+?);(?P<second>[^;]+)\)")
_LEAST_BY_COMMA = re.compile(r"min\((?P<first>[^,;]+),(?P<second>[^,;]+)\)")

_THOUSAND = re.compile(r"[1-9]\d*,\d{3}(?!\d)|/\d+[.]\d{3}(?!\d)")
"""What may be a thousand with its separator as well as a decimal: a factor of a thousand in the limit."""

FLATTEST = 1000**0.5
"""K of L/K, L in mm, that is K·L of the same figure with L in m: of a smaller figure L/K is the larger error of the two."""

HOW = (
    'is no maximum permissible error: write it as "3 + L/300" or "min(3 + L/300; 8)", L in mm and the error in µm, '
    "or as { a_um = 3.0, k = 300.0 }"
)


def mpe_of(text: str) -> dict[str, float]:
    """Keys of the table that says the same.

    Parameters
    ----------
    text : A + L/K, A + B·L/K, min(A + L/K; B) or A; ``±`` before it and ``µm`` behind it change nothing.

    Raises
    ------
    ValueError : it is none of these.
    """
    plain = re.sub(r"\s+", "", text)
    plain = re.sub(r"^±\((.*)\)(?:µm|μm|um)?$|^±(.*)$", lambda found: found[1] or found[2], plain)
    plain = re.sub(r"(?:µm|μm|um)$", "", plain)
    if _THOUSAND.search(plain):
        raise ValueError("may mean a thousand or a decimal: write thousands without a separator, as L/1000")
    least = _LEAST.fullmatch(plain) or _LEAST_BY_COMMA.fullmatch(plain)
    if least is None:
        return _growing(plain)
    parts = [_growing(least["first"]), _growing(least["second"])]
    rising = [part for part in parts if "k" in part]
    flat = [part for part in parts if "k" not in part]
    if len(rising) != 1 or len(flat) != 1:
        raise ValueError(HOW)
    return {**rising[0], **flat[0]}


def _growing(plain: str) -> dict[str, float]:
    found = _FORM.fullmatch(plain) or _SLOPE_ONLY.fullmatch(plain)
    if found is None:
        raise ValueError(HOW)
    told = found.groupdict()
    first = _number(told["a"]) if told.get("a") else 0.0
    if told["per_mm"] is not None:
        slope = _number(told["per_mm"])
        if not 0 < slope <= 1 / FLATTEST:
            raise ValueError("may have its slope in µm per mm or in µm per m: write 4 µm per m as 4·L/1000")
        return {"a_um": first, "k": 1 / slope}
    if told["k"] is None:
        return {"b_um": first}
    slope, k = (1.0 if told["slope"] is None else _number(told["slope"])), _number(told["k"])
    if not slope or not k:
        raise ValueError(HOW)
    return {"a_um": first, "k": k / slope}


def _number(text: str) -> float:
    return float(text.replace(",", "."))
