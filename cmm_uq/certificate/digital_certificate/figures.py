"""Figures of results.json as quantities of a digital certificate: whatever a kind reports, with unit and uncertainty.

The id of a quantity is its path in results.json, ``estimates.scale_x.ppm``, so that a program finds the same figure in both;
its value is that of results.json to the last digit. U with k and 95 % is stated where results.json has it; where the 95 %
interval is not symmetric, to the two digits that are printed of U, a second quantity states that, ``….interval95``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import chain, count
from types import MappingProxyType
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import PRINTED, UNITS, Unit
from cmm_uq.base.values import dataclass, field
from cmm_uq.certificate.digital_certificate.administration import P_STANDARD, Languages, english
from cmm_uq.certificate.wording import effect_of, effect_title, parameter_title
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.dcc.certificate import Element

ONE = UNITS["1"]
_ENDINGS: Mapping[str, Unit] = MappingProxyType({**PRINTED, "deg": UNITS["°"], "mm2": UNITS["mm²"]})
# keys of what has no unit, also where the key above them has one
_PLAIN = ("k", "probability", "p_value", "share", "dof", "draws", "repeat", "measurement", "point", "points")
# a unit of the table with its prefix, and the power of both
_FACTOR = re.compile(r"((?:\\(?:nano|micro|milli|centi|kilo))?\\[a-z]+)(?:\\tothe\{(-?\d+)\})?")
_SHORT = 4  # numbers of a list that stand in columns of their own: a point, a direction
_ILLEGAL = re.compile(r"[^A-Za-z0-9_.\-]")
_BUDGET = {"value", "u", "U", "k", "dof", "unit", "budget"}
_LINE = {"input", "value", "u", "unit", "distribution", "dof", "sensitivity", "contribution", "share", "source"}
P95 = Decimal("0.95")
POSTERIOR = "posterior"  # in place of a named distribution: that of the draws in posterior.npz.


def unit_of(key: str, above: Unit | None) -> Unit:
    if key in _PLAIN or key.endswith("_probability"):
        return ONE
    return named_unit(key) or above or ONE


def named_unit(key: str) -> Unit | None:
    """The unit that a key ends in: µm of ``b89_range_um``."""
    fitting = [ending for ending in _ENDINGS if key == ending or key.endswith(f"_{ending}")]
    return _ENDINGS[max(fitting, key=len)] if fitting else None


def without_unit(key: str) -> str:
    """A key in words: ``b89 range``."""
    longest = max((f"_{ending}" for ending in _ENDINGS if key.endswith(f"_{ending}")), key=len, default="")
    return key.removesuffix(longest).replace("_", " ")


def dsi_of(symbol: str) -> str:
    """A unit of results.json in D-SI; of another package, which D-SI does not know, after the bar that marks such units."""
    return UNITS[symbol].dsi if symbol in UNITS else _foreign(symbol)


def _foreign(text: str) -> str:
    """Without spaces, which would part it where it stands in a list."""
    return "|" + "_".join(text.replace("|", "").split())


def product(a: str, b: str) -> str:
    if "|" in a + b:
        return _foreign(f"{a}·{b}")
    return b if a == ONE.dsi else a if b == ONE.dsi else a + b


def ratio(a: str, b: str) -> str:
    if "|" in a + b:
        return _foreign(f"{a}/({b})")
    if a == b:
        return ONE.dsi
    powers = [] if b == ONE.dsi else [(name, -int(power or 1)) for name, power in _FACTOR.findall(b)]
    return product(a, "".join(name if power == 1 else rf"{name}\tothe{{{power}}}" for name, power in powers) or ONE.dsi)


def decimal(value: float) -> Decimal:
    return Decimal(repr(value)) if isinstance(value, float) else Decimal(value)


def decimals(values: Sequence[float]) -> tuple[Decimal, ...]:
    return tuple(map(decimal, values))


def plain_name(text: str) -> str:
    return _ILLEGAL.sub("_", text)


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def are_numbers(values: object, count: int | None = None) -> bool:
    """Whether it is a list of numbers, of so many where that is said."""
    return isinstance(values, list) and all(map(is_number, values)) and (count is None or len(values) == count)


def is_quantity(value: object) -> bool:
    """Whether it has a value with its uncertainty, and is no budget."""
    if not isinstance(value, Mapping) or not {"value", "u"} <= value.keys() or "budget" in value:
        return False
    sizes, interval = [value["u"], value.get("U"), value.get("k")], value.get("interval95")
    return (
        (value["value"] is None or is_number(value["value"]))
        and all(size is None or (is_number(size) and size >= 0) for size in sizes)
        and (interval is None or (are_numbers(interval, 2) and interval[0] <= interval[1]))
    )


def is_budget(data: Mapping[str, Any]) -> bool:
    """Whether it is a budget of uncertainty, with its lines."""
    lines = data.get("budget")
    return (
        data.keys() >= _BUDGET and isinstance(lines, list) and bool(lines)
        and all(isinstance(line, Mapping) and line.keys() >= _LINE for line in lines)
    )  # fmt: skip


def is_matrix(data: Mapping[str, Any]) -> bool:
    """Whether it is a covariance matrix with names and units of its rows."""
    if data.keys() != {"parameters", "units", "matrix"} or not all(isinstance(rows, list) for rows in data.values()):
        return False
    return [are_numbers(row, len(data["units"])) for row in data["matrix"]] == [True] * len(data["units"])


def is_curve(value: Any, u: Any, interval: Any) -> bool:
    """Whether these are the points of a curve with u and interval of each."""
    if not are_numbers(value) or not value or not isinstance(interval, list) or len(interval) != 2:
        return False
    low, high = interval
    return (
        all(are_numbers(series, len(value)) for series in (u, low, high))
        and min(u) >= 0
        and all(a <= b for a, b in zip(low, high, strict=True))
    )


def plain_cell(value: Any) -> bool:
    """Whether a table can have it in one column, or in one for each number of a point."""
    if isinstance(value, list):
        return 0 < len(value) <= _SHORT and are_numbers(value)
    return not isinstance(value, Mapping) or (is_quantity(value) and value["value"] is not None)


def expanded_of(data: Mapping[str, Any]) -> dcc.Expanded | None:
    """U with k and 95 %; where only u is known, that with k = 1; None where there is none that D-SI takes."""
    u, U, k = data["u"], data.get("U"), data.get("k")
    if not u:
        return None
    if U is None:
        return dcc.Expanded(uncertainty=decimal(u), factor=Decimal(1), probability=P_STANDARD, distribution="normal")
    if k is None or k < 1:
        return None
    distribution = POSTERIOR if "interval95" in data else None
    return dcc.Expanded(uncertainty=decimal(U), factor=decimal(k), probability=P95, distribution=distribution)


def interval_of(data: Mapping[str, Any]) -> dcc.Interval | None:
    if not data.get("interval95") or data["u"] is None:
        return None
    u, low, high = decimals((data["u"], *data["interval95"]))
    return dcc.Interval(standard=u, low=low, high=high, probability=P95, distribution=POSTERIOR)


def symmetric(data: Mapping[str, Any]) -> bool:
    """Whether both sides of the interval are the same to the two digits that are printed of U."""
    value, (low, high), U = data["value"], data["interval95"], data.get("U")
    if not U:
        return bool(U == 0)
    step = 10.0 ** (math.floor(math.log10(U)) - 1)
    return bool(round((high - value) / step) == round((value - low) / step))


def spread_of(values: Sequence[Mapping[str, Any]]) -> dcc.ExpandedList | dcc.IntervalList | None:
    """Uncertainties of a column: U with k of each, or the interval of each; None where neither is known of all."""
    none = dcc.Expanded(uncertainty=Decimal(0), factor=Decimal(1), probability=P95)  # of what is known without one
    stated = [expanded_of(value) or (none if not value["u"] else None) for value in values]
    known = [(each.uncertainty, each.factor, each.probability) for each in stated if each is not None]
    if len(known) < len(stated):
        return intervals_of(values)
    uncertainties, factors, chances = zip(*known, strict=True)
    return dcc.ExpandedList(uncertainties=uncertainties, factors=factors, probabilities=chances)


def intervals_of(values: Sequence[Mapping[str, Any]]) -> dcc.IntervalList | None:
    """The interval of each; None where it is not known of all. What has no uncertainty is an interval of no width."""
    known = [(each.standard, each.low, each.high) for each in map(interval_of, values) if each is not None]
    if len(known) < len(values):
        return None
    standards, lows, highs = zip(*known, strict=True)
    return dcc.IntervalList(standards=standards, lows=lows, highs=highs, probabilities=(P95,))


Path = tuple[str, ...]
NOT_DETERMINED = say("not determined by this recording")
_ESTIMATED = ("estimates", "artefact")  # keys of what is estimated with the priors that physics allows
_NO_RESULT = ("noise", "least_squares")
"""Keys of what is there for comparison, which nobody who looks for measured values should find."""


@dataclass(frozen=True)
class DigitalFigures:
    texts: Languages
    free: Collection[str] = ()  # paths of estimates that the recording does not determine: what is known is no result
    stated: Mapping[str, dcc.StatementMetadata] = field(default_factory=dict)  # of estimates, ``scale_x.ppm``, by name
    _ids: set[str] = field(default_factory=set)

    def parts(self, path: Path, value: Any, above: Unit | None = None) -> Iterator[Element]:
        if value is None or value in ({}, []):
            return
        unit = unit_of(path[-1], above) if not path[-1].isdecimal() else above or ONE
        if is_number(value):
            yield self._quantity(path, dcc.Real(value=decimal(value), unit=unit.dsi))
        elif isinstance(value, str | bool):
            yield self._quantity(path, english((str(value),)))
        elif isinstance(value, list):
            yield from self._list(path, value, unit)
        elif is_quantity(value):
            yield from self._with_uncertainty(path, value, unit)
        elif is_budget(value):
            yield from self._parts_of(path, self._budget(path, value))
        elif is_matrix(value):
            units = [dsi_of(symbol) for symbol in value["units"]]  # an element is in the product of two
            columns = [[product(unit, other) for other in units] for unit in units]
            rows = (_series(*each) for each in zip(value["matrix"], columns, strict=True))
            yield from self._parts_of(
                path, (self._quantity((*path, "matrix", str(i)), row) for i, row in enumerate(rows))
            )
        else:
            yield from self._parts_of(path, self._keys(path, value, named_unit(path[-1]) or above))

    def id_of(self, path: Path) -> str:
        name = plain_name(".".join(path))
        name = name if name[0].isalpha() or name[0] == "_" else f"_{name}"
        id_ = next(each for each in chain((name,), (f"{name}_{i}" for i in count(2))) if each not in self._ids)
        self._ids.add(id_)
        return id_

    def title(self, path: Path) -> Text:
        if path[-1] not in TITLES and len(path) > 1 and effect_of(path[-2]) is not None:
            return parameter_title(path[-2], path[-1])
        own = effect_title(path[-1]) if effect_of(path[-1]) is not None else Verbatim(without_unit(path[-1]))
        return TITLES.get(path[-1], own)

    def _quantity(self, path: Path, value: Any, *, name: Text | None = None) -> dcc.DccQuantity:
        label = self.texts.words(name or self.title(path))
        statement = self.stated.get(".".join(path[1:])) if path[0] == "estimates" else None
        return dcc.DccQuantity(id=self.id_of(path), name=label, value=value, ref_type=_ref_type(path, value),
                        metadata=() if statement is None else (statement,))  # fmt: skip

    def _interval(self, path: Path, value: Any) -> dcc.DccQuantity:
        name = say("{what}, 95 % coverage interval", what=self.title(path))
        return self._quantity((*path, "interval95"), value, name=name)

    def _with_uncertainty(self, path: Path, data: Mapping[str, Any], unit: Unit) -> Iterator[Element]:
        """A value with u, U, k and interval, and what else is said of it."""
        if data["value"] is None or (path[0] in _ESTIMATED and ".".join(path[-2:]) in self.free):
            yield self._quantity(path, self.texts.rich(NOT_DETERMINED))
            return
        value, interval = decimal(data["value"]), interval_of(data) if data["u"] else None
        stated = expanded_of(data) or interval
        yield self._quantity(path, dcc.Real(value=value, unit=unit.dsi, uncertainty=stated))
        if interval is not None and interval is not stated and not symmetric(data):
            yield self._interval(path, dcc.Real(value=value, unit=unit.dsi, uncertainty=interval))
        for key, further in data.items():
            if key not in ("value", "u", "U", "k", "interval95"):
                yield from self.parts((*path, key), further, unit)

    def _keys(self, path: Path, data: Mapping[str, Any], unit: Unit | None) -> Iterator[Element]:
        """Each key by itself, but for a curve of errors with u and interval of each, which are one list."""
        taken: set[str] = set()
        for key, value in data.items():
            ending = key.removeprefix("error_")
            u: Any = data.get(f"u_{ending}")
            interval: Any = data.get(f"interval95_{ending}")
            if key != ending and is_curve(value, u, interval):
                low, high = map(decimals, interval)
                stated = dcc.IntervalList(standards=decimals(u), lows=low, highs=high, probabilities=(P95,))
                dsi = unit_of(key, unit).dsi
                yield self._quantity(
                    (*path, key), dcc.RealList(values=decimals(value), units=(dsi,), uncertainty=stated)
                )
                taken |= {f"u_{ending}", f"interval95_{ending}"}
            elif key not in taken:
                yield from self.parts((*path, key), value, unit)

    def _list(self, path: Path, values: Sequence[Any], unit: Unit) -> Iterator[Element]:
        if are_numbers(values):
            yield self._quantity(path, _series(values, (unit.dsi,)))
        elif all(isinstance(value, str | bool) for value in values):
            yield self._quantity(path, _texts(values))
        elif all(isinstance(value, Mapping) for value in values):
            yield from self._parts_of(path, self._table(path, values))
        else:
            inner = (part for i, value in enumerate(values) for part in self.parts((*path, str(i)), value, unit))
            yield from self._parts_of(path, inner)

    def _parts_of(self, path: Path, inner: Iterable[Element], name: Text | None = None) -> Iterator[Element]:
        """The parts below a key as one list, if there are any."""
        if parts := tuple(inner):
            yield dcc.QuantityList(name=self.texts.words(name or self.title(path)), parts=parts, id=self.id_of(path))

    def _table(self, path: Path, rows: Sequence[Mapping[str, Any]]) -> Iterator[Element]:
        """A table by its columns; row by row where a cell holds more than a figure, a text or a point."""
        if not all(plain_cell(value) for row in rows for value in row.values()):
            yield from (part for i, row in enumerate(rows) for part in self.parts((*path, str(i)), dict(row)))
        else:
            for key in dict.fromkeys(key for row in rows for key in row):
                yield from self._column((*path, key), [row.get(key) for row in rows])

    def _column(self, path: Path, cells: Sequence[Any]) -> Iterator[Element]:
        values, unit = [cell for cell in cells if cell is not None], unit_of(path[-1], None)
        if not values:
            return
        if all(map(is_number, values)):
            yield self._quantity(path, _series(cells, (unit.dsi,)))
        elif all(map(is_quantity, values)):
            yield from self._column_of_quantities(path, cells, values, unit)
        elif all(isinstance(value, list) for value in values) and len({len(value) for value in values}) == 1:
            for i in range(len(values[0])):
                part = _series([None if cell is None else cell[i] for cell in cells], (unit.dsi,))
                yield self._quantity((*path, str(i)), part, name=say("{what} {i}", what=self.title(path), i=i + 1))
        else:
            yield self._quantity(path, _texts([str(value) for value in values]))

    def _column_of_quantities(
        self, path: Path, cells: Sequence[Any], quantities: Sequence[Mapping[str, Any]], unit: Unit
    ) -> Iterator[Element]:
        """With the uncertainty of each, or one by one where D-SI has no list for what is known of them."""
        uncertainty, intervals = spread_of(quantities), intervals_of(quantities)
        if uncertainty is None:
            for row, cell in enumerate(cells):
                yield from () if cell is None else self._with_uncertainty((*path, str(row)), cell, unit)
            return
        column = _series([cell and cell["value"] for cell in cells], (unit.dsi,), uncertainty)
        yield self._quantity(path, column)
        if intervals is not None and not all(map(symmetric, quantities)):
            yield self._interval(path, column.with_changes(uncertainty=intervals))

    def _budget(self, path: Path, data: Mapping[str, Any]) -> Iterator[Element]:
        unit = dsi_of(data["unit"])
        if data["value"] is not None:
            value = dcc.Real(value=decimal(data["value"]), unit=unit, uncertainty=expanded_of(data))
            yield self._quantity((*path, "value"), value)
        yield from (self._quantity((*path, key), dcc.Real(value=decimal(data[key]), unit=unit)) for key in ("u", "U"))
        yield from (part for key in ("k", "dof") for part in self.parts((*path, key), data[key]))
        yield from self._parts_of((*path, "budget"), self._lines(path, data["budget"], unit), say("Uncertainty budget"))

    def _lines(self, path: Path, lines: Sequence[Mapping[str, Any]], unit: str) -> Iterator[Element]:
        for key in ("input", "distribution", "source"):
            yield self._quantity((*path, "budget", key), _texts([line[key] for line in lines]))
        inputs, ones = [dsi_of(line["unit"]) for line in lines], [ONE.dsi] * len(lines)
        columns: Mapping[str, Sequence[str]] = {
            "value": inputs, "u": inputs, "sensitivity": [ratio(unit, dsi) for dsi in inputs],
            "contribution": [unit] * len(lines), "share": ones, "dof": ones,
        }  # fmt: skip
        for key, units in columns.items():
            if any(line[key] is not None for line in lines):
                yield self._quantity((*path, "budget", key), _series([line[key] for line in lines], units))


def _series(cells: Sequence[Any], units: Sequence[str], uncertainty: Element | None = None) -> dcc.RealList:
    """Numbers in one unit or each in its own; of those that are there labels say which, from 1, where they are not all."""
    rows = [row for row, cell in enumerate(cells) if cell is not None]
    labels = tuple(str(row + 1) for row in rows) if len(rows) < len(cells) else ()
    units = tuple(units if len(units) == 1 else (units[row] for row in rows))
    return dcc.RealList(
        labels=labels, values=decimals([cells[row] for row in rows]), units=units, uncertainty=uncertainty
    )


def _texts(values: Sequence[Any]) -> Any:
    texts = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
    return dcc.Characters(tuple(texts)) if all(text and text.split() == [text] for text in texts) else english(texts)


def _ref_type(path: Path, value: Any) -> tuple[str, ...]:
    if path[-1] == "interval95":
        return ("cmm_coverageInterval",)
    if not isinstance(value, dcc.Real | dcc.RealList) or path[0] in _NO_RESULT:
        return ()
    if path[0] in ("certified", "tolerances") or path[-1].startswith("reference"):
        return ("basic_referenceValue",) if path[0] != "tolerances" else ("cmm_toleranceLimit",)
    if "error" in path[-1] or "deviation" in path[-1] or path[0] == "estimates":
        return ("basic_measurementError",)
    return ("basic_measuredValue",) if value.uncertainty is not None else ()
