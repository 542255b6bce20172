"""``[artefact.certificate] file``: what a digital certificate (DCC) of the artefact says, as if job.toml said it.

Number, laboratory and dates; the certified values of a kind with their uncertainties, U over k; of certified points (faces
of a step gauge, balls of a plate), which are joined to the recording elsewhere, the longest distance with its uncertainty.
What job.toml says too must say the same; a standard uncertainty may be larger there, never smaller.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import UNITS
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.dcc import Certificate, read
from cmm_uq.jobs.dcc.figures import QuantityFigures, figures
from cmm_uq.jobs.importing.documents import Dcc, heading
from cmm_uq.jobs.importing.format import Fact, Recognition
from cmm_uq.jobs.importing.recording import imported_references
from cmm_uq.jobs.tables import artefact as artefacts
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertificateFile, CertifiedValue, ReferencedFacts
from cmm_uq.jobs.tables.conformity import LINE_KEYS
from cmm_uq.jobs.tables.length_formula import Growing, growing_of, with_standard_uncertainty

_METRES = {unit.dsi: Decimal(str(unit.si)) for unit in UNITS.values() if unit.dsi.endswith(r"\metre")}
# parts of names, and of refTypes, of what is no certified value
_NO_RESULT = ("nominal", "nenn", "deviation", "abweichung", "error", "écart")
_RECALIBRATION = "basic_recalibration"  # what the good practice of DCC calls the statement of the next calibration
_TRACEABLE = "basic_metrologicallyTraceableToSI"  # and the statement of traceability
SAME = 1e-9  # relative difference of two numbers that say the same


@dataclass(frozen=True, eq=False)
class PointUncertainties:
    """Uncertainties of certified points by their numbers: (f,) standard uncertainties, µm, by column of the recording.

    ``covariances``: (f, f) µm², in the order of ``u``; none where the certificate gives none.
    """

    numbers: tuple[int, ...]
    u: Mapping[str, Floats]
    covariances: tuple[Floats, ...] = ()

    def beside(self, points: Points, artefact: ArtefactFacts) -> tuple[Points, ArtefactFacts]:
        """A recording of some of these points with their uncertainties, and the artefact with their covariances."""
        index = np.array([self.numbers.index(number) for number in points.point.tolist()], dtype=np.int64)
        columns = {**points.columns, **{name: values[index] for name, values in self.u.items()}}
        if self.covariances and isinstance(artefact, ReferencedFacts):
            artefact = artefact.with_covariances(self.numbers, self.covariances)
        return replace(points, columns=columns), artefact


@dataclass(frozen=True)
class CertifiedValues:
    """What a digital certificate says: keys of ``[artefact]``, those of its certificate in a table of their own.

    ``recognised``: how values that stand alone were read; ``places``: of points that are joined to the recording.
    """

    table: Mapping[str, Any]
    recognised: Recognition | None = None
    places: PointUncertainties | None = None
    test: Mapping[str, float] = field(default_factory=dict)  # keys of ``[test_uncertainty]``

    def beside(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """job.toml as it is, with what the certificate says."""
        given = data["artefact"]
        artefact = {**given, **{
            key: {**_table(given, key), **value} if isinstance(value, Mapping) else value
            for key, value in self.table.items()
        }}  # fmt: skip
        test = {"test_uncertainty": {**_table(data, "test_uncertainty"), **self.test}} if self.test else {}
        return {**data, "artefact": artefact, **test}


def certified(content: bytes, where: str, data: Mapping[str, Any], facts: type[ArtefactFacts]) -> CertifiedValues:
    """What the certificate of an artefact says that job.toml does not."""
    certificate, given = read(content, where), data["artefact"]
    table: dict[str, Any] = {"certificate": _chain(certificate, _table(given, "certificate"), where)}
    table |= _identity(certificate, given, where)
    if facts.with_references:
        further, places = _longest(certificate, content, where, given)
        return CertifiedValues(table | further, places=places)
    chosen = [(value, _chosen(value, certificate, given, where)) for value in facts.certified_values]
    values = [(value, quantity) for value, quantity in chosen if quantity is not None]
    if not values:
        raise CmmUqError(f"no certified value of a recording of kind {given.get('kind')!r} is read from a certificate",
                         where=where, fix="Leave file out, and give the keys of [artefact]")  # fmt: skip
    for value, quantity in values:
        for key, item in _valued(value, quantity, given, where).items():
            table[key] = {**table.get(key, {}), **item} if isinstance(item, Mapping) else item
    sources, count = {value.key: heading(one) for value, one in values}, sum(len(one.values) for _, one in values)
    number = Fact("certificate", say("Certificate"), Verbatim(certificate.administrative.core.identifier))
    name = where.replace("\\", "/").rpartition("/")[2]
    test: dict[str, float] = {}
    for value, one in values:
        test |= _of_test(value, one, _table(data, "test_uncertainty"), where)
    return CertifiedValues(table, Recognition(name, Dcc.name, Dcc.title, (number,), sources, count), test=test)


def _chain(certificate: Certificate, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    core, statements = certificate.administrative.core, certificate.administrative.statements
    due = next((one.date for one in statements if _RECALIBRATION in one.ref_type), None)
    if "issuer" in given and any(one.traceable is False for one in statements if _TRACEABLE in one.ref_type):
        raise CmmUqError("says itself that its results are not traceable to the SI", where=where,
                         fix="Leave issuer out of [artefact.certificate], or name another certificate")  # fmt: skip
    months = given.get("interval_months")
    if due is not None and type(months) is int and 1 <= months <= 600:
        until = artefacts.Traceability(date=core.issued or core.end, interval_months=months).until
        if until is not None and until > due:
            raise _contradicted("[artefact.certificate] interval_months", f"{months} (until {until})", due, where)
    says: dict[str, str | dt.date | None] = {
        "number": core.identifier, "laboratory": str(certificate.administrative.laboratory.contact.name),
        "date": core.issued or core.end, "due": None if "interval_months" in given else due,
        "accreditation": certificate.administrative.laboratory.code,
    }  # fmt: skip
    if "arrangement" not in given:
        national, others = {artefacts.CIPM}, {*get_args(artefacts.Arrangement)} - {artefacts.CIPM}
        arrangements = {artefacts.NATIONAL: national, artefacts.ACCREDITED: others}
        fitting = arrangements.get(str(given.get("issuer")), set())
        says["arrangement"] = next((one.convention for one in statements if one.convention in fitting), None)
    for key, value in says.items():
        if value and key in given and given[key] != value:
            raise _contradicted(f"[artefact.certificate] {key}", given[key], value, where)
    return {key: value for key, value in says.items() if value and key not in given}


def _identity(certificate: Certificate, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Name and serial number, where the certificate is of one item; one that has another number is another's certificate."""
    items = certificate.administrative.items.items
    numbers = [one.value for item in items for one in item.identifications]
    if given.get("serial") and given["serial"] not in numbers:
        raise CmmUqError(f"is of an item with the numbers {', '.join(numbers)}, and [artefact] serial = {given['serial']!r}",
                         where=where, fix="Name the certificate of this artefact, or mend its serial number")  # fmt: skip
    own = [one.value for one in items[0].identifications if one.issuer == "manufacturer"] if len(items) == 1 else []
    says = {"name": str(items[0].name) if len(items) == 1 else "", "serial": own[0] if len(own) == 1 else ""}
    return {key: value for key, value in says.items() if value and not given.get(key)}


def _chosen(
    value: CertifiedValue, certificate: Certificate, given: Mapping[str, Any], where: str
) -> QuantityFigures | None:
    """The quantity of a key: the one that job.toml names, else the only one that is called so."""
    outer = value.key.rpartition(".")[0]
    if outer and not isinstance(given.get(outer), Mapping):
        return None
    every = [one for one in figures(certificate) if one.values and all(unit in _METRES for unit in one.units)]
    named = _table(_table(given, "certificate"), "columns").get(value.key)
    if isinstance(named, str):
        chosen = [one for one in every if named in (one.name, heading(one), one.id, one.shown)]
    else:
        chosen = [one for one in every if len(one.values) == value.count and _called(one, value)]
    if len(chosen) == 1 and len(chosen[0].values) == value.count:
        return chosen[0]
    if not chosen and not value.needed:
        return None
    listed = ", ".join(repr(one.shown) for one in (chosen or every)) or "no quantity that is a length"
    many = f"{len(chosen)} quantities" if len(chosen) > 1 else "no one quantity"
    raise CmmUqError(
        f"has {many} for [artefact] {value.key} ({value.count} {'value' if value.count == 1 else 'values'}): {listed}",
        where=where, fix=f'Say which: certificate.columns = {{ "{value.key}" = "name of the quantity" }}',
    )  # fmt: skip


def _called(quantity: QuantityFigures, value: CertifiedValue) -> bool:
    """Whether it goes by a name of the value; a deviation is a certified value of a form only."""
    name = " ".join((*quantity.place[2:], quantity.name, *quantity.ref_types)).casefold()
    other = () if value.micrometres else _NO_RESULT
    return any(word in name for word in value.words) and not any(word in name for word in other)


def _valued(value: CertifiedValue, quantity: QuantityFigures, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Key and uncertainty, where the job does not have them."""
    outer, _, key = value.key.rpartition(".")
    stated = _table(given, outer) if outer else given
    scale = Decimal(1_000_000 if value.micrometres else 1000)
    pairs = zip(quantity.values, quantity.units, strict=True)
    numbers = [float(number * _METRES[unit] * scale) for number, unit in pairs]
    table: dict[str, Any] = {key: numbers if value.count > 1 else numbers[0]}
    if key in stated:
        listed = list(stated[key]) if isinstance(stated[key], (list, tuple)) else [stated[key]]
        both = zip(listed, numbers, strict=False)
        same = (isinstance(a, (int, float)) and math.isclose(a, b, rel_tol=SAME) for a, b in both)
        if not all(same) or len(listed) != len(numbers):
            raise _contradicted(f"[artefact] {value.key}", stated[key], table[key], where)
        table = {}
    if value.u_key:
        u_um = _largest_u_um(quantity)
        longest = max(numbers) if not value.micrometres else 0.0
        u_key, shown = value.u_key.rpartition(".")[2], f"[artefact] {value.u_key}"
        table |= _uncertain(u_key, u_um, stated, where, shown, quantity.shown, longest)
    return {outer: table} if outer else table


def _largest_u_um(quantity: QuantityFigures) -> float | None:
    """Of its values; none where one has none."""
    us = [each.normal_u for each in quantity.uncertainties]
    largest = [u * _METRES[unit] for u, unit in zip(us, quantity.units, strict=True) if u is not None]
    return float(max(largest) * 1_000_000) if len(largest) == len(us) else None


def _of_test(value: CertifiedValue, one: QuantityFigures, test: Mapping[str, Any], where: str) -> dict[str, float]:
    """What a test value is uncertain by that the certificate says, where the job does not."""
    u_um = _largest_u_um(one) if value.line else None
    if not u_um:
        return {}
    if _table(test, "negligible").get(value.line):
        problem = f"states a standard uncertainty of {u_um:g} µm of {one.shown}, declared negligible in job.toml"
        fix = f"Leave {value.line} out of [test_uncertainty.negligible]"
        raise CmmUqError(problem, where=where, fix=fix)
    key = LINE_KEYS[value.line]
    return _uncertain(key, u_um, test, where, f"[test_uncertainty] {key}", one.shown)


def _uncertain(
    key: str, u_um: float | None, given: Mapping[str, Any], where: str, shown: str, what: str, length_mm: float = 0.0
) -> dict[str, float]:
    """The uncertainty, where the job has none; what it has must not be smaller."""
    try:
        own = with_standard_uncertainty(dict(given)).get(key)
        own = growing_of(own) if isinstance(own, str) else own
    except ValueError:
        return {}  # what is wrong with it is said where the table is checked
    if own is None:
        if u_um is None:
            raise CmmUqError(f"states no uncertainty of {what}", where=where, fix=f"Give {shown}")
        return {key: u_um}
    own = float(own.at(length_mm)) if isinstance(own, Growing) else own
    if u_um is not None and isinstance(own, (int, float)) and own < u_um * (1 - SAME):
        raise CmmUqError(f"{shown} = {own:g} is smaller than the standard uncertainty {u_um:g} µm of {what}", where=where,
                         fix="Leave it out: the certificate says it")  # fmt: skip
    return {}


def _longest(
    certificate: Certificate, content: bytes, where: str, given: Mapping[str, Any]
) -> tuple[dict[str, Any], PointUncertainties | None]:
    """Longest certified distance of points that are joined to the recording by their numbers, and their uncertainties."""
    try:
        keys = CertificateFile.model_validate(dict(_table(given, "certificate")))
    except ValidationError:
        return {}, None  # what is wrong with it is said where the table is checked
    found = imported_references(content, where, keys)
    sources = found.recognised.columns
    wanted = [name for name in ("reference_mm", *(f"reference_{axis}_mm" for axis in AXES)) if name in found.columns]
    headings = [sources.get(name) or sources.get(name.removeprefix("reference_")) for name in wanted]
    held = [one for head in headings for one in figures(certificate) if heading(one) == head]
    in_metres = all(unit in _METRES for one in held for unit in one.units)
    every = [stated.u is not None for one in held for stated in one.uncertainties]
    known = len(held) == len(wanted) and all(every) and in_metres
    if any(every) and not all(every):
        raise CmmUqError("states an uncertainty of some of its points and none of others", where=where,
                         fix="Ask the laboratory for all, or give the values as a CSV with U_um in [artefact]")  # fmt: skip
    if given.get("nominal") or not known:
        return {}, None
    places = _places(found.columns.get("point"), wanted, held)
    if "length_mm" in given:
        return {}, places  # what is stated of another length cannot be compared
    if all(len(set(one.values)) == 1 for one in held):
        problem = "certifies no distance: all its points are in one place"
        raise CmmUqError(problem, where=where, fix="Is it the right file?")
    length, u_um = _farthest(held)
    _uncertain("u_um", u_um, given, where, "[artefact] u_um", "its longest distance", length)
    return {"length_mm": length}, places


def _places(point: Floats | None, wanted: Sequence[str], held: Sequence[QuantityFigures]) -> PointUncertainties | None:
    """What the certificate says of its points, which the recording numbers in the same way."""
    if point is None or any(len(one.values) != len(point) for one in held):
        return None
    scales = [np.array([float(_METRES[unit]) * 1e6 for unit in one.units]) for one in held]
    stated = [np.array([float(each.normal_u or 0) for each in one.uncertainties]) for one in held]
    names = (name.replace("reference_", "reference_u_").replace("mm", "um") for name in wanted)
    u = {name: scale * own for name, scale, own in zip(names, scales, stated, strict=True)}
    matrices = [one.covariance[0] for one in held if one.covariance is not None]
    whole = len(matrices) == len(held) and all(len(matrix) == len(point) for matrix in matrices)
    covariances = tuple(
        np.outer(scale, scale) * np.array([[float(value) for value in row] for row in matrix])
        for matrix, scale in zip(matrices if whole else (), scales, strict=whole)
    )
    return PointUncertainties(tuple(int(number) for number in point), u, covariances)


def _farthest(columns: Sequence[QuantityFigures]) -> tuple[float, float]:
    """Distance of the point that is farthest from the first, mm, and its standard uncertainty, µm.

    Of coordinates without covariances each is taken as independent of the others, which is what the certificate says.
    """
    points = list(zip(*([float(v * _METRES[u] * 1000) for v, u in zip(one.values, one.units, strict=True)] for one in columns),
                      strict=True))  # fmt: skip
    last = max(range(len(points)), key=lambda i: math.dist(points[i], points[0]))
    length = math.dist(points[last], points[0])
    along = [(end - start) / length for start, end in zip(points[0], points[last], strict=True)]
    variance = sum(part**2 * _variance_of_difference(one, last) for part, one in zip(along, columns, strict=True))
    return length, math.sqrt(max(variance, 0.0))


def _variance_of_difference(one: QuantityFigures, last: int) -> float:
    """Of the last value minus the first, µm²."""
    scale = [float(_METRES[unit]) * 1e6 for unit in one.units]
    first, other = (float(one.uncertainties[i].normal_u or 0) * scale[i] for i in (0, last))
    common = 0.0
    if one.covariance is not None and len(one.covariance[0]) > last:
        common = float(one.covariance[0][0][last]) * scale[0] * scale[last]
    return first**2 + other**2 - 2 * common


def _table(given: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = given.get(key)
    return found if isinstance(found, Mapping) else {}


def _contradicted(key: str, given: object, says: object, where: str) -> CmmUqError:
    return CmmUqError(f"{key} = {given} in job.toml, and {says} in the certificate", where=where,
                      fix="Leave the key out: the certificate says it; or name the right certificate")  # fmt: skip
