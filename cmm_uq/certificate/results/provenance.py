"""`provenance.json`: from what a certificate was made, by what, and on what, in the words of W3C PROV (PROV-JSON).

Files are entities with their SHA-256, the recording and the report are activities, the program and the laboratory agents.
PROV was chosen, and not RO-Crate, because it says how a result came about, which is what is asked here, and because its
file may have any name and lie in a PDF; an RO-Crate is a folder.

No clock is read: dates are those of the job. The platform stands here and nowhere else, so the PDF that carries this file is
the same to the byte on the same installation only, and on any with this very file in it; ``results.json`` is the same on all.
The provenance cannot have the hash of the PDF that it lies in; the manifest beside both has it.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import quote

from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import Identification, Laboratory

PACKAGES = ("emcee", "jinja2", "matplotlib", "numpy", "pandas", "pydantic", "scipy", "typst")
"""Those that a figure, or a page that shows it, rests on."""

_CORE = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")
"""What the library of linear algebra in the packages of NumPy calls the question for its kernels."""


@cache
def packages() -> dict[str, str]:
    """Versions, by name; without those that are not installed as packages."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def machine() -> dict[str, str]:
    """Python, operating system and processor by kind, library and kernels of linear algebra; nothing that names a machine."""
    import numpy as np

    told: Mapping[str, Any] = np.show_config(mode="dicts") or {}
    blas = told.get("Build Dependencies", {}).get("blas", {})
    return {
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": platform.system(),
        "processor": platform.machine(),
        "instructions": " ".join(sorted(map(str, told.get("SIMD Extensions", {}).get("found", ())))),
        "blas": " ".join(str(blas[key]) for key in ("name", "version") if blas.get(key)),
        "kernels": _kernels(),
    }


def _kernels() -> str:
    """For which processor the library of linear algebra chose its kernels; empty where it does not say."""
    import ctypes

    from numpy.linalg import _umath_linalg

    try:
        library = ctypes.CDLL(_umath_linalg.__file__)
    except OSError:
        return ""
    for name in _CORE:
        if (asked := getattr(library, name, None)) is not None:
            asked.restype = ctypes.c_char_p
            return (asked() or b"").decode("ascii", "replace")
    return ""


FILE = "provenance.json"
PLATFORM = "cmm-uq:platform"
_PREFIX = "urn:cmm-uq:"
_RECORDING, _REPORT, _PROGRAM, _LABORATORY = "cmm-uq:recording", "cmm-uq:report", "cmm-uq:program", "cmm-uq:laboratory"
_CERTIFICATE, _REPLACED, _ARTEFACT = "cmm-uq:certificate", "cmm-uq:replaced", "cmm-uq:artefact-certificate"
Record = dict[str, Any]


@dataclass(frozen=True)
class Behind:
    """What is behind a certificate, of whatever.

    ``command``: of ``cmm-uq`` that made it; ``said, laboratory``: as its job has them; ``origin``: of the recording;
    ``inputs``: of the job, by name; ``recording``: its file; empty where there is none; ``rests_on``: number and
    laboratory of the certificate that it goes by, of the artefact or of the machine; empty for none.
    """

    command: str
    said: Identification
    laboratory: Laboratory
    origin: str
    inputs: Mapping[str, bytes]
    recording: str
    rests_on: tuple[str, str] = ("", "")

    @classmethod
    def of(cls, job: Job) -> Behind:
        facts, chain = job.facts, job.facts.artefact.certificate
        known = ("", "") if chain is None else (chain.number, chain.laboratory)
        return cls("report", facts.job, facts.laboratory, facts.job.origin, job.inputs, facts.recording.file, known)


def provenance(job: Job, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> bytes:
    return provenance_of(Behind.of(job), results, outputs)


def provenance_of(job: Behind, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> bytes:
    """The file of any certificate; see :func:`provenance`."""
    graph = {
        "prefix": {"cmm-uq": _PREFIX, "file": f"{_PREFIX}file:", "package": f"{_PREFIX}package:"},
        "entity": _entities(job, results, outputs),
        "activity": _activities(job, results),
        "agent": _agents(job, results),
        **_relations(job, results, outputs),
    }
    return (json.dumps(graph, indent=2, ensure_ascii=False) + "\n").encode()


def same_but_for_the_platform(one: bytes, other: bytes) -> bool:
    """Whether two provenances differ in the platform and the versions of other packages only."""
    return _without_platform(one) == _without_platform(other)


def _without_platform(data: bytes) -> object:
    graph = json.loads(data)
    entities = _entities_of(graph)
    kept = {name: one for name, one in entities.items() if name != PLATFORM and not name.startswith("package:")}
    used = graph.get("used", {}) if isinstance(graph, dict) else {}
    return (
        {key: value for key, value in graph.items() if key not in ("entity", "used")} if isinstance(graph, dict) else graph,
        kept, sorted(str(one.get("prov:entity")) for one in used.values() if one.get("prov:entity") in kept),
    )  # fmt: skip


def _entities_of(graph: Any) -> dict[str, Record]:
    found = graph.get("entity", {}) if isinstance(graph, dict) else {}
    return {str(name): one for name, one in found.items() if isinstance(one, dict)} if isinstance(found, dict) else {}


def _entities(job: Behind, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> dict[str, Record]:
    said = job.said
    found = {_file(name): _told(name, content, "input") for name, content in job.inputs.items()}
    found |= {_file(name): _told(name, content, "output") for name, content in outputs.items()}
    found |= {
        f"package:{name}": {"prov:type": "package", "prov:label": name, "cmm-uq:version": version}
        for name, version in {**packages(), **results["software"].get("plugins", {})}.items()
    }
    found[PLATFORM] = {"prov:type": "platform"} | {f"cmm-uq:{name}": told for name, told in machine().items()}
    issued = {"cmm-uq:issued": _day(said.issued.isoformat())} if said.issued else {}
    found[_CERTIFICATE] = {"prov:type": _name("prov:Collection"), "prov:label": said.number or said.id, **issued}
    if replaced := said.replaces:
        found[_REPLACED] = {"prov:label": replaced.number, "cmm-uq:issued": _day(replaced.date.isoformat())}
    number, laboratory = job.rests_on
    if number:
        found[_ARTEFACT] = {"prov:label": number, "cmm-uq:laboratory": laboratory}
    return found


def _activities(job: Behind, results: Mapping[str, Any]) -> dict[str, Record]:
    sampling = results.get("sampling") or results.get("simulation") or {}
    seed = {"cmm-uq:seed": sampling["seed"]} if "seed" in sampling else {}
    return {
        _RECORDING: {"cmm-uq:origin": job.origin, "cmm-uq:date": _day(job.said.date.isoformat())},
        _REPORT: {"prov:label": f"cmm-uq {job.command}", **seed},
    }


def _agents(job: Behind, results: Mapping[str, Any]) -> dict[str, Record]:
    own = results["software"]
    program = {"prov:type": _name("prov:SoftwareAgent"), "prov:label": own["name"], "cmm-uq:version": own["version"]}
    laboratory = job.laboratory.name
    organisation = {"prov:type": _name("prov:Organization"), "prov:label": laboratory}
    return {_PROGRAM: program, **({_LABORATORY: organisation} if laboratory else {})}


def _relations(job: Behind, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> dict[str, dict[str, Record]]:
    entities = _entities(job, results, outputs)
    behind = [name for name in entities if name.startswith("package:") or name in (PLATFORM, _ARTEFACT)]
    measured = [_linked("entity", _file(name), "activity", _RECORDING) for name in job.inputs if name == job.recording]
    made = [_linked("entity", name, "activity", _REPORT) for name in (*map(_file, outputs), _CERTIFICATE)]
    agents = [_linked("activity", _REPORT, "agent", _PROGRAM)]
    if job.laboratory.name:
        agents.append(_linked("activity", _RECORDING, "agent", _LABORATORY))
    revised = _linked("generatedEntity", _CERTIFICATE, "usedEntity", _REPLACED) | {"prov:type": _name("prov:Revision")}
    used = [_linked("activity", _REPORT, "entity", name) for name in (*map(_file, job.inputs), *behind)]
    return {
        "used": _numbered("u", used),
        "wasGeneratedBy": _numbered("g", measured + made),
        "wasAssociatedWith": _numbered("a", agents),
        "hadMember": _numbered("m", [_linked("collection", _CERTIFICATE, "entity", _file(name)) for name in outputs]),
        **({"wasDerivedFrom": _numbered("d", [revised])} if job.said.replaces else {}),
    }


def _told(name: str, content: bytes, sort: str) -> Record:
    return {
        "prov:type": sort, "prov:label": name, "cmm-uq:bytes": len(content),
        "cmm-uq:sha256": hashlib.sha256(content).hexdigest(),
    }  # fmt: skip


def _file(name: str) -> str:
    return f"file:{quote(name, safe='/')}"


def _name(name: str) -> Record:
    return {"$": name, "type": "prov:QUALIFIED_NAME"}


def _day(date: str) -> Record:
    return {"$": date, "type": "xsd:date"}


def _linked(one: str, name: str, other: str, named: str) -> Record:
    return {f"prov:{one}": name, f"prov:{other}": named}


def _numbered(letter: str, records: list[Record]) -> dict[str, Record]:
    return {f"_:{letter}{number}": record for number, record in enumerate(records, 1)}
