"""Every quantity of a DCC as figures, in whichever form it is given, and what a DCC says, for a person and as plain data.

A DCC may state the same thing in many ways: a value by itself, a list in one element or in many, an uncertainty expanded, as
standard uncertainty or as an interval. Here all are one: a :class:`QuantityFigures` each, numbers as they are printed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from typing import Any

from cmm_uq.base.units import UNITS
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.dcc.certificate import DccQuantity, Element, Measurement, QuantityList, StatementMetadata
from cmm_uq.jobs.tables.length_formula import divisor_of
from cmm_uq.maths.uncertainty.quantity import rounded

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

    @property
    def normal_u(self) -> Decimal | None:
        """The same, of the normal distribution with the interval of U and p where k is more than that of one."""
        if self.standard is not None or self.expanded is None or self.factor is None or self.factor <= 2:
            return self.u
        level = None if self.probability is None else float(self.probability)
        return self.expanded / Decimal(divisor_of(float(self.factor), None, level) or 1)

    @property
    def printed(self) -> tuple[str, str, str, str]:
        """U, k, u and interval, empty where it is not given."""
        interval = "" if self.low is None else f"{self.low} to {self.high}"
        return _text(self.expanded), _text(self.factor), _text(self.standard), interval


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
        return " / ".join(dict.fromkeys(filter(None, (*self.place, self.name))))


def figures(certificate: dcc.Certificate) -> tuple[QuantityFigures, ...]:
    """Every quantity of the results, in the order of the certificate."""
    results = ((str(measurement.name), one) for measurement in certificate.measurements for one in measurement.results)
    return tuple(each for name, result in results for each in of_data(result.data, (name, str(result.name))))


def of_data(data: dcc.Data, place: tuple[str, ...]) -> Iterator[QuantityFigures]:
    """Of a result or an influence condition."""
    for where, part in _walk(data.parts, place):
        if isinstance(part, DccQuantity):
            for numbers in _numbers(part.value):
                yield QuantityFigures(where, str(part.name or ""), part.ref_type, id=part.id, **numbers)
        elif isinstance(part, dcc.Rich | dcc.Latex):
            yield QuantityFigures(where, "", words=(_words(part),))


def _walk(parts: Iterable[object], place: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    """Parts in their order, each list before what it holds, with the names of the lists that they stand in."""
    for part in parts:
        yield place, part
        if isinstance(part, QuantityList):
            yield from _walk(part.parts, (*place, *filter(None, (str(part.name or ""),))))


def statements(measurement: Measurement) -> Iterator[StatementMetadata]:
    """What is stated of a measurement, and of the lists and quantities of its results."""
    yield from measurement.metadata
    for result in measurement.results:
        for _, part in _walk(result.data.parts, ()):
            if isinstance(part, DccQuantity | QuantityList):
                yield from part.metadata


def _numbers(value: Any) -> Iterator[dict[str, Any]]:
    """Values, units and uncertainties of whatever a quantity consists of; of a hybrid by its first unit."""
    match type(value).__name__:
        case "Hybrid":
            yield from _numbers(value.values[0])
        case "Lists":
            for inner in value.lists:
                yield from _numbers(inner)
        case "Real" | "Constant" | "RealInList":
            yield _by_themselves((value,))
        case "Reals":
            yield _by_themselves(value.values, value.unit, _stated(value.uncertainty), value.region)
        case "RealList":
            count, covariance = len(value.values), _covariance(value.region)
            yield {"values": value.values, "units": _each(value.units, count, ""), "labels": value.labels,
                   "uncertainties": _stated_of_list(value.uncertainty, count), "covariance": covariance}  # fmt: skip
        case "Complex" | "Complexes":
            yield {"words": ("a complex quantity",)}
        case _:
            yield {"words": value.words if isinstance(value, dcc.Characters) else (_words(value),)}


def _by_themselves(
    reals: Sequence[Element], unit: str | None = None, common: ValueUncertainty = NONE, region: Element | None = None
) -> dict[str, Any]:
    """Of values one by one, with what all of them have in common."""
    return {
        "values": tuple(real.value for real in reals), "units": tuple(real.unit or unit or "" for real in reals),
        "uncertainties": tuple(common if real.uncertainty is None else _stated(real.uncertainty) for real in reals),
        "labels": tuple(real.label or "" for real in reals) if any(real.label for real in reals) else (),
        "covariance": _covariance(region),
    }  # fmt: skip


_STATED = ("uncertainty", "factor", "probability", "standard", "low", "high")
_STATED_OF_LIST = ("uncertainties", "factors", "probabilities", "standards", "lows", "highs")
"""Fields of all forms of uncertainty, in the order of :class:`ValueUncertainty`."""


def _stated(stated: Any) -> ValueUncertainty:
    stated = getattr(stated, "stated", stated)
    if isinstance(stated, Decimal):
        return ValueUncertainty(standard=stated)
    return ValueUncertainty(*(getattr(stated, name, None) for name in _STATED))


def _stated_of_list(stated: Any, count: int) -> tuple[ValueUncertainty, ...]:
    """One a value, where the certificate may have one for all."""
    stated = getattr(stated, "stated", stated)
    columns = (_each(getattr(stated, name, ()), count, None) for name in _STATED_OF_LIST)
    return tuple(ValueUncertainty(*row) for row in zip(*columns, strict=True))


def _each(column: Sequence[Any], count: int, otherwise: Any) -> tuple[Any, ...]:
    """One a value; a list of another length than one or all says nothing that could be told apart."""
    if len(column) == count:
        return tuple(column)
    return (column[0],) * count if len(column) == 1 else (otherwise,) * count


def _covariance(region: Element | None) -> Covariance | None:
    if region is None:
        return None
    units = {element.unit for column in region.columns for element in column.covariances}
    matrix = tuple(tuple(element.value for element in column.covariances) for column in region.columns)
    return matrix, " ".join(sorted(units))


def _words(value: Any) -> str:
    return value.latex or "" if isinstance(value, dcc.Latex) else str(value)


_SYMBOLS = {unit.dsi: str.__str__(unit) for unit in UNITS.values()}
Rows = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Grid:
    """Results that belong together: a column a quantity, a row a value."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class CertificateView:
    """A certificate for a person: particulars; title, rows and tables of each measurement."""

    rows: Rows
    parts: tuple[tuple[str, Rows, tuple[Grid, ...]], ...]


def shown(certificate: dcc.Certificate) -> CertificateView:
    return CertificateView(_particulars(certificate), tuple(map(_measured, certificate.measurements)))


def unit_shown(dsi: str) -> str:
    r"""A unit as printed: ``µm`` of ``\micro\metre``; in the notation of D-SI where it is not of the table."""
    return "" if dsi == r"\one" else _SYMBOLS.get(dsi, dsi)


def data(certificate: dcc.Certificate) -> dict[str, Any]:
    """The same as plain data; numbers as text, with the digits that the certificate has."""
    core, laboratory = certificate.administrative.core, certificate.administrative.laboratory
    return {
        "schema": "cmm-uq/dcc/1", "version": certificate.version, "number": core.identifier,
        "issued": None if core.issued is None else core.issued.isoformat(),
        "performed": [core.begin.isoformat(), core.end.isoformat()],
        "laboratory": str(laboratory.contact.name), "customer": str(certificate.administrative.customer.name),
        "particulars": [list(row) for row in _particulars(certificate)], "signed": bool(certificate.signatures),
        "quantities": [_quantity(quantity) for quantity in figures(certificate)],
        "statements": [
            {"measurement": str(measurement.name), "rows": [list(row) for row in rows]}
            for measurement in certificate.measurements if (rows := _conformity(measurement))
        ],
    }  # fmt: skip


def _quantity(quantity: QuantityFigures) -> dict[str, Any]:
    stated, covariance = quantity.uncertainties, None
    if quantity.covariance is not None:
        matrix, unit = quantity.covariance
        covariance = {"matrix": [[str(value) for value in row] for row in matrix], "unit": unit}
    return {
        "place": list(quantity.place), "name": quantity.name, "ref_types": list(quantity.ref_types),
        "words": list(quantity.words), "values": [str(value) for value in quantity.values], "units": list(quantity.units),
        "U": [_text(one.expanded) or None for one in stated], "k": [_text(one.factor) or None for one in stated],
        "p": [_text(one.probability) or None for one in stated],
        "u": [None if one.u is None else float(one.u) for one in stated],
        "interval": [None if one.low is None else [str(one.low), _text(one.high) or None] for one in stated],
        "covariance": covariance,
    }  # fmt: skip


def _text(value: object | None) -> str:
    return "" if value is None else str(value)


def _joined(*parts: object | None, by: str = ", ") -> str:
    return by.join(dict.fromkeys(filter(None, map(_text, parts))))


def _rows(*rows: tuple[str, str]) -> Rows:
    return tuple((label, text) for label, text in rows if text)


def _particulars(certificate: dcc.Certificate) -> Rows:
    administrative = certificate.administrative
    core, signed = administrative.core, "none in the file"
    if certificate.signatures:
        signed = f"{len(certificate.signatures)} (not verified here)"
    performed = _text(core.begin) if core.begin == core.end else f"{core.begin} to {core.end}"
    return _rows(
        ("Certificate", core.identifier), ("Schema", f"DCC {certificate.version}"),
        ("Replaces", "" if core.replaced is None else f"{core.replaced.identifier} ({core.replaced.change})"),
        ("Previous report", _hashed(core.previous)), ("Laboratory", _contact(administrative.laboratory.contact)),
        ("Laboratory code", administrative.laboratory.code or ""), ("Customer", _contact(administrative.customer)),
        *(("Item", _joined(item.name, item.manufacturer and item.manufacturer.name, item.model, *_identified(item)))
          for item in administrative.items.items),
        ("Received", _text(core.received)),
        ("Calibrated", performed), ("Issued", _text(core.issued)), ("Place", core.location.place),
        ("Languages", ", ".join(core.languages)),
        *(("Responsible", _joined(person.person.name, person.role, by=" ")) for person in administrative.persons),
        *(("Statement", _statement(statement)) for statement in administrative.statements),
        ("Software", ", ".join(f"{program.name} {program.release}" for program in administrative.software)),
        ("Signatures", signed),
    )  # fmt: skip


def _measured(measurement: Measurement) -> tuple[str, Rows, tuple[Grid, ...]]:
    equipment = () if measurement.equipment is None else measurement.equipment.equipment
    rows = _rows(
        *(("Method", _joined(method.name, *method.norms, *method.references)) for method in measurement.methods),
        *(
            ("Equipment", _joined(piece.name, piece.model, *_identified(piece), _certified(piece)))
            for piece in equipment
        ),
        *(("Condition", f"{each.name}: {_sentence(of_data(each.data, ()))}") for each in measurement.conditions),
        *_conformity(measurement),
    )
    grids = tuple(_grid(str(result.name), [*of_data(result.data, ())]) for result in measurement.results)
    return str(measurement.name), rows, grids


def _grid(title: str, quantities: Sequence[QuantityFigures]) -> Grid:
    """Lists side by side, one that has fewer values in the first rows only; quantities of one value each below each other."""
    if len(quantities) > 1 and all(len(quantity.values) <= 1 for quantity in quantities):
        return _below_each_other(title, quantities)
    columns = [column for quantity in quantities for column in _columns(quantity)]
    count = max((len(cells) for _, cells in columns), default=0)
    rows = tuple(tuple(cells[i] if i < len(cells) else "" for _, cells in columns) for i in range(count))
    return Grid(title, tuple(heading for heading, _ in columns), rows)


def _below_each_other(title: str, quantities: Sequence[QuantityFigures]) -> Grid:
    """A row a value; the interval of one that is stated as a quantity of its own behind it stands in its row."""
    rows, U = [("Quantity", "Value", "Unit", "U", "k", "u", "Interval")], None
    for before, quantity in zip((None, *quantities), quantities, strict=False):
        for value, unit, stated in zip(quantity.values, quantity.units, quantity.uncertainties, strict=True):
            again = before and before.values == quantity.values and quantity.name.startswith(f"{before.name}, ")
            U = U if again else stated.expanded
            interval = " to ".join(_printed(U, stated.low, stated.high)) if stated.low else stated.printed[3]
            if again:
                rows[-1] = (*rows[-1][:6], interval)
                continue
            shown, (k,) = _printed(U, value, U), _printed(stated.factor, stated.factor, digits=3)
            rows.append((quantity.shown, shown[0], unit_shown(unit), shown[1], k, stated.printed[2], interval))
        if not quantity.values:
            rows.append((quantity.shown, " ".join(quantity.words), "", "", "", "", ""))
    used = [i for i in range(len(rows[0])) if any(row[i] for row in rows[1:])]
    head, *rest = (tuple(row[i] for i in used) for row in rows)
    return Grid(title, head, tuple(rest))


def _printed(U: Decimal | None, *numbers: Decimal | None, digits: int = 2) -> list[str]:
    """Numbers as they are; beside U with a program's many digits, more than four, rounded as a certificate rounds them."""
    if U is None or len(U.normalize().as_tuple().digits) <= 4:
        return list(map(_text, numbers))
    return ["" if one is None else str.__str__(rounded(float(one), float(U), digits)[0]) for one in numbers]


def _columns(quantity: QuantityFigures) -> list[tuple[str, list[str]]]:
    """Of one quantity: labels, values, U with k, and u where it is given by itself."""
    if not quantity.values:
        return [(quantity.shown, list(quantity.words))]
    unit, values = "", [str(value) for value in quantity.values]
    if len(set(quantity.units)) != 1:
        values = [f"{v} {unit_shown(own)}".rstrip() for v, own in zip(values, quantity.units, strict=True)]
    elif quantity.units[0] and unit_shown(quantity.units[0]):
        unit = f" / {unit_shown(quantity.units[0])}"
    stated = zip(*(one.printed for one in quantity.uncertainties), strict=True)
    headings = (f"U{unit}", "k", f"u{unit}", f"interval{unit}")
    further = [(heading, list(cells)) for heading, cells in zip(headings, stated, strict=True) if any(cells)]
    labels = [(f"{quantity.shown}: label", list(quantity.labels))] if quantity.labels else []
    return [*labels, (f"{quantity.shown}{unit}", values), *further]


def _conformity(measurement: Measurement) -> Rows:
    return _rows(*(("Statement", _statement(statement)) for statement in statements(measurement)))


def _statement(statement: StatementMetadata) -> str:
    decisions = (f"conformity: {word}" for word in (statement.conformity, *statement.conformity_list) if word)
    return _joined(
        *(statement.name, *statement.norms, *statement.references, statement.convention, *decisions),
        *(statement.declaration, statement.description, statement.date, statement.period),
        None if statement.data is None else _sentence(of_data(statement.data, ())),
        by="; ",
    )


def _sentence(quantities: Iterable[QuantityFigures]) -> str:
    """Each quantity with its name."""
    return "; ".join(
        _joined(one.name, ", ".join(_value(one, i) for i in range(len(one.values))), *one.words, by=" ")
        for one in quantities
    )


def _value(quantity: QuantityFigures, i: int) -> str:
    stated, unit = quantity.uncertainties[i], unit_shown(quantity.units[i])
    if stated.low is not None and stated.high is not None:
        return f"{' to '.join(_printed((stated.high - stated.low) / 2, stated.low, stated.high))} {unit}".rstrip()
    value, U = _printed(stated.expanded, quantity.values[i], stated.expanded)
    return f"{value} {unit}".rstrip() + (f", U = {U} (k = {stated.factor:.3g})" if U else "")


def _certified(piece: Element) -> str:
    return piece.certificate and f"certificate {_hashed(piece.certificate)}"


def _identified(of: Element) -> list[str]:
    return [f"{_text(number.name) or number.issuer} {number.value}" for number in of.identifications]


def _hashed(chain: dcc.Hash | None) -> str:
    return "" if chain is None else chain.referral_id + f" ({chain.procedure} {chain.value})" * (chain.value != "none")


def _contact(contact: dcc.Contact) -> str:
    place = contact.location
    streets = (" ".join(pair) for pair in zip(place.street, place.street_number, strict=False))
    return _joined(contact.name, *streets, " ".join((*place.post_code, *place.city)), *place.country)
