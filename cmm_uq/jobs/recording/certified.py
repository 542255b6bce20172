"""``[artefact.certificate] file``: what a digital certificate (DCC) of the artefact says, as if job.toml said it.

Number, laboratory and dates; the certified values of a kind with their uncertainties, U over k; of certified points (faces
of a step gauge, balls of a plate), which are joined to the recording elsewhere, the longest distance with its uncertainty.
What job.toml says too must say the same; a standard uncertainty may be larger there, never smaller.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import UNITS
from cmm_uq.jobs.dcc import Certificate, read
from cmm_uq.jobs.dcc.figures import QuantityFigures, figures
from cmm_uq.jobs.importing.dcc import Dcc, heading
from cmm_uq.jobs.importing.imported import imported_references
from cmm_uq.jobs.importing.keys import FileKeys
from cmm_uq.jobs.importing.sheet import Fact, Recognition
from cmm_uq.jobs.tables.artefact import (
    ACCREDITED,
    CIPM,
    NATIONAL,
    Arrangement,
    ArtefactFacts,
    CertificateFile,
    CertifiedValue,
    ReferencedFacts,
)
from cmm_uq.jobs.tables.length_formula import Growing, growing_of, with_standard_uncertainty

_METRES = {unit.dsi: Decimal(str(unit.si)) for unit in UNITS.values() if unit.dsi.endswith(r"\metre")}
_NO_RESULT = ("nominal", "nenn", "deviation", "abweichung", "error", "écart")
"""Parts of names, and of refTypes, of what is no certified value."""

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

    def beside(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """``[artefact]`` as job.toml has it, with what the certificate says."""
        return {**given, **{
            key: {**_table(given, key), **value} if isinstance(value, Mapping) else value
            for key, value in self.table.items()
        }}  # fmt: skip


def certified(content: bytes, where: str, given: Mapping[str, Any], facts: type[ArtefactFacts]) -> CertifiedValues:
    """What the certificate of an artefact says that job.toml does not."""
    certificate = read(content, where)
    table: dict[str, Any] = {"certificate": _chain(certificate, _table(given, "certificate"), where)}
    table |= _identity(certificate, given, where)
    if facts.with_references:
        further, places = _longest(certificate, content, where, given)
        return CertifiedValues(table | further, places=places)
    found = [
        (wanted, one)
        for wanted in facts.certified_values
        if (one := _found(wanted, certificate, given, where)) is not None
    ]
    if not found:
        raise CmmUqError(f"no certified value of a recording of kind {given.get('kind')!r} is read from a certificate",
                         where=where, fix="Leave file out, and give the keys of [artefact]")  # fmt: skip
    for wanted, one in found:
        _merge(table, _valued(wanted, one, given, where))
    sources = {wanted.key: heading(one) for wanted, one in found}
    facts_told = (Fact("certificate", say("Certificate"), Verbatim(certificate.administrative.core.identifier)),)
    name = where.replace("\\", "/").rpartition("/")[2]
    return CertifiedValues(
        table, Recognition(name, Dcc.name, Dcc.title, facts_told, sources, sum(len(one.values) for _, one in found))
    )


def _chain(certificate: Certificate, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    core, statements = certificate.administrative.core, certificate.administrative.statements
    due = next((one.date for one in statements if _RECALIBRATION in one.ref_type), None)
    if "issuer" in given and any(one.traceable is False for one in statements if _TRACEABLE in one.ref_type):
        raise CmmUqError("says itself that its results are not traceable to the SI", where=where,
                         fix="Leave issuer out of [artefact.certificate], or name another certificate")  # fmt: skip
    says: dict[str, str | dt.date | None] = {
        "number": core.identifier, "laboratory": str(certificate.administrative.laboratory.contact.name),
        "date": core.issued or core.end, "due": None if "interval_months" in given else due,
        "accreditation": certificate.administrative.laboratory.code,
    }  # fmt: skip
    if "arrangement" not in given:
        fitting = {NATIONAL: {CIPM}, ACCREDITED: {*get_args(Arrangement)} - {CIPM}}.get(str(given.get("issuer")), set())
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


def _found(
    wanted: CertifiedValue, certificate: Certificate, given: Mapping[str, Any], where: str
) -> QuantityFigures | None:
    """The quantity of a key: the one that job.toml names, else the only one that is called so."""
    outer = wanted.key.rpartition(".")[0]
    if outer and not isinstance(given.get(outer), Mapping):
        return None
    every = [one for one in figures(certificate) if one.values and all(unit in _METRES for unit in one.units)]
    named = _table(_table(given, "certificate"), "columns").get(wanted.key)
    if isinstance(named, str):
        chosen = [one for one in every if named in (one.name, heading(one), one.id, one.shown)]
    else:
        chosen = [one for one in every if len(one.values) == wanted.count and _called(one, wanted)]
    if len(chosen) == 1 and len(chosen[0].values) == wanted.count:
        return chosen[0]
    if not chosen and not wanted.needed:
        return None
    listed = ", ".join(repr(one.shown) for one in (chosen or every)) or "no quantity that is a length"
    many = f"{len(chosen)} quantities" if len(chosen) > 1 else "no one quantity"
    raise CmmUqError(
        f"has {many} for [artefact] {wanted.key} ({wanted.count} {'value' if wanted.count == 1 else 'values'}): {listed}",
        where=where, fix=f'Say which: certificate.columns = {{ "{wanted.key}" = "name of the quantity" }}',
    )  # fmt: skip


def _called(one: QuantityFigures, wanted: CertifiedValue) -> bool:
    """Whether it goes by a name of what is wanted; a deviation is a certified value of a form only."""
    name = " ".join((*one.place[2:], one.name, *one.ref_types)).casefold()
    other = () if wanted.micrometres else _NO_RESULT
    return any(word in name for word in wanted.words) and not any(word in name for word in other)


def _valued(wanted: CertifiedValue, one: QuantityFigures, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Key and uncertainty, where the job does not have them."""
    outer, _, key = wanted.key.rpartition(".")
    own = _table(given, outer) if outer else given
    scale = Decimal(1_000_000 if wanted.micrometres else 1000)
    values = [float(value * _METRES[unit] * scale) for value, unit in zip(one.values, one.units, strict=True)]
    value = values if wanted.count > 1 else values[0]
    table = {} if key in own else {key: value}
    if key in own and not _same(own[key], value):
        raise _contradicted(f"[artefact] {wanted.key}", own[key], value, where)
    if wanted.u_key:
        u_key = wanted.u_key.rpartition(".")[2]
        longest = max(values) if not wanted.micrometres else 0.0
        table |= _uncertain(u_key, _u_um(one), own, where, f"[artefact] {wanted.u_key}", one.shown, longest)
    return {outer: table} if outer else table


def _u_um(one: QuantityFigures) -> float | None:
    """Largest standard uncertainty of a quantity, µm; none where one value has none."""
    found = [stated.u for stated in one.uncertainties]
    if any(u is None for u in found):
        return None
    return float(max(u * _METRES[unit] for u, unit in zip(found, one.units, strict=True) if u is not None) * 1_000_000)


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
    found = imported_references(
        content, where, FileKeys.model_validate({name: getattr(keys, name) for name in FileKeys.model_fields})
    )
    sources = found.recognised.columns
    wanted = [name for name in ("reference_mm", *(f"reference_{axis}_mm" for axis in AXES)) if name in found.columns]
    headings = [sources.get(name) or sources.get(name.removeprefix("reference_")) for name in wanted]
    held = [one for head in headings for one in figures(certificate) if heading(one) == head]
    known = len(held) == len(wanted) and all(
        stated.u is not None and unit in _METRES
        for one in held
        for stated, unit in zip(one.uncertainties, one.units, strict=True)
    )
    every = [stated.u is not None for one in held for stated in one.uncertainties]
    if any(every) and not all(every):
        raise CmmUqError("states an uncertainty of some of its points and none of others", where=where,
                         fix="Ask the laboratory for all, or give the values as a CSV with U_um in [artefact]")  # fmt: skip
    if given.get("nominal") or not known:
        return {}, None
    places = _places(found.columns.get("point"), wanted, held)
    if "length_mm" in given:
        return {}, places  # what is stated of another length cannot be compared
    if all(len(set(one.values)) == 1 for one in held):
        raise CmmUqError(
            "certifies no distance: all its points are in one place", where=where, fix="Is it the right file?"
        )
    length, u_um = _farthest(held)
    _uncertain("u_um", u_um, given, where, "[artefact] u_um", "its longest distance", length)
    return {"length_mm": length}, places


def _places(point: Floats | None, wanted: Sequence[str], held: Sequence[QuantityFigures]) -> PointUncertainties | None:
    """What the certificate says of its points, which the recording numbers in the same way."""
    if point is None or any(len(one.values) != len(point) for one in held):
        return None
    scales = [np.array([float(_METRES[unit]) * 1e6 for unit in one.units]) for one in held]
    names = ["reference_u_um" if name == "reference_mm" else name.replace("reference_", "reference_u_").replace("_mm", "_um")
             for name in wanted]  # fmt: skip
    u = {
        name: scale * np.array([float(stated.u or 0) for stated in one.uncertainties])
        for name, one, scale in zip(names, held, scales, strict=True)
    }
    whole = all(one.covariance is not None and len(one.covariance[0]) == len(point) for one in held)
    covariances = tuple(
        np.outer(scale, scale) * np.array([[float(value) for value in row] for row in one.covariance[0]])
        for one, scale in zip(held, scales, strict=True)
        if whole and one.covariance is not None
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
    variance = sum(
        ((points[last][axis] - points[0][axis]) / length) ** 2 * _variance_of_difference(one, last)
        for axis, one in enumerate(columns)
    )
    return length, math.sqrt(max(variance, 0.0))


def _variance_of_difference(one: QuantityFigures, last: int) -> float:
    """Of the last value minus the first, µm²."""
    scale = [float(_METRES[unit]) * 1e6 for unit in one.units]
    first, other = (float(one.uncertainties[i].u or 0) * scale[i] for i in (0, last))
    common = 0.0
    if one.covariance is not None and len(one.covariance[0]) > last:
        common = float(one.covariance[0][0][last]) * scale[0] * scale[last]
    return first**2 + other**2 - 2 * common


def _table(given: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = given.get(key)
    return found if isinstance(found, Mapping) else {}


def _merge(table: dict[str, Any], further: Mapping[str, Any]) -> None:
    for key, value in further.items():
        table[key] = {**table.get(key, {}), **value} if isinstance(value, Mapping) else value


def _same(one: object, other: object) -> bool:
    return all(
        isinstance(a, (int, float)) and math.isclose(a, b, rel_tol=SAME)
        for a, b in zip(_listed(one), _listed(other), strict=False)
    ) and len(_listed(one)) == len(_listed(other))


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]


def _contradicted(key: str, given: object, says: object, where: str) -> CmmUqError:
    return CmmUqError(f"{key} = {given} in job.toml, and {says} in the certificate", where=where,
                      fix="Leave the key out: the certificate says it; or name the right certificate")  # fmt: skip
