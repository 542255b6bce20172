"""Every quantity of a DCC as figures: where it stands, its values, units and uncertainties, in whichever form it is given.

A DCC may state the same thing in many ways: a value by itself, a list in one element or in many, an uncertainty expanded, as
standard uncertainty or as an interval. Here all are one: a :class:`Figures` for each quantity, numbers as they are printed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

from cmm_uq.jobs.dcc.administrative import Characters, Latex, Rich, Words
from cmm_uq.jobs.dcc.certificate import Certificate, Data, DccQuantity, Measurement, QuantityList, StatementMetadata
from cmm_uq.jobs.dcc.quantities import (
    Complex,
    Complexes,
    Constant,
    EllipsoidalRegion,
    Expanded,
    ExpandedList,
    ExpandedListMU,
    ExpandedMU,
    Hybrid,
    Interval,
    IntervalList,
    IntervalMU,
    Lists,
    Real,
    RealInList,
    RealList,
    Reals,
    RectangularRegion,
    StandardListMU,
    StandardMU,
    Univariate,
    UnivariateList,
)


@dataclass(frozen=True)
class ValueUncertainty:
    """Uncertainty of one value.

    expanded, factor, probability : U, k and p, where they are given.
    standard : u, where it is given by itself.
    low, high : ends of the interval, where one is given.
    """

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
    """A quantity.

    place : names of the measurement, the result and the lists that it stands in.
    name : of it.
    ref_types : what it is by the vocabularies of good practice: ``basic_measuredValue``.
    values : numbers as printed; none of a quantity in words.
    units : in D-SI, one a value.
    uncertainties : one a value.
    labels : of the values, where they have some.
    words : of a quantity that is no number.
    covariance : of the values, row by row, where it is given, and its unit.
    id : of the element.
    """

    place: tuple[str, ...]
    name: str
    ref_types: tuple[str, ...] = ()
    values: tuple[Decimal, ...] = ()
    units: tuple[str, ...] = ()
    uncertainties: tuple[ValueUncertainty, ...] = ()
    labels: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    covariance: tuple[tuple[tuple[Decimal, ...], ...], str] | None = None
    id: str | None = None

    @property
    def shown(self) -> str:
        """Where it stands and what it is, for messages."""
        return " / ".join(filter(None, (*self.place, self.name)))


def figures(certificate: Certificate) -> tuple[QuantityFigures, ...]:
    """Every quantity of the results, in the order of the certificate."""
    return tuple(
        found
        for measurement in certificate.measurements
        for result in measurement.results
        for found in of_data(result.data, (str(measurement.name), str(result.name)))
    )


def of_data(data: Data, place: tuple[str, ...]) -> Iterator[QuantityFigures]:
    """Of a result or an influence condition."""
    for part in data.parts:
        if isinstance(part, (DccQuantity, QuantityList)):
            yield from _of(part, place)
        elif isinstance(part, (Rich, Latex)):
            yield QuantityFigures(place, "", words=(_words(part),))


def _of(part: DccQuantity | QuantityList, place: tuple[str, ...]) -> Iterator[QuantityFigures]:
    name = _name(part.name)
    if isinstance(part, QuantityList):
        for inner in part.parts:
            yield from _of(inner, (*place, name) if name else place)
        return
    own = QuantityFigures(place, name, part.ref_type, id=part.id)
    for given in _numbers(part.value):
        yield replace(own, **given)


def statements(measurement: Measurement) -> Iterator[StatementMetadata]:
    """What is stated of a measurement, and of the lists and quantities of its results."""
    yield from measurement.metadata
    for result in measurement.results:
        for part in result.data.parts:
            if isinstance(part, (DccQuantity, QuantityList)):
                yield from _statements(part)


def _statements(part: DccQuantity | QuantityList) -> Iterator[StatementMetadata]:
    yield from part.metadata
    for inner in part.parts if isinstance(part, QuantityList) else ():
        yield from _statements(inner)


def _numbers(value: Any) -> Iterator[dict[str, Any]]:
    """Values, units and uncertainties of whatever a quantity consists of; of a hybrid by its first unit."""
    if isinstance(value, Hybrid):
        yield from _numbers(value.values[0])
    elif isinstance(value, (Real, Constant, RealInList)):
        stated = _stated(value.uncertainty)
        labels = (value.label,) if value.label else ()
        yield {"values": (value.value,), "units": (value.unit or "",), "uncertainties": (stated,), "labels": labels}
    elif isinstance(value, RealList):
        yield _of_list(value)
    elif isinstance(value, Reals):
        yield _of_reals(value)
    elif isinstance(value, Lists):
        for inner in value.lists:
            yield from _numbers(inner)
    elif isinstance(value, Characters):
        yield {"words": value.words}
    elif isinstance(value, (Complex, Complexes)):
        yield {"words": ("a complex quantity",)}
    else:
        yield {"words": (_words(value),)}


def _of_list(value: RealList) -> dict[str, Any]:
    count = len(value.values)
    return {
        "values": value.values, "units": _each(value.units, count, ""), "labels": value.labels,
        "uncertainties": _stated_of_list(value.uncertainty, count), "covariance": _covariance(value.region),
    }  # fmt: skip


def _of_reals(value: Reals) -> dict[str, Any]:
    common = _stated(None if value.uncertainty is None else value.uncertainty.stated)
    stated = tuple(common if one.uncertainty is None else _stated(one.uncertainty) for one in value.values)
    return {
        "values": tuple(one.value for one in value.values), "uncertainties": stated,
        "units": tuple(one.unit or value.unit or "" for one in value.values),
        "labels": tuple(one.label or "" for one in value.values) if any(one.label for one in value.values) else (),
        "covariance": _covariance(value.region),
    }  # fmt: skip


def _stated(given: object) -> ValueUncertainty:
    if isinstance(given, Univariate):
        return _stated(given.stated)
    if isinstance(given, (Expanded, ExpandedMU)):
        return ValueUncertainty(given.uncertainty, given.factor, given.probability)
    if isinstance(given, (Interval, IntervalMU)):
        return ValueUncertainty(probability=given.probability, standard=given.standard, low=given.low, high=given.high)
    if isinstance(given, StandardMU):
        return ValueUncertainty(standard=given.standard)
    return ValueUncertainty(standard=given) if isinstance(given, Decimal) else NONE


def _stated_of_list(given: object, count: int) -> tuple[ValueUncertainty, ...]:
    """One a value, where the certificate may have one for all."""
    if isinstance(given, UnivariateList):
        return _stated_of_list(given.stated, count)
    if isinstance(given, (ExpandedList, ExpandedListMU)):
        columns = (given.uncertainties, given.factors, given.probabilities)
        return tuple(
            ValueUncertainty(*row) for row in zip(*(_each(column, count, None) for column in columns), strict=True)
        )
    if isinstance(given, StandardListMU):
        return tuple(ValueUncertainty(standard=one) for one in _each(given.standards, count, None))
    if isinstance(given, IntervalList):
        lists = (given.probabilities, given.standards, given.lows, given.highs)
        rows = zip(*(_each(column, count, None) for column in lists), strict=True)
        return tuple(ValueUncertainty(None, None, *row) for row in rows)
    return (NONE,) * count


def _each(given: Sequence[Any], count: int, otherwise: Any) -> tuple[Any, ...]:
    """One a value; a list of another length than one or all says nothing that could be told apart."""
    if len(given) == count:
        return tuple(given)
    return (given[0],) * count if len(given) == 1 else (otherwise,) * count


def _covariance(
    region: EllipsoidalRegion | RectangularRegion | None,
) -> tuple[tuple[tuple[Decimal, ...], ...], str] | None:
    if region is None:
        return None
    units = {one.unit for column in region.columns for one in column.covariances}
    return tuple(tuple(one.value for one in column.covariances) for column in region.columns), " ".join(sorted(units))


def _name(words: Words | None) -> str:
    return "" if words is None else str(words)


def _words(value: Any) -> str:
    return value.latex or "" if isinstance(value, Latex) else str(value)
