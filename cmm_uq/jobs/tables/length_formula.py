"""Limits and uncertainties of a length as standards and certificates write them: ``3 + L/300``, ``Q[0.2; 0.5·L/1000]``.

L is in mm and the result in µm. ISO 10360 writes a maximum permissible error A + L/K, VDI/VDE 2617 A + K·L: ``3 + 0.004·L`` is
``3 + L/250``. Certificates print ``U = 0.2 µm + 0.5·10⁻⁶·L, k = 2`` or ``Q[0.2; 0.5·L/1000]``, the root of the sum of both
squares. A decimal comma is taken as one, so what stands beside each other in ``min`` is then separated by a semicolon. What
may be read in two ways is refused, as ``1,000`` and ``L/1.000``, which may be a thousand or one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, WrapValidator

from cmm_uq.base.files.table import LARGEST_UM, LONGEST_MM, Divisor, JobTable, Limit, Uncertainty, key
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace

_NUMBER = r"(?:\d+(?:[.,]\d+)?|[.,]\d+)"
_FORM = re.compile(
    rf"(?P<a>{_NUMBER})(?:\+(?:(?P<slope>{_NUMBER})[*·×]?)?L/(?P<k>{_NUMBER})|\+(?P<per_mm>{_NUMBER})[*·×]?L)?"
)
_SLOPE_ONLY = re.compile(rf"(?:(?P<slope>{_NUMBER})[*·×]?)?L/(?P<k>{_NUMBER})|(?P<per_mm>{_NUMBER})[*·×]?L")
_LEAST = re.compile(r"min\((?P<first>[^;]+?);(?P<second>[^;]+)\)")
_LEAST_BY_COMMA = re.compile(r"min\((?P<first>[^,;]+),(?P<second>[^,;]+)\)")

# what may be a thousand with its separator as well as a decimal: a factor of a thousand in the limit
_THOUSAND = re.compile(r"[1-9]\d*,\d{3}(?!\d)|/\d+[.]\d{3}(?!\d)")
FLATTEST = 1000**0.5
"""K of L/K, L in mm, that is K·L of the same figure with L in m: of a smaller figure L/K is the larger error of the two."""

HOW_MPE = (
    'is no maximum permissible error: write it as "3 + L/300" or "min(3 + L/300; 8)", L in mm and the error in µm, '
    "or as { a_um = 3.0, k = 300.0 }"
)


def mpe_of(text: str) -> dict[str, float]:
    """Keys of the table that says A + L/K, A + B·L/K, min(A + L/K; B) or A; ``±`` before and ``µm`` behind change nothing."""
    plain = re.sub(r"\s+", "", text)
    plain = re.sub(r"^±\((.*)\)(?:µm|μm|um)?$|^±(.*)$", lambda found: found[1] or found[2], plain)
    plain = re.sub(r"(?:µm|μm|um)$", "", plain)
    if _THOUSAND.search(plain):
        raise ValueError("may mean a thousand or a decimal: write thousands without a separator, as L/1000")
    least = _LEAST.fullmatch(plain) or _LEAST_BY_COMMA.fullmatch(plain)
    if least is None:
        return _growing(plain)
    flat, rising = sorted((_growing(least["first"]), _growing(least["second"])), key=lambda part: "k" in part)
    if "k" in flat or "k" not in rising:
        raise ValueError(HOW_MPE)
    return {**rising, **flat}


def _growing(plain: str) -> dict[str, float]:
    match = _FORM.fullmatch(plain) or _SLOPE_ONLY.fullmatch(plain)
    if match is None:
        raise ValueError(HOW_MPE)
    terms = {name: float(text.replace(",", ".")) for name, text in match.groupdict().items() if text is not None}
    first = terms.get("a", 0.0)
    if "per_mm" in terms:
        slope = terms["per_mm"]
        if not 0 < slope <= 1 / FLATTEST:
            raise ValueError("may have its slope in µm per mm or in µm per m: write 4 µm per m as 4·L/1000")
        return {"a_um": first, "k": 1 / slope}
    if "k" not in terms:
        return {"b_um": first}
    slope, k = terms.get("slope", 1.0), terms["k"]
    if not slope or not k:
        raise ValueError(HOW_MPE)
    return {"a_um": first, "k": k / slope}


class MaximumPermissibleError(JobTable):
    """``mpe`` in one of three forms: A + L/K, min(A + L/K, B), or B; L in mm, A, B and the result in µm."""

    a_um: Uncertainty | None = key(None, "A of A + L/K.")
    k: Divisor | None = key(None, "K of A + L/K, with L in mm and the result in µm.")
    b_um: Limit | None = key(None, "Limit that does not grow with the length, or at which A + L/K stops growing.")

    def problems(self) -> Iterator[str]:
        if (self.a_um is None) != (self.k is None):
            yield "mpe = A + L/K needs both a_um and k"
        if self.a_um is None and self.b_um is None:
            yield "give mpe = { a_um = …, k = … }, the same with b_um = …, or { b_um = … }"

    def at(self, lengths_mm: Floats) -> Floats:
        """Of some lengths (m,), µm."""
        most = np.full(len(lengths_mm), np.inf if self.b_um is None else self.b_um)
        if self.a_um is None or self.k is None:
            return most
        return np.asarray(np.minimum(self.a_um + lengths_mm / self.k, most), dtype=np.float64)


def _as_table(given: Any) -> Any:
    """An error that is written as a formula, as the table that says the same."""
    keys = mpe_of(given) if isinstance(given, str) else given
    if keys is not given and (k := keys.get("k", 1.0)) < 1:
        raise ValueError(
            f"grows by {1000 / k:.4g} µm in a metre: L is in mm; L in m would be L/{1000 * k:g} for L/{k:g}"
        )
    return keys


Permissible = Annotated[
    MaximumPermissibleError, BeforeValidator(_as_table, json_schema_input_type=MaximumPermissibleError | str)
]


HOW_U = (
    'is no uncertainty of a length: write it as "0.2 + 0.5·L/1000", "0.2 + L/2000", "0.2 + 0.5·10^-6·L" or '
    '"Q[0.2; 0.5·L/1000]" (the root of the sum of both squares), L in mm and the uncertainty in µm'
)

_LEVEL = 0.95
"""Probability of the interval that a certificate with degrees of freedom and without k states (JCGM 100:2008, table G.2)."""

_NORMAL = (2.576, 2.58, 3.0)
"""Coverage factors of a normal distribution for 99 % and 99.73 % (JCGM 100:2008, table G.1), as certificates print them."""

_MINUS = str.maketrans(
    {"⁻": "-", "−": "-", "–": "-", **{raised: str(digit) for digit, raised in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")}}
)
# 0.5·10⁻⁶·L, both in one unit, 0.5e-6·L, and 0.5 µm/m·L
_IN_A_METRE = re.compile(rf"(?P<slope>{_NUMBER})?(?:[*·×]?10\^?\(?-6\)?|(?<=\d)[eE]-0?6|(?:µm|μm|um)/m)[*·×]?L(?!/)")
_BARE = re.compile(r"L(?!/)")
_QUADRATIC = re.compile(r"Q[\[(](?P<first>[^;]+);(?P<second>[^;]+)[\])]")
_QUADRATIC_BY_COMMA = re.compile(r"Q[\[(](?P<first>[^,;]+),(?P<second>[^,;]+)[\])]")
_LEADING_ZERO = re.compile(r"(?<![\d.,])0,(?=\d)")


@dataclass(frozen=True)
class Growing:
    """Uncertainty of a length, µm: ``fixed_um`` + ``per_mm`` · L, or the root of the sum of both squares."""

    fixed_um: float
    per_mm: float
    squares: bool = False

    def at(self, lengths_mm: Floats | float) -> Floats:
        """Of some lengths, µm."""
        longer = self.per_mm * np.abs(np.asarray(lengths_mm, dtype=np.float64))
        return np.hypot(self.fixed_um, longer) if self.squares else np.asarray(self.fixed_um + longer)

    def over(self, k: float) -> Growing:
        return replace(self, fixed_um=self.fixed_um / k, per_mm=self.per_mm / k)


def growing_of(text: str) -> Growing | float:
    """An uncertainty as a certificate prints it; a number where it is one."""
    plain = re.sub(r"\s+", "", text.translate(_MINUS))
    plain = re.sub(r"^[uU](?:95)?(?:\([lL]\))?=|(?:µm|μm|um)(?!/)", "", plain)
    plain = re.sub(r"^\((.*)\)$", r"\1", plain)
    plain = _LEADING_ZERO.sub("0.", plain)
    terms = _QUADRATIC.fullmatch(plain) or _QUADRATIC_BY_COMMA.fullmatch(plain)
    parts = [_term(terms["first"]), _term(terms["second"])] if terms else [_term(plain)]
    # of a quadratic sum one part is fixed, and the other grows alone
    quadratic = [(bool(fixed), bool(slope)) for fixed, slope in parts if terms]
    if quadratic and (sorted(slope for _, slope in quadratic) != [False, True] or (True, True) in quadratic):
        raise ValueError(HOW_U)
    fixed, per_mm = (sum(column) for column in zip(*parts, strict=True))
    if not fixed + per_mm * LONGEST_MM > 0 or fixed > LARGEST_UM or per_mm * 1000 > LARGEST_UM:
        raise ValueError(HOW_U)
    return Growing(fixed, per_mm, bool(terms)) if per_mm else fixed


def _term(plain: str) -> tuple[float, float]:
    """Fixed part, µm, and slope, µm per mm."""
    plain = _IN_A_METRE.sub(lambda found: f"{found['slope'] or 1}·L/1000", plain)
    if _BARE.search(plain):
        raise ValueError(
            "does not say in which unit L is: write 0.5 µm in a metre as 0.5·L/1000 (L in mm) or as 0.5·10^-6·L"
        )
    try:
        keys = mpe_of(plain)
    except ValueError as error:
        raise ValueError(str(error) if "thousand" in str(error) else HOW_U) from None
    if {"b_um", "k"} <= keys.keys():
        raise ValueError(HOW_U)  # the lesser of two is no uncertainty
    return keys.get("b_um", keys.get("a_um", 0.0)), 1 / keys["k"] if "k" in keys else 0.0


def _checked(value: Any, number: Any) -> Any:
    return growing_of(value) if isinstance(value, str) else value if isinstance(value, Growing) else number(value)


if TYPE_CHECKING:
    LengthUncertainty = float | Growing
else:
    LengthUncertainty = Annotated[
        Uncertainty,
        WrapValidator(_checked),
        WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0, "maximum": LARGEST_UM}, {"type": "string"}]}),
    ]

Factor = Annotated[float, Field(ge=1, le=10)]
Freedom = Annotated[float, Field(ge=1, le=1e9)]


def factor_of(k: float | None, degrees_of_freedom: float | None) -> float | None:
    """Coverage factor as stated, or by the degrees of freedom; ``None`` where neither is stated."""
    if k is not None or degrees_of_freedom is None:
        return k
    from scipy.special import stdtrit  # takes long to import

    return float(stdtrit(degrees_of_freedom, 0.5 + 0.5 * _LEVEL))


def students(k: float) -> bool:
    """Whether a coverage factor beside which nothing is stated is one of Student's t, and of no normal distribution."""
    return k > 2 and k not in _NORMAL


def divisor_of(k: float | None, degrees_of_freedom: float | None, level: float | None = None) -> float | None:
    """What an expanded uncertainty is divided by; ``None`` where neither is stated.

    Estimates and decisions take what is certified as normal. With few degrees of freedom it is Student's t, so that U/k would
    have a smaller 95 % interval than the certificate: u is that of the normal distribution with the same one. A factor above
    2 without degrees of freedom, and of no normal distribution, is t for 95 % of a few that nobody states (JCGM 100:2008,
    G.3.2), of an interval with another ``level`` for that.
    """
    factor = factor_of(k, degrees_of_freedom)
    if factor is None or (factor <= 2 and degrees_of_freedom is None):
        return factor
    from scipy.special import ndtri

    if degrees_of_freedom is not None:
        return factor * float(ndtri(0.5 + 0.5 * _LEVEL)) / (factor_of(None, degrees_of_freedom) or 1.0)
    if level is None and not students(factor):
        return factor
    return min(factor, float(ndtri(0.5 + 0.5 * (level or _LEVEL))))


def with_standard_uncertainty(data: Any, *, columns: bool = False) -> Any:
    """A table with ``u_um`` beside ``U_um``; ``columns``: whether ``k`` may belong to a column of the recording alone."""
    data = _with_expanded(data)
    if not (isinstance(data, dict) and {"U_um", "k"} & data.keys()):
        return data
    if columns and not {"U_um", "u_um"} & data.keys():
        return data
    if "U_um" not in data or "u_um" in data or not {"k", "degrees_of_freedom"} & data.keys():
        raise ValueError("give u_um, or U_um together with its coverage factor k (or its degrees_of_freedom)")
    expanded, k, freedom = data["U_um"], data.get("k"), data.get("degrees_of_freedom")
    stated = [value for value in (expanded, k, freedom) if value is not None and not isinstance(value, str | Growing)]
    numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in stated)
    if not numbers or isinstance(k, str) or not 1 <= (2 if k is None else k) <= 10 or (freedom or 1) < 1:
        raise ValueError("give U_um as a number in µm or as a formula of the length, and k as one from 1 to 10")
    whole = growing_of(expanded) if isinstance(expanded, str) else expanded
    return {**data, "u_um": _over(whole, divisor_of(k, freedom) or 1.0)}


def _with_expanded(data: Any) -> Any:
    """A table with ``U_um`` in place of a ``u_um`` that has degrees of freedom."""
    if not (isinstance(data, dict) and "u_um" in data and not {"U_um", "k"} & data.keys()):
        return data
    standard, freedom = data["u_um"], data.get("degrees_of_freedom")
    if isinstance(freedom, bool) or not isinstance(freedom, int | float) or not freedom >= 1:
        return data
    if isinstance(standard, bool) or not isinstance(standard, int | float | str) or standard in (0, ""):
        return data
    whole = growing_of(standard) if isinstance(standard, str) else standard
    rest = {name: value for name, value in data.items() if name != "u_um"}
    return {**rest, "U_um": _over(whole, 1.0 / (factor_of(None, freedom) or 1.0))}


def _over(u: Growing | float, divisor: float) -> Growing | float:
    return u.over(divisor) if isinstance(u, Growing) else u / divisor
