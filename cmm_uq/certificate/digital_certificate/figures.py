"""Figures of results.json as quantities of a digital certificate: whatever a kind reports, with unit and uncertainty.

The id of a quantity is its path in results.json, ``estimates.scale_x.ppm``, so that a program finds the same figure in both;
its value is that of results.json to the last digit. U with k and 95 % is stated where results.json has it; where the 95 %
interval is not symmetric, to the two digits that are printed of U, a second quantity states that, ``….interval95``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.digital_certificate import quantities as plain
from cmm_uq.certificate.digital_certificate.administration import Languages, english
from cmm_uq.certificate.digital_certificate.quantities import decimal, decimals, dsi_of, is_number, is_quantity
from cmm_uq.certificate.wording import effect_of, effect_title, parameter_title
from cmm_uq.jobs.dcc.certificate import Characters, DccQuantity, QuantityList, StatementMetadata
from cmm_uq.jobs.dcc.quantities import IntervalList, Real, RealList

Path = tuple[str, ...]
Part = DccQuantity | QuantityList
NOT_DETERMINED = say("not determined by this recording")
_ESTIMATED = ("estimates", "artefact")  # keys of what is estimated with the priors that physics allows
_NO_RESULT = ("noise", "least_squares")
"""Keys of what is there for comparison, which nobody who looks for measured values should find."""


class DigitalFigures:
    """Makes quantities.

    ``free``: paths of estimates that the recording does not determine: what is known of them is no result; ``stated``: what
    is stated of estimates, ``scale_x.ppm``; it stands with each.
    """

    def __init__(
        self, texts: Languages, free: Collection[str] = (), stated: Mapping[str, StatementMetadata] = MappingProxyType({})
    ) -> None:  # fmt: skip
        self.texts, self.free, self.stated = texts, free, stated
        self._ids: set[str] = set()

    def parts(self, path: Path, value: Any, above: Unit | None = None) -> Iterator[Part]:
        if value is None or value in ({}, []):
            return
        unit = plain.unit_of(path[-1], above) if not path[-1].isdecimal() else above or plain.ONE
        if is_number(value):
            yield self._quantity(path, Real(value=decimal(value), unit=unit.dsi))
        elif isinstance(value, str | bool):
            yield self._quantity(path, english((str(value),)))
        elif isinstance(value, list):
            yield from self._list(path, value, unit)
        elif is_quantity(value):
            yield from self._with_uncertainty(path, value, unit)
        elif plain.is_budget(value):
            yield from self._parts_of(path, self._budget(path, value))
        elif plain.is_matrix(value):
            units = [dsi_of(symbol) for symbol in value["units"]]
            yield from self._parts_of(path, self._matrix((*path, "matrix"), value["matrix"], units))
        else:
            yield from self._parts_of(path, self._keys(path, value, plain.named_unit(path[-1]) or above))

    def id_of(self, path: Path) -> str:
        name = plain.plain_name(".".join(path))
        name = id_ = name if name[0].isalpha() or name[0] == "_" else f"_{name}"
        count = 1
        while id_ in self._ids:
            count += 1
            id_ = f"{name}_{count}"
        self._ids.add(id_)
        return id_

    def title(self, path: Path) -> Text:
        if path[-1] in TITLES:
            return TITLES[path[-1]]
        if len(path) > 1 and effect_of(path[-2]) is not None:
            return parameter_title(path[-2], path[-1])
        return effect_title(path[-1]) if effect_of(path[-1]) is not None else Verbatim(plain.without_unit(path[-1]))

    def _quantity(self, path: Path, value: Any, *, name: Text | None = None) -> DccQuantity:
        label = self.texts.words(name or self.title(path))
        statement = self.stated.get(".".join(path[1:])) if path[0] == "estimates" else None
        return DccQuantity(id=self.id_of(path), name=label, value=value, ref_type=_ref_type(path, value),
                        metadata=() if statement is None else (statement,))  # fmt: skip

    def _interval(self, path: Path, value: Any) -> DccQuantity:
        name = say("{what}, 95 % coverage interval", what=self.title(path))
        return self._quantity((*path, "interval95"), value, name=name)

    def _with_uncertainty(self, path: Path, data: Mapping[str, Any], unit: Unit) -> Iterator[Part]:
        """A value with u, U, k and interval, and what else is said of it."""
        if data["value"] is None or (path[0] in _ESTIMATED and ".".join(path[-2:]) in self.free):
            yield self._quantity(path, self.texts.rich(NOT_DETERMINED))
            return
        value, interval = decimal(data["value"]), plain.interval_of(data) if data["u"] else None
        stated = plain.expanded_of(data) or interval
        yield self._quantity(path, Real(value=value, unit=unit.dsi, uncertainty=stated))
        if interval is not None and interval is not stated and not plain.symmetric(data):
            yield self._interval(path, Real(value=value, unit=unit.dsi, uncertainty=interval))
        for key, further in data.items():
            if key not in ("value", "u", "U", "k", "interval95"):
                yield from self.parts((*path, key), further, unit)

    def _keys(self, path: Path, data: Mapping[str, Any], unit: Unit | None) -> Iterator[Part]:
        """Each key by itself, but for a curve of errors with u and interval of each, which are one list."""
        taken: set[str] = set()
        for key, value in data.items():
            ending = key.removeprefix("error_")
            u: Any = data.get(f"u_{ending}")
            interval: Any = data.get(f"interval95_{ending}")
            if key != ending and plain.is_curve(value, u, interval):
                low, high = map(decimals, interval)
                stated = IntervalList(standards=decimals(u), lows=low, highs=high, probabilities=(plain.P95,))
                dsi = plain.unit_of(key, unit).dsi
                yield self._quantity((*path, key), RealList(values=decimals(value), units=(dsi,), uncertainty=stated))
                taken |= {f"u_{ending}", f"interval95_{ending}"}
            elif key not in taken:
                yield from self.parts((*path, key), value, unit)

    def _list(self, path: Path, values: Sequence[Any], unit: Unit) -> Iterator[Part]:
        if plain.are_numbers(values):
            yield self._quantity(path, RealList(values=decimals(values), units=(unit.dsi,)))
        elif all(isinstance(value, str | bool) for value in values):
            yield self._quantity(path, _texts(values))
        elif all(isinstance(value, Mapping) for value in values):
            yield from self._parts_of(path, self._table(path, values))
        else:
            inner = (part for i, value in enumerate(values) for part in self.parts((*path, str(i)), value, unit))
            yield from self._parts_of(path, inner)

    def _parts_of(self, path: Path, inner: Iterable[Part], name: Text | None = None) -> Iterator[Part]:
        """The parts below a key as one list, if there are any."""
        if parts := tuple(inner):
            yield QuantityList(name=self.texts.words(name or self.title(path)), parts=parts, id=self.id_of(path))

    def _table(self, path: Path, rows: Sequence[Mapping[str, Any]]) -> Iterator[Part]:
        """A table by its columns; row by row where a cell holds more than a figure, a text or a point."""
        if not all(plain.plain_cell(value) for row in rows for value in row.values()):
            for i, row in enumerate(rows):
                yield from self.parts((*path, str(i)), dict(row))
        else:
            for key in dict.fromkeys(key for row in rows for key in row):
                yield from self._column((*path, key), [row.get(key) for row in rows])

    def _column(self, path: Path, cells: Sequence[Any]) -> Iterator[Part]:
        """A column; cells without a figure are left out, and labels then say which rows, from 1, the others are."""
        rows = [row for row, cell in enumerate(cells) if cell is not None]
        if not rows:
            return
        labels = tuple(str(row + 1) for row in rows) if len(rows) < len(cells) else ()
        values, unit = [cells[row] for row in rows], plain.unit_of(path[-1], None)
        if all(map(is_number, values)):
            yield self._quantity(path, RealList(labels=labels, values=decimals(values), units=(unit.dsi,)))
        elif all(map(is_quantity, values)):
            yield from self._column_of_quantities(path, dict(zip(rows, values, strict=True)), labels, unit)
        elif all(isinstance(value, list) for value in values) and len({len(value) for value in values}) == 1:
            for i in range(len(values[0])):
                part = RealList(labels=labels, values=decimals([value[i] for value in values]), units=(unit.dsi,))
                yield self._quantity((*path, str(i)), part, name=say("{what} {i}", what=self.title(path), i=i + 1))
        else:
            yield self._quantity(path, _texts([str(value) for value in values]))

    def _column_of_quantities(
        self, path: Path, rows: Mapping[int, Mapping[str, Any]], labels: tuple[str, ...], unit: Unit
    ) -> Iterator[Part]:
        """With the uncertainty of each, or one by one where D-SI has no list for what is known of them."""
        quantities = list(rows.values())
        uncertainty, intervals = plain.spread_of(quantities), plain.intervals_of(quantities)
        if uncertainty is None:
            for row, quantity in rows.items():
                yield from self._with_uncertainty((*path, str(row)), quantity, unit)
            return
        values = decimals([quantity["value"] for quantity in quantities])
        column = RealList(labels=labels, values=values, units=(unit.dsi,), uncertainty=uncertainty)
        yield self._quantity(path, column)
        if intervals is not None and not all(map(plain.symmetric, quantities)):
            yield self._interval(path, column.with_changes(uncertainty=intervals))

    def _matrix(self, path: Path, rows: Sequence[Sequence[float]], units: Sequence[str]) -> Iterator[Part]:
        """A covariance matrix, row by row, each element in the product of its units."""
        for i, (row, unit) in enumerate(zip(rows, units, strict=True)):
            elements = tuple(plain.product(unit, other) for other in units)
            yield self._quantity((*path, str(i)), RealList(values=decimals(row), units=elements))

    def _budget(self, path: Path, data: Mapping[str, Any]) -> Iterator[Part]:
        unit = dsi_of(data["unit"])
        if data["value"] is not None:
            value = Real(value=decimal(data["value"]), unit=unit, uncertainty=plain.expanded_of(data))
            yield self._quantity((*path, "value"), value)
        for key in ("u", "U"):
            yield self._quantity((*path, key), Real(value=decimal(data[key]), unit=unit))
        for key in ("k", "dof"):
            yield from self.parts((*path, key), data[key])
        yield from self._parts_of((*path, "budget"), self._lines(path, data["budget"], unit), say("Uncertainty budget"))

    def _lines(self, path: Path, lines: Sequence[Mapping[str, Any]], unit: str) -> Iterator[Part]:
        """Of a budget, column by column."""
        for key in ("input", "distribution", "source"):
            yield self._quantity((*path, "budget", key), _texts([line[key] for line in lines]))
        inputs, ones = [dsi_of(line["unit"]) for line in lines], [plain.ONE.dsi] * len(lines)
        columns: Mapping[str, Sequence[str]] = {
            "value": inputs, "u": inputs, "sensitivity": [plain.ratio(unit, dsi) for dsi in inputs],
            "contribution": [unit] * len(lines), "share": ones, "dof": ones,
        }  # fmt: skip
        for key, units in columns.items():
            rows = [i for i, line in enumerate(lines) if line[key] is not None]
            if rows:
                labels = tuple(str(i + 1) for i in rows) if len(rows) < len(lines) else ()
                values = decimals([lines[i][key] for i in rows])
                column = RealList(labels=labels, values=values, units=tuple(units[i] for i in rows))
                yield self._quantity((*path, "budget", key), column)


def _texts(values: Sequence[Any]) -> Any:
    texts = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
    return Characters(tuple(texts)) if all(text and text.split() == [text] for text in texts) else english(texts)


def _ref_type(path: Path, value: Any) -> tuple[str, ...]:
    if path[-1] == "interval95":
        return ("cmm_coverageInterval",)
    if not isinstance(value, Real | RealList) or path[0] in _NO_RESULT:
        return ()
    if path[0] in ("certified", "tolerances") or path[-1].startswith("reference"):
        return ("basic_referenceValue",) if path[0] != "tolerances" else ("cmm_toleranceLimit",)
    if "error" in path[-1] or "deviation" in path[-1] or path[0] == "estimates":
        return ("basic_measurementError",)
    return ("basic_measuredValue",) if value.uncertainty is not None else ()
