"""Figures of results.json as quantities of a digital certificate: whatever a kind reports, with unit and uncertainty.

The id of a quantity is its path in results.json, ``estimates.scale_x.ppm``, so that a program finds the same figure in both;
its value is that of results.json to the last digit. U with k and 95 % is stated where results.json has it; where the 95 %
interval is not symmetric, to the two digits that are printed of U, a second quantity states that, ``….interval95``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.digital_certificate.administration import SayIn, english, rich_of, words_of
from cmm_uq.certificate.digital_certificate.quantities import (
    ONE,
    P95,
    are_numbers,
    decimal,
    decimals,
    dsi_of,
    expanded_of,
    interval_of,
    intervals_of,
    is_budget,
    is_curve,
    is_matrix,
    is_number,
    is_quantity,
    named_unit,
    plain_cell,
    plain_name,
    product,
    ratio,
    spread_of,
    symmetric,
    unit_of,
    without_unit,
)
from cmm_uq.certificate.effect_words import effect_of, parameter_title, title_of
from cmm_uq.jobs.dcc.certificate import Characters, DccQuantity, QuantityList, StatementMetadata
from cmm_uq.jobs.dcc.quantities import IntervalList, Real, RealList

Path = tuple[str, ...]
Part = DccQuantity | QuantityList


NOT_DETERMINED = say("not determined by this recording")
_ESTIMATED = ("estimates", "artefact")
"""Keys of what is estimated with the priors that physics allows."""

_NO_RESULT = ("noise", "least_squares")
"""Keys of what is there for comparison, which nobody who looks for measured values should find."""


class DigitalFigures:
    """Makes quantities.

    ``say_in``: a text in the languages of the certificate; ``free``: paths of estimates that the recording does not
    determine: what is known of them is no result; ``stated``: what is stated of estimates, ``scale_x.ppm``; it stands
    with each.
    """

    def __init__(
        self, say_in: SayIn, free: Collection[str] = (), stated: Mapping[str, StatementMetadata] = MappingProxyType({})
    ) -> None:
        self.say_in, self.free, self.stated = say_in, free, stated
        self._ids: set[str] = set()

    def parts(self, path: Path, value: Any, above: Unit | None = None) -> Iterator[Part]:
        if value is None or value in ({}, []):
            return
        unit = unit_of(path[-1], above) if not path[-1].isdecimal() else above or ONE
        if is_number(value):
            yield self._quantity(path, Real(value=decimal(value), unit=unit.dsi))
        elif isinstance(value, str | bool):
            yield self._quantity(path, english((str(value),)))
        elif isinstance(value, list):
            yield from self._list(path, value, unit, above)
        elif is_quantity(value):
            yield from self._with_uncertainty(path, value, unit)
        else:
            yield from self._group(path, value, named_unit(path[-1]) or above)

    def id_of(self, path: Path) -> str:
        wanted = plain_name(".".join(path))
        wanted = found = wanted if wanted[0].isalpha() or wanted[0] == "_" else f"_{wanted}"
        count = 1
        while found in self._ids:
            count += 1
            found = f"{wanted}_{count}"
        self._ids.add(found)
        return found

    def title(self, path: Path) -> Text:
        if path[-1] in TITLES:
            return TITLES[path[-1]]
        if len(path) > 1 and effect_of(path[-2]) is not None:
            return parameter_title(path[-2], path[-1])
        if effect_of(path[-1]) is not None:
            return title_of(path[-1])
        return Verbatim(without_unit(path[-1]))

    def _quantity(self, path: Path, value: Any, *, name: Text | None = None) -> DccQuantity:
        label = words_of(name or self.title(path), self.say_in)
        of = self.stated.get(".".join(path[1:])) if path[0] == "estimates" else None
        return DccQuantity(id=self.id_of(path), name=label, value=value, ref_type=_ref_type(path, value),
                        metadata=() if of is None else (of,))  # fmt: skip

    def _with_uncertainty(self, path: Path, data: Mapping[str, Any], unit: Unit) -> Iterator[Part]:
        """A value with u, U, k and interval, and what else is said of it."""
        if data["value"] is None or (path[0] in _ESTIMATED and ".".join(path[-2:]) in self.free):
            yield self._quantity(path, rich_of((NOT_DETERMINED,), self.say_in))
            return
        value, interval = decimal(data["value"]), interval_of(data) if data["u"] else None
        stated = expanded_of(data) or interval
        yield self._quantity(path, Real(value=value, unit=unit.dsi, uncertainty=stated))
        if interval is not None and interval is not stated and not symmetric(data):
            named = say("{what}, 95 % coverage interval", what=self.title(path))
            yield self._quantity(
                (*path, "interval95"), Real(value=value, unit=unit.dsi, uncertainty=interval), name=named
            )
        for key, further in data.items():
            if key not in ("value", "u", "U", "k", "interval95"):
                yield from self.parts((*path, key), further, unit)

    def _group(self, path: Path, data: Mapping[str, Any], unit: Unit | None) -> Iterator[Part]:
        if is_budget(data):
            inner = self._budget(path, data)
        elif is_matrix(data):
            inner = self._matrix((*path, "matrix"), data["matrix"], [dsi_of(one) for one in data["units"]])
        else:
            inner = self._curve(path, data, unit)
        yield from self._parts_of(path, list(inner))

    def _curve(self, path: Path, data: Mapping[str, Any], unit: Unit | None) -> Iterator[Part]:
        """Each key by itself, but for a curve of errors with u and interval of each, which are one list."""
        taken: set[str] = set()
        for key, value in data.items():
            ending = key.removeprefix("error_")
            u: Any = data.get(f"u_{ending}")
            interval: Any = data.get(f"interval95_{ending}")
            if key != ending and is_curve(value, u, interval):
                low, high = interval
                stated = IntervalList(
                    standards=decimals(u), lows=decimals(low), highs=decimals(high), probabilities=(P95,)
                )
                dsi = unit_of(key, unit).dsi
                yield self._quantity((*path, key), RealList(values=decimals(value), units=(dsi,), uncertainty=stated))
                taken |= {f"u_{ending}", f"interval95_{ending}"}
            elif key not in taken:
                yield from self.parts((*path, key), value, unit)

    def _list(self, path: Path, values: Sequence[Any], unit: Unit, above: Unit | None) -> Iterator[Part]:
        if are_numbers(values):
            yield self._quantity(path, RealList(values=decimals(values), units=(unit.dsi,)))
        elif all(isinstance(value, str | bool) for value in values):
            yield self._quantity(path, _texts(values))
        elif all(isinstance(value, Mapping) for value in values):
            yield from self._rows(path, values)
        else:
            of = unit or above
            yield from self._parts_of(
                path, [p for i, v in enumerate(values) for p in self.parts((*path, str(i)), v, of)]
            )

    def _parts_of(self, path: Path, parts: Sequence[Part], name: Text | None = None) -> Iterator[Part]:
        """The parts below a key as one list, if there are any."""
        if parts:
            label = words_of(name or self.title(path), self.say_in)
            yield QuantityList(name=label, parts=tuple(parts), id=self.id_of(path))

    def _rows(self, path: Path, rows: Sequence[Mapping[str, Any]]) -> Iterator[Part]:
        """A table by its columns; row by row where a cell holds more than a figure, a text or a point."""
        if not all(plain_cell(value) for row in rows for value in row.values()):
            inner = [part for i, row in enumerate(rows) for part in self.parts((*path, str(i)), dict(row))]
        else:
            keys = list(dict.fromkeys(key for row in rows for key in row))
            inner = [part for key in keys for part in self._column((*path, key), [row.get(key) for row in rows])]
        yield from self._parts_of(path, inner)

    def _column(self, path: Path, cells: Sequence[Any]) -> Iterator[Part]:
        """A column; cells without a figure are left out, and labels then say which rows, from 1, the others are."""
        held = [(str(row), cell) for row, cell in enumerate(cells, 1) if cell is not None]
        if not held:
            return
        labels = tuple(row for row, _ in held) if len(held) < len(cells) else ()
        values, unit = [cell for _, cell in held], unit_of(path[-1], None)
        if all(is_number(value) for value in values):
            yield self._quantity(path, RealList(labels=labels, values=decimals(values), units=(unit.dsi,)))
        elif all(is_quantity(value) for value in values):
            yield from self._column_of_quantities(path, held, labels, unit)
        elif all(isinstance(value, list) for value in values) and len({len(value) for value in values}) == 1:
            for i in range(len(values[0])):
                part = RealList(labels=labels, values=decimals([value[i] for value in values]), units=(unit.dsi,))
                yield self._quantity((*path, str(i)), part, name=say("{what} {i}", what=self.title(path), i=i + 1))
        else:
            yield self._quantity(path, _texts([str(value) for value in values]))

    def _column_of_quantities(
        self, path: Path, held: Sequence[tuple[str, Mapping[str, Any]]], labels: tuple[str, ...], unit: Unit
    ) -> Iterator[Part]:
        """With the uncertainty of each, or one by one where D-SI has no list for what is known of them."""
        values = [value for _, value in held]
        uncertainty, intervals = spread_of(values), intervals_of(values)
        if uncertainty is None:
            for row, value in held:
                yield from self._with_uncertainty((*path, str(int(row) - 1)), value, unit)
            return
        found = decimals([value["value"] for value in values])
        column = RealList(labels=labels, values=found, units=(unit.dsi,), uncertainty=uncertainty)
        yield self._quantity(path, column)
        if intervals is not None and not all(map(symmetric, values)):
            named = say("{what}, 95 % coverage interval", what=self.title(path))
            yield self._quantity((*path, "interval95"), column.with_changes(uncertainty=intervals), name=named)

    def _matrix(self, path: Path, rows: Sequence[Sequence[float]], units: Sequence[str]) -> Iterator[Part]:
        """A covariance matrix, row by row, each element in the product of its units."""
        for i, (row, one) in enumerate(zip(rows, units, strict=True)):
            elements = tuple(product(one, other) for other in units)
            yield self._quantity((*path, str(i)), RealList(values=decimals(row), units=elements))

    def _budget(self, path: Path, data: Mapping[str, Any]) -> Iterator[Part]:
        unit = dsi_of(data["unit"])
        stated = expanded_of(data)
        if data["value"] is not None:
            yield self._quantity((*path, "value"), Real(value=decimal(data["value"]), unit=unit, uncertainty=stated))
        for key in ("u", "U"):
            yield self._quantity((*path, key), Real(value=decimal(data[key]), unit=unit))
        for key in ("k", "dof"):
            yield from self.parts((*path, key), data[key])
        lines, below = data["budget"], (*path, "budget")
        inputs = tuple(dsi_of(line["unit"]) for line in lines)
        columns: Mapping[str, tuple[str, ...]] = {
            "value": inputs, "u": inputs, "sensitivity": tuple(ratio(unit, one) for one in inputs),
            "contribution": (unit,) * len(lines), "share": (ONE.dsi,) * len(lines), "dof": (ONE.dsi,) * len(lines),
        }  # fmt: skip
        inner = [
            self._quantity((*below, key), _texts([line[key] for line in lines]))
            for key in ("input", "distribution", "source")
        ]
        for key, units in columns.items():
            held = [i for i, line in enumerate(lines) if line[key] is not None]
            if held:
                labels = tuple(str(i + 1) for i in held) if len(held) < len(lines) else ()
                values, own = decimals([lines[i][key] for i in held]), tuple(units[i] for i in held)
                inner.append(self._quantity((*below, key), RealList(labels=labels, values=values, units=own)))
        yield from self._parts_of(below, inner, say("Uncertainty budget"))


def _texts(values: Sequence[Any]) -> Any:
    texts = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
    if all(text and text.split() == [text] for text in texts):
        return Characters(tuple(texts))
    return english(texts)


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
