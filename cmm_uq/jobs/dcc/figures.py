"""Every quantity of a DCC as figures: where it stands, its values, units and uncertainties, in whichever form it is given.

A DCC may state the same thing in many ways: a value by itself, a list in one element or in many, an uncertainty expanded, as
standard uncertainty or as an interval. Here all are one: a :class:`QuantityFigures` each, numbers as they are printed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from cmm_uq.jobs.dcc import quantities as si
from cmm_uq.jobs.dcc.certificate import (
    Certificate,
    Characters,
    Data,
    DccQuantity,
    Latex,
    Measurement,
    QuantityList,
    Rich,
    StatementMetadata,
)

Covariance = tuple[tuple[tuple[Decimal, ...], ...], str]  # of the values, row by row, and its unit


@dataclass(frozen=True)
class ValueUncertainty:
    """U, k, p and u of one value, and the ends of its interval, as far as they are given."""

    expanded: Decimal | None = None
    factor: Decimal | None = None
    probability: Decimal | None = None
    standard: Decimal | None = None
    low: Decimal | None = None
    high: Decimal | None = None

    @property
    def u(self) -> Decimal | None:
        """Standard uncertainty: as given, else U over k."""
        if self.standard is not None or self.expanded is None or not self.factor:
            return self.standard
        return self.expanded / self.factor


NONE = ValueUncertainty()


@dataclass(frozen=True)
class QuantityFigures:
    """A quantity: units (in D-SI) and uncertainties one a value; no values of one in words.

    ``place``: names of the measurement, the result and the lists that it stands in; ``ref_types``: what it is by the
    vocabularies of good practice, ``basic_measuredValue``.
    """

    place: tuple[str, ...]
    name: str
    ref_types: tuple[str, ...] = ()
    values: tuple[Decimal, ...] = ()
    units: tuple[str, ...] = ()
    uncertainties: tuple[ValueUncertainty, ...] = ()
    labels: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    covariance: Covariance | None = None
    id: str | None = None

    @property
    def shown(self) -> str:
        """Where it stands and what it is, for messages."""
        return " / ".join(filter(None, (*self.place, self.name)))


def figures(certificate: Certificate) -> tuple[QuantityFigures, ...]:
    """Every quantity of the results, in the order of the certificate."""
    return tuple(
        quantity
        for measurement in certificate.measurements
        for result in measurement.results
        for quantity in of_data(result.data, (str(measurement.name), str(result.name)))
    )


def of_data(data: Data, place: tuple[str, ...]) -> Iterator[QuantityFigures]:
    """Of a result or an influence condition."""
    for part in data.parts:
        if isinstance(part, DccQuantity | QuantityList):
            yield from _of(part, place)
        elif isinstance(part, Rich | Latex):
            yield QuantityFigures(place, "", words=(_words(part),))


def _of(part: DccQuantity | QuantityList, place: tuple[str, ...]) -> Iterator[QuantityFigures]:
    name = str(part.name or "")
    if isinstance(part, QuantityList):
        for inner in part.parts:
            yield from _of(inner, (*place, name) if name else place)
    else:
        for numbers in _numbers(part.value):
            yield QuantityFigures(place, name, part.ref_type, id=part.id, **numbers)


def statements(measurement: Measurement) -> Iterator[StatementMetadata]:
    """What is stated of a measurement, and of the lists and quantities of its results."""
    yield from measurement.metadata
    for result in measurement.results:
        for part in result.data.parts:
            if isinstance(part, DccQuantity | QuantityList):
                yield from _statements(part)


def _statements(part: DccQuantity | QuantityList) -> Iterator[StatementMetadata]:
    yield from part.metadata
    for inner in part.parts if isinstance(part, QuantityList) else ():
        yield from _statements(inner)


def _numbers(value: Any) -> Iterator[dict[str, Any]]:
    """Values, units and uncertainties of whatever a quantity consists of; of a hybrid by its first unit."""
    match value:
        case si.Hybrid():
            yield from _numbers(value.values[0])
        case si.Real() | si.Constant() | si.RealInList():
            labels = (value.label,) if value.label else ()
            stated = (_stated(value.uncertainty),)
            yield {"values": (value.value,), "units": (value.unit or "",), "uncertainties": stated, "labels": labels}
        case si.RealList():
            count = len(value.values)
            yield {
                "values": value.values,
                "units": _each(value.units, count, ""),
                "labels": value.labels,
                "uncertainties": _stated_of_list(value.uncertainty, count),
                "covariance": _covariance(value.region),
            }
        case si.Reals(values=reals):
            common = _stated(value.uncertainty and value.uncertainty.stated)
            yield {
                "values": tuple(real.value for real in reals),
                "uncertainties": tuple(common if r.uncertainty is None else _stated(r.uncertainty) for r in reals),
                "units": tuple(real.unit or value.unit or "" for real in reals),
                "labels": tuple(real.label or "" for real in reals) if any(real.label for real in reals) else (),
                "covariance": _covariance(value.region),
            }
        case si.Lists():
            for inner in value.lists:
                yield from _numbers(inner)
        case Characters():
            yield {"words": value.words}
        case si.Complex() | si.Complexes():
            yield {"words": ("a complex quantity",)}
        case _:
            yield {"words": (_words(value),)}


def _stated(stated: object) -> ValueUncertainty:
    match stated:
        case si.Univariate():
            return _stated(stated.stated)
        case si.Expanded() | si.ExpandedMU():
            return ValueUncertainty(stated.uncertainty, stated.factor, stated.probability)
        case si.Interval():
            return ValueUncertainty(None, None, stated.probability, stated.standard, stated.low, stated.high)
        case si.StandardMU():
            return ValueUncertainty(standard=stated.standard)
        case Decimal():
            return ValueUncertainty(standard=stated)
    return NONE


def _stated_of_list(stated: object, count: int) -> tuple[ValueUncertainty, ...]:
    """One a value, where the certificate may have one for all."""
    columns: Sequence[Sequence[Any]]
    match stated:
        case si.UnivariateList():
            return _stated_of_list(stated.stated, count)
        case si.ExpandedList() | si.ExpandedListMU():
            columns = (stated.uncertainties, stated.factors, stated.probabilities)
        case si.StandardListMU():
            columns = ((None,), (None,), (None,), stated.standards)
        case si.IntervalList():
            columns = ((None,), (None,), stated.probabilities, stated.standards, stated.lows, stated.highs)
        case _:
            return (NONE,) * count
    rows = zip(*(_each(column, count, None) for column in columns), strict=True)
    return tuple(ValueUncertainty(*row) for row in rows)


def _each(column: Sequence[Any], count: int, otherwise: Any) -> tuple[Any, ...]:
    """One a value; a list of another length than one or all says nothing that could be told apart."""
    if len(column) == count:
        return tuple(column)
    return (column[0],) * count if len(column) == 1 else (otherwise,) * count


def _covariance(region: si.EllipsoidalRegion | None) -> Covariance | None:
    if region is None:
        return None
    units = {element.unit for column in region.columns for element in column.covariances}
    matrix = tuple(tuple(element.value for element in column.covariances) for column in region.columns)
    return matrix, " ".join(sorted(units))


def _words(value: Any) -> str:
    return value.latex or "" if isinstance(value, Latex) else str(value)
