"""What a DCC says, for a person: particulars in rows, results in tables, as plain text; and the same as data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from cmm_uq.base.units import UNITS
from cmm_uq.jobs.dcc.administrative import Contact, Hash, IdentificationNumber, Somebody, Words
from cmm_uq.jobs.dcc.certificate import Certificate, Measurement, StatementMetadata
from cmm_uq.jobs.dcc.figures import QuantityFigures, ValueUncertainty, figures, of_data, statements

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
    """A certificate for a person.

    rows : particulars.
    parts : title, rows and tables of each measurement.
    """

    rows: Rows
    parts: tuple[tuple[str, Rows, tuple[Grid, ...]], ...]


def shown(certificate: Certificate) -> CertificateView:
    return CertificateView(_particulars(certificate), tuple(_measured(one) for one in certificate.measurements))


def unit_shown(dsi: str) -> str:
    r"""A unit as printed: ``µm`` of ``\micro\metre``; in the notation of D-SI where it is not of the table."""
    return "" if dsi == r"\one" else _SYMBOLS.get(dsi, dsi)


def data(certificate: Certificate) -> dict[str, Any]:
    """The same as plain data; numbers as text, with the digits that the certificate has."""
    core, laboratory = certificate.administrative.core, certificate.administrative.laboratory
    return {
        "schema": "cmm-uq/dcc/1", "version": certificate.version, "number": core.identifier,
        "issued": None if core.issued is None else core.issued.isoformat(),
        "performed": [core.begin.isoformat(), core.end.isoformat()],
        "laboratory": str(laboratory.contact.name), "customer": str(certificate.administrative.customer.name),
        "particulars": [list(row) for row in _particulars(certificate)],
        "signed": bool(certificate.signatures),
        "quantities": [_quantity(one) for one in figures(certificate)],
        "statements": [
            {"measurement": str(measurement.name), "rows": [list(row) for row in _conformity(measurement)]}
            for measurement in certificate.measurements if _conformity(measurement)
        ],
    }  # fmt: skip


def _quantity(one: QuantityFigures) -> dict[str, Any]:
    covariance = None if one.covariance is None else {
        "matrix": [[_text(value) for value in row] for row in one.covariance[0]], "unit": one.covariance[1],
    }  # fmt: skip
    return {
        "place": list(one.place), "name": one.name, "ref_types": list(one.ref_types), "words": list(one.words),
        "values": [_text(value) for value in one.values], "units": list(one.units),
        "U": [_text(stated.expanded) for stated in one.uncertainties],
        "k": [_text(stated.factor) for stated in one.uncertainties],
        "p": [_text(stated.probability) for stated in one.uncertainties],
        "u": [None if stated.u is None else float(stated.u) for stated in one.uncertainties],
        "interval": [[_text(s.low), _text(s.high)] if s.low is not None else None for s in one.uncertainties],
        "covariance": covariance,
    }  # fmt: skip


def _text(value: Decimal | None) -> str | None:
    return None if value is None else str(value)


def _particulars(certificate: Certificate) -> Rows:
    own = certificate.administrative
    core, dates = own.core, (own.core.begin, own.core.end)
    performed = dates[0].isoformat() if dates[0] == dates[1] else f"{dates[0]} to {dates[1]}"
    replaced = "" if core.replaced is None else f"{core.replaced.identifier} ({core.replaced.change})"
    signed = f"{len(certificate.signatures)} (not verified here)" if certificate.signatures else "none in the file"
    items = [_item(str(item.name), item.model, item.identifications, item.manufacturer) for item in own.items.items]
    return _given((
        ("Certificate", core.identifier), ("Schema", f"DCC {certificate.version}"), ("Replaces", replaced),
        ("Previous report", _hashed(core.previous)), ("Laboratory", _contact(own.laboratory.contact)),
        ("Laboratory code", own.laboratory.code or ""), ("Customer", _contact(own.customer)),
        *(("Item", item) for item in items), ("Received", "" if core.received is None else core.received.isoformat()),
        ("Calibrated", performed), ("Issued", "" if core.issued is None else core.issued.isoformat()),
        ("Place", core.location.place), ("Languages", ", ".join(core.languages)),
        *(("Responsible", " ".join(filter(None, (str(one.person.name), one.role)))) for one in own.persons),
        *(("Statement", _statement(one)) for one in own.statements),
        ("Software", ", ".join(f"{one.name} {one.release}" for one in own.software)), ("Signatures", signed),
    ))  # fmt: skip


def _measured(measurement: Measurement) -> tuple[str, Rows, tuple[Grid, ...]]:
    equipment = () if measurement.equipment is None else measurement.equipment.equipment
    rows = _given((
        *(("Method", ", ".join(filter(None, (str(one.name), *one.norms, *one.references)))) for one in measurement.methods),
        *(("Equipment", _equipment(str(one.name), one.model, one.identifications, one.certificate)) for one in equipment),
        *(("Condition", _condition(str(one.name), [*of_data(one.data, ())])) for one in measurement.conditions),
        *_conformity(measurement),
    ))  # fmt: skip
    grids = tuple(_grid(str(result.name), [*of_data(result.data, ())]) for result in measurement.results)
    return str(measurement.name), rows, grids


def _grid(title: str, found: Sequence[QuantityFigures]) -> Grid:
    """Lists side by side, one that has fewer values in the first rows only; quantities of one value each below each other."""
    if len(found) > 1 and all(len(one.values) <= 1 for one in found):
        return _below_each_other(title, found)
    columns = [column for one in found for column in _columns(one)]
    count = max((len(cells) for _, cells in columns), default=0)
    rows = tuple(tuple(cells[i] if i < len(cells) else "" for _, cells in columns) for i in range(count))
    return Grid(title, tuple(heading for heading, _ in columns), rows)


def _below_each_other(title: str, found: Sequence[QuantityFigures]) -> Grid:
    rows = [("Quantity", "Value", "Unit", "U", "k", "u", "Interval")]
    for one in found:
        name = " / ".join(filter(None, (*one.place, one.name)))
        for value, unit, stated in zip(one.values, one.units, one.uncertainties, strict=True):
            told = (
                _text(stated.expanded) or "",
                _text(stated.factor) or "",
                _text(stated.standard) or "",
                _interval(stated),
            )
            rows.append((name, str(value), unit_shown(unit), *told))
        if not one.values:
            rows.append((name, " ".join(one.words), "", "", "", "", ""))
    kept = [i for i in range(len(rows[0])) if any(row[i] for row in rows[1:])]
    head, *rest = (tuple(row[i] for i in kept) for row in rows)
    return Grid(title, head, tuple(rest))


def _columns(one: QuantityFigures) -> list[tuple[str, list[str]]]:
    """Of one quantity: labels, values, U with k, and u where it is given by itself."""
    name = " / ".join(filter(None, (*one.place, one.name)))
    if not one.values:
        return [(name, list(one.words))]
    common = one.units[0] if len(set(one.units)) == 1 else None
    unit = f" / {unit_shown(common)}" if common and unit_shown(common) else ""
    values = [_with_unit(value, given, common) for value, given in zip(one.values, one.units, strict=True)]
    columns = [(f"{name}{unit}", values)]
    columns = [(f"{name}: label", list(one.labels)), *columns] if one.labels else columns
    stated = one.uncertainties
    for heading, cells in (
        ("U", [_text(each.expanded) or "" for each in stated]), ("k", [_text(each.factor) or "" for each in stated]),
        ("u", [_text(each.standard) or "" for each in stated]), ("interval", [_interval(each) for each in stated]),
    ):  # fmt: skip
        if any(cells):
            columns.append((f"{heading}{unit}" if heading != "k" else heading, cells))
    return columns


def _with_unit(value: Decimal, unit: str, common: str | None) -> str:
    return str(value) if common is not None else f"{value} {unit_shown(unit)}".rstrip()


def _interval(stated: ValueUncertainty) -> str:
    return "" if stated.low is None else f"{stated.low} to {stated.high}"


def _conformity(measurement: Measurement) -> Rows:
    return _given(("Statement", _statement(one)) for one in statements(measurement))


def _statement(one: StatementMetadata) -> str:
    verdicts = filter(None, (one.conformity, *one.conformity_list))
    said = (
        _words(one.name), *one.norms, *one.references, one.convention, *(f"conformity: {word}" for word in verdicts),
        "" if one.declaration is None else str(one.declaration), "" if one.description is None else str(one.description),
        "" if one.date is None else one.date.isoformat(), one.period,
        "" if one.data is None else _figures_told([*of_data(one.data, ())]),
    )  # fmt: skip
    return "; ".join(filter(None, said))


def _condition(name: str, found: Sequence[QuantityFigures]) -> str:
    return f"{name}: {_figures_told(found)}"


def _figures_told(found: Sequence[QuantityFigures]) -> str:
    """Each quantity with its name, as a sentence."""
    return "; ".join(
        " ".join(filter(None, (one.name, ", ".join(_value(one, i) for i in range(len(one.values))), *one.words)))
        for one in found
    )


def _value(one: QuantityFigures, i: int) -> str:
    stated, unit = one.uncertainties[i], unit_shown(one.units[i])
    U = "" if stated.expanded is None else f", U = {stated.expanded} (k = {stated.factor})"
    return f"{one.values[i]} {unit}".rstrip() + U


def _item(
    name: str, model: str | None, identifications: Iterable[IdentificationNumber], maker: Contact | Somebody | None
) -> str:
    return ", ".join(
        filter(None, (name, "" if maker is None else str(maker.name), model, *_identified(identifications)))
    )


def _equipment(
    name: str, model: str | None, identifications: Iterable[IdentificationNumber], chain: Hash | None
) -> str:
    certificate = "" if chain is None else f"certificate {_hashed(chain)}"
    return ", ".join(filter(None, (name, model, *_identified(identifications), certificate)))


def _identified(identifications: Iterable[IdentificationNumber]) -> list[str]:
    return [f"{_words(one.name) or one.issuer} {one.value}" for one in identifications]


def _hashed(chain: Hash | None) -> str:
    return "" if chain is None else f"{chain.referral_id} ({chain.procedure} {chain.value})"


def _contact(contact: Contact) -> str:
    place = contact.location
    where = () if place is None else (
        *(" ".join(pair) for pair in zip(place.street, place.street_number, strict=False)),
        " ".join((*place.post_code, *place.city)), *place.country,
    )  # fmt: skip
    return ", ".join(filter(None, (str(contact.name), *where)))


def _words(words: Words | None) -> str:
    return "" if words is None else str(words)


def _given(rows: Iterable[tuple[str, str]]) -> Rows:
    return tuple((label, text) for label, text in rows if text)
