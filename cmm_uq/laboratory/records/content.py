"""What is recorded of one report: taken from its job and its results.json, as one canonical content."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import UNITS
from cmm_uq.jobs.job import JobFile
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records.facts import KEY, PART, PERFORMANCE, ChainHead

if TYPE_CHECKING:
    from cmm_uq.jobs.part.tables import PartFile

Named = Callable[[str], str]  # how a value is called in the field, by its name: ``scale_x.ppm``

_UNIT_OF = (
    ("arcsec_per_m_k", "″/(m·K)"), ("arcsec_per_m", "″/m"), ("um_per_m", "µm/m"), ("um_per_h", "µm/h"), ("ppm_per_h", "ppm/h"),
    ("per_k", "1/K"), ("arcsec", "″"), ("ppm", "ppm"), ("um", "µm"), ("mm", "mm"), ("rad", "rad"), ("deg", "°"), ("_c", "°C"),
    ("_k", "K"), ("_s", "s"), ("arcsec_per_m_kg", "″/(m·kg)"),
)  # fmt: skip
"""Ends of names in results.json, and their units."""

FIGURE, ARTEFACT = "accuracy.", "artefact."


def certificate_content(
    data: Mapping[str, Any],
    facts: JobFile | PartFile | None,
    *,
    command: str,
    folder: str,
    results_sha256: str,
    files: Mapping[str, str],
    named: Named,
) -> dict[str, Any]:
    """Content of the entry of a report, of a part too, or a diagnosis; ``facts``: ``None`` where only results.json is left."""
    try:
        job, verdicts = data["job"], Verdicts.of_results(data)
        stated = _of_part(data) if command == PART else _of_results(job)
        # keys of what ISO/IEC 17025:2017, 7.8 asks for and the certificate does not state
        head = ChainHead.of_results(data)
        missing = [str(one["key"]) for one in data.get("iso17025") or () if one["status"] == "missing"]
        return {
            "command": command, "job": str(job["id"]), "origin": str(job["origin"]), "day": str(job["date"]),
            **stated, **(_of_job(facts) if facts else {}),
            "decision": verdicts.overall, **({"verdicts": verdicts.data()} if verdicts else {}),
            "diagnosis": str((data.get("diagnosis") or {}).get("verdict") or ""),
            "version": str((data.get("software") or {}).get("version") or ""), "folder": folder,
            "results_sha256": results_sha256, "files": dict(files), "inputs": dict(job.get("inputs_sha256") or {}),
            "values": values(data, named), "covariance": covariance(data), **({"missing": missing} if missing else {}),
            **({KEY: head.data} if head else {}),
        }  # fmt: skip
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise CmmUqError(f"is no results.json of a job: {error!r}", where=folder) from error


def kind_of_entry(content: Mapping[str, Any]) -> str:
    """Whether a content is of an interim check, of a part's report or of another."""
    return PART if content["command"] == PART else "check" if content.get("interim") else "report"


def values(data: Mapping[str, Any], named: Named) -> list[list[Any]]:
    """Estimates, sizes, figures and performances: name, quantity, unit, value, u, lower, upper, u_artefact, limit."""
    common = _of_the_artefact(data)
    units = dict(zip(*((data.get("covariance") or {}).get(key) or () for key in ("parameters", "units")), strict=False))
    tolerances = data.get("tolerances") or {}
    found: list[list[Any]] = []
    for name, quantity in _quantities(data):
        owner, _, own = name.partition(".")
        limit = (tolerances.get(owner) or {}).get(own)
        found += _row(name, named(name), units.get(name) or unit_of(own), quantity, common.get(name, 0.0), limit)
    return [*found, *_performances(data)]


def covariance(data: Mapping[str, Any]) -> dict[str, Any] | None:
    """Names, and the lower triangle row by row."""
    given = data.get("covariance") or {}
    matrix = given.get("matrix") or ()
    lower = [matrix[i][j] for i in range(len(matrix)) for j in range(i + 1)]
    if "parameters" not in given or not lower or not all(_finite(element) for element in lower):
        return None  # characteristics of a part are no values of its machine
    return {"names": list(given["parameters"]), "lower": lower}


def unit_of(name: str) -> str:
    """The unit that a name of results.json ends with; 1 where it ends with none."""
    return next((unit for end, unit in _UNIT_OF if name.endswith(end) and unit in UNITS), "1")


def _of_job(facts: JobFile | PartFile) -> dict[str, Any]:
    laboratory = facts.laboratory
    persons = {"operator": facts.job.operator or laboratory.signatory, "four_eyes": laboratory.four_eyes}
    if not isinstance(facts, JobFile):
        return persons | {"points": facts.recording.recorded if facts.recording else ""}
    job, machine, artefact = facts.job, facts.machine, facts.artefact
    chain = artefact.certificate
    return persons | {
        "number": job.number or job.id,
        "machine": {
            "serial": machine.serial, "name": machine.name, "manufacturer": machine.manufacturer, "model": machine.model,
            "place": job.place,
            "calibrate": machine.calibrate.model_dump(exclude_none=True) if machine.calibrate else None,
        },
        "artefact": {
            "serial": artefact.serial, "name": artefact.name, "certificate": chain.number if chain else "",
            "laboratory": chain.laboratory if chain else "", "calibrated": _iso(chain.date if chain else None),
            "due": _iso(chain.until if chain else None),
        },
        "kind": artefact.kind, "adjusted_since": _iso(job.adjusted_since), "interim": job.interim,
    }  # fmt: skip


def _of_results(job: Mapping[str, Any]) -> dict[str, Any]:
    machine = {"serial": str(job.get("serial") or ""), "name": str(job["machine"])}
    return {
        "number": str(job["id"]), "machine": {**machine, "manufacturer": "", "model": "", "place": ""},
        "artefact": {}, "kind": "", "adjusted_since": None, "interim": bool(job.get("interim")), "operator": "",
        "four_eyes": False,
    }  # fmt: skip


def _of_part(data: Mapping[str, Any]) -> dict[str, Any]:
    """Of the report of a part: which part, by which plan, machine and certificate of it; hashes are with the inputs."""
    job, part, by = data["job"], data["part"], data["machine"]
    return _of_results({**job, "machine": by["machine"], "serial": by["serial"]}) | {
        "number": str(job.get("number") or job["id"]),
        "part": {name: str(part[name] or "") for name in ("name", "serial", "drawing")},
        "plan": "job.toml",
        "measured": any(one["value"] is not None for one in data["characteristics"]),
        "certificate": {
            "number": str(by["number"] or ""),
            "laboratory": str(by["laboratory"] or ""),
            "calibrated": str(by["date"]),
            "due": by["valid_until"] and str(by["valid_until"]),
            "files": list(map(str, by["files"])),
        },
    }


def _quantities(data: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for effect, parameters in (data.get("estimates") or {}).items():
        for parameter, quantity in parameters.items():
            yield f"{effect}.{parameter}", quantity
    for size, quantity in (data.get("artefact") or {}).items():
        if isinstance(quantity, Mapping):
            yield ARTEFACT + size, quantity
    for figure, quantity in (data.get("accuracy_uncertainty") or {}).items():
        yield FIGURE + figure, quantity


def _row(
    name: str, quantity: str, unit: str, stated: Mapping[str, Any], common: float, limit: float | None
) -> list[list[Any]]:
    """None where there is no estimate: what the recording does not determine has no value."""
    if not all(_finite(stated.get(key)) for key in ("value", "u")):
        return []
    value, u = float(stated["value"]), float(stated["u"])
    interval = stated.get("interval95")
    ends = interval if isinstance(interval, Sequence) and len(interval) == 2 and all(map(_finite, interval)) else None
    lower, upper = ends or (value - 2 * u, value + 2 * u)
    at_most = None if limit is None else float(limit)
    return [[name, quantity, unit, value, u, float(lower), float(upper), min(common, u), at_most]]


def _performances(data: Mapping[str, Any]) -> Iterator[list[Any]]:
    taken: set[str] = set()
    for statement in data.get("conformity") or ():
        title = str(statement.get("characteristic") or statement["standard"])
        name = PERFORMANCE + title
        if name in taken:
            name = f"{name} ({statement['standard']})"
        value, u, limit = (statement.get(key) for key in ("value_um", "u_um", "limit_um"))
        if name in taken or not (_finite(value) and _finite(u)):
            continue
        taken.add(name)
        worst = {"value": value, "u": u, "interval95": (value - 2 * u, value + 2 * u)}
        said = f"{title}: {statement.get('quantity') or ''}".rstrip(": ")
        budget = (statement.get("test_uncertainty") or {}).get("budget") or ()
        parts = [row.get("contribution") for row in budget if row.get("source") == "certificate"]
        certified = math.hypot(*(float(part) for part in parts if _finite(part)))
        yield from _row(name, said, "µm", worst, certified, limit if _finite(limit) else None)


def _of_the_artefact(data: Mapping[str, Any]) -> dict[str, float]:
    """Of each parameter, the part of its u that the sizes explain: √(cᵀ V⁻¹ c), c its covariances with them, V theirs."""
    given = data.get("covariance") or {}
    names = list(given.get("parameters") or ())
    certified = [ARTEFACT + size for size in data.get("certified") or {}]
    sizes = [names.index(name) for name in certified if name in names]
    if not sizes:
        return {}
    matrix = np.array(given["matrix"], dtype=float)
    if not np.isfinite(matrix).all():
        return {}
    inverse = np.linalg.pinv(matrix[np.ix_(sizes, sizes)], hermitian=True)
    variances = np.einsum("ij,jk,ik->i", matrix[:, sizes], inverse, matrix[:, sizes])
    return {name: float(np.sqrt(max(0.0, variance))) for name, variance in zip(names, variances, strict=True)}


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _iso(day: dt.date | None) -> str | None:
    return None if day is None else day.isoformat()


def folder_from(home: Path | None, folder: Path) -> str:
    """A folder as it is recorded: relative to the records beside it, so that both can be moved together."""
    whole = folder.absolute()
    if home is not None and whole.is_relative_to(home):
        return whole.relative_to(home).as_posix()
    return str(whole)
