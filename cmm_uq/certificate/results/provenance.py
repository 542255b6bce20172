"""`provenance.json`: from what a certificate was made, by what, and on what, in the words of W3C PROV (PROV-JSON).

Files are entities with their SHA-256, the recording and the report are activities, the program and the laboratory agents.
No clock is read: dates are those of the job. The platform stands here and nowhere else, so the PDF that carries this file is
the same to the byte on the same installation only, and on any with this very file in it; ``results.json`` is the same on all.
The provenance cannot have the hash of the PDF that it lies in; the manifest beside both has it. Beside it stands how the
figures of a replaced certificate and of the one that replaces it differ.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path
from typing import Any
from urllib.parse import quote

from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, foreign, plural, say, semicolons
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.document import Column, Document, Facts, Section, section, table
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import Identification, Laboratory

PACKAGES = ("emcee", "jinja2", "matplotlib", "numpy", "pandas", "pydantic", "scipy", "typst")
"""Those that a figure, or a page that shows it, rests on."""

_CORE = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")
"""What the library of linear algebra in the packages of NumPy calls the question for its kernels."""


@cache
def packages() -> dict[str, str]:
    """Versions, by name; without those that are not installed as packages."""
    found: dict[str, str] = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


LOCK = Path(__file__).parents[3] / "pylock.toml"
_INSTALLERS = {"cmm-uq", "pip", "setuptools", "uv", "wheel"}
_STATED = re.compile(r"^(Name|Version):[ \t]*(.*?)[ \t\r]*$", re.MULTILINE)
_LOCKED = re.compile(r'^name = "([^"]+)"\nversion = "([^"]+)"$', re.MULTILINE)


@cache
def environment() -> dict[str, str]:
    """The project's lock, where whatever is installed is of it, else all that is installed; each with its SHA-256."""
    texts = (one.read_text("METADATA") or one.read_text("PKG-INFO") or "" for one in distributions())
    heads = (dict(_STATED.findall(text.partition("\n\n")[0])) for text in texts)  # ten times as fast as a mail's parser
    here = {re.sub(r"[-_.]+", "-", one["Name"]).lower(): one["Version"] for one in heads if len(one) == 2}
    content = LOCK.read_bytes() if LOCK.is_file() else b""
    locked = set(_LOCKED.findall(content.decode()))  # of some packages several, for versions of Python
    if locked and all(one in locked for one in here.items() if one[0] not in _INSTALLERS):
        return {"lock": LOCK.name, "sha256": hashlib.sha256(content).hexdigest()}
    listed = " ".join(f"{name}=={here[name]}" for name in sorted(here))
    return {"packages": listed, "sha256": hashlib.sha256(listed.encode()).hexdigest()}


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
REBUILT = say("{file} (names the software environment that computes all of this again)", file=Verbatim(FILE))
PLATFORM, ENVIRONMENT = "cmm-uq:platform", "cmm-uq:environment"
_PREFIX = "urn:cmm-uq:"
_RECORDING, _REPORT, _PROGRAM, _LABORATORY = "cmm-uq:recording", "cmm-uq:report", "cmm-uq:program", "cmm-uq:laboratory"
_CERTIFICATE, _REPLACED, _ARTEFACT = "cmm-uq:certificate", "cmm-uq:replaced", "cmm-uq:artefact-certificate"
Record = dict[str, Any]


@dataclass(frozen=True)
class Behind:
    command: str  # of ``cmm-uq`` that made it
    said: Identification  # as its job has it
    laboratory: Laboratory
    origin: str  # of the recording
    inputs: Mapping[str, bytes]  # of the job, by name
    recording: str  # its file; empty where there is none
    rests_on: tuple[str, str] = ("", "")  # number and laboratory of the certificate that it goes by; empty for none

    @classmethod
    def of(cls, job: Job) -> Behind:
        facts, chain = job.facts, job.facts.artefact.certificate
        known = ("", "") if chain is None else (chain.number, chain.laboratory)
        return cls("report", facts.job, facts.laboratory, facts.job.origin, job.inputs, facts.recording.file, known)


def provenance(job: Job, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> bytes:
    return provenance_of(Behind.of(job), results, outputs)


def provenance_of(job: Behind, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> bytes:
    entities = _entities(job, results, outputs)
    sampling = results.get("sampling") or results.get("simulation") or {}
    seed = {"cmm-uq:seed": sampling["seed"]} if "seed" in sampling else {}
    program, laboratory = results["software"], job.laboratory.name
    organisation = {"prov:type": _name("prov:Organization"), "prov:label": laboratory}
    graph = {
        "prefix": {"cmm-uq": _PREFIX, "file": f"{_PREFIX}file:", "package": f"{_PREFIX}package:"},
        "entity": entities,
        "activity": {_RECORDING: {"cmm-uq:origin": job.origin, "cmm-uq:date": _day(job.said.date)},
                     _REPORT: {"prov:label": f"cmm-uq {job.command}", **seed}},
        "agent": {
            _PROGRAM: {"prov:type": _name("prov:SoftwareAgent"), "prov:label": program["name"],
                       "cmm-uq:version": program["version"]},
            **({_LABORATORY: organisation} if laboratory else {}),
        },
        **_relations(job, entities, outputs),
    }  # fmt: skip
    return (json.dumps(graph, indent=2, ensure_ascii=False) + "\n").encode()


def same_but_for_the_platform(one: bytes, other: bytes) -> bool:
    return _without_platform(one) == _without_platform(other)


def _without_platform(data: bytes) -> object:
    graph = json.loads(data)
    if not isinstance(graph, dict):
        return graph, {}, []
    entities, used = graph.get("entity", {}), graph.get("used", {})
    kept = {
        str(name): entity for name, entity in (entities.items() if isinstance(entities, dict) else ())
        if isinstance(entity, dict) and str(name) not in (PLATFORM, ENVIRONMENT) and not str(name).startswith("package:")
    }  # fmt: skip
    others = {key: value for key, value in graph.items() if key not in ("entity", "used")}
    return others, kept, sorted(str(each["prov:entity"]) for each in used.values() if each.get("prov:entity") in kept)


def _entities(job: Behind, results: Mapping[str, Any], outputs: Mapping[str, bytes]) -> dict[str, Record]:
    said, (number, laboratory) = job.said, job.rests_on
    found: dict[str, Record] = {
        _file(name): {
            "prov:type": sort, "prov:label": name, "cmm-uq:bytes": len(content),
            "cmm-uq:sha256": hashlib.sha256(content).hexdigest(),
        }
        for sort, files in (("input", job.inputs), ("output", outputs)) for name, content in files.items()
    }  # fmt: skip
    found |= {
        f"package:{name}": {"prov:type": "package", "prov:label": name, "cmm-uq:version": version}
        for name, version in {**packages(), **results["software"].get("plugins", {})}.items()
    }
    found[PLATFORM] = {"prov:type": "platform"} | {f"cmm-uq:{name}": text for name, text in machine().items()}
    found[ENVIRONMENT] = {"prov:type": "environment"} | {f"cmm-uq:{name}": text for name, text in environment().items()}
    issued = {"cmm-uq:issued": _day(said.issued)} if said.issued else {}
    found[_CERTIFICATE] = {"prov:type": _name("prov:Collection"), "prov:label": said.number or said.id, **issued}
    if replaced := said.replaces:
        found[_REPLACED] = {"prov:label": replaced.number, "cmm-uq:issued": _day(replaced.date)}
    if number:
        found[_ARTEFACT] = {"prov:label": number, "cmm-uq:laboratory": laboratory}
    return found


def _relations(
    job: Behind, entities: Mapping[str, Record], outputs: Mapping[str, bytes]
) -> dict[str, dict[str, Record]]:
    def numbered(letter: str, key: str, other: str, pairs: Iterable[tuple[str, str]]) -> dict[str, Record]:
        return {f"_:{letter}{i}": {f"prov:{key}": a, f"prov:{other}": b} for i, (a, b) in enumerate(pairs, 1)}

    behind = [name for name in entities if name.startswith("package:") or name in (PLATFORM, ENVIRONMENT, _ARTEFACT)]
    measured = [(_file(name), _RECORDING) for name in job.inputs if name == job.recording]
    made = [(name, _REPORT) for name in (*map(_file, outputs), _CERTIFICATE)]
    agents = [(_REPORT, _PROGRAM), *([(_RECORDING, _LABORATORY)] if job.laboratory.name else [])]
    derived = numbered("d", "generatedEntity", "usedEntity", [(_CERTIFICATE, _REPLACED)])
    derived["_:d1"]["prov:type"] = _name("prov:Revision")
    used = [(_REPORT, name) for name in (*map(_file, job.inputs), *behind)]
    return {
        "used": numbered("u", "activity", "entity", used),
        "wasGeneratedBy": numbered("g", "entity", "activity", measured + made),
        "wasAssociatedWith": numbered("a", "activity", "agent", agents),
        "hadMember": numbered("m", "collection", "entity", [(_CERTIFICATE, _file(name)) for name in outputs]),
        **({"wasDerivedFrom": derived} if job.said.replaces else {}),
    }


def _file(name: str) -> str:
    return f"file:{quote(name, safe='/')}"


def _name(name: str) -> Record:
    return {"$": name, "type": "prov:QUALIFIED_NAME"}


def _day(date: dt.date) -> Record:
    return {"$": date.isoformat(), "type": "xsd:date"}


KEY = "replaced"  # of results.json.
COMPARED = say("Results compared")  # on the first page
NOT_COMPARED = say("No comparison of the results was made: those of the replaced certificate were not at hand.")
_NAMED = 6  # differences that the first page names one by one


@dataclass(frozen=True)
class ChangedFigure:
    """A decision or a figure that is not printed alike on both certificates, as printed; empty where one does not have it."""

    what: Text
    before: Text
    after: Text
    unit: Text = NOTHING

    @property
    def sentence(self) -> Text:
        before, after = (
            say("{printed} {unit}", printed=printed, unit=self.unit)
            if printed and self.unit
            else printed or say("none")
            for printed in (self.before, self.after)
        )
        return say("{what}: {before} → {after}", what=self.what, before=before, after=after)

    @property
    def data(self) -> dict[str, str | None]:
        return {name: str.__str__(getattr(self, name)) or None for name in ("what", "before", "after", "unit")}


@dataclass(frozen=True)
class Reissue:
    """The results of a certificate beside those of the one that it replaces."""

    number: str  # of the one that is replaced
    compared: int | None = None  # figures that both have or it alone; ``None`` where its results are not at hand
    differences: tuple[ChangedFigure, ...] = ()  # decisions first, then figures
    added: tuple[ChangedFigure, ...] = ()  # figures that the replaced one does not state: no difference

    @property
    def sentence(self) -> Text:
        """For the first page, below what the laboratory says is changed."""
        if self.compared is None:
            return NOT_COMPARED
        if not self.differences:
            many = say(
                "Both results were compared: of {count} decisions and figures none differs.", count=self.compared
            )
            one = say("Both results were compared: the one decision or figure does not differ.")
            return plural(self.compared, one=one, many=many)
        named: list[Text] = [one.sentence for one in self.differences[:_NAMED]]
        if (more := len(self.differences) - _NAMED) > 0:
            named.append(say("{more} more in the table of differences", more=more))
        return say(
            "Both results were compared: of {count} decisions and figures {differ} differ: {named}.",
            count=self.compared, differ=len(self.differences), named=semicolons(named),
        )  # fmt: skip

    @property
    def section(self) -> Section:
        """The table of all differences; without blocks where there are none."""
        rows = ((one.what, one.before or DASH, one.after or DASH, one.unit) for one in (*self.differences, *self.added))
        heads = (say("Decision or figure"), Column(say("Before")), Column(say("After")), say("Unit"))
        caption = say("Differences from certificate {number}", number=Verbatim(self.number))
        note = say(
            "Figures are compared as they are printed, with the expanded uncertainty for a coverage probability of 95 %."
        )
        return section(say("Against the replaced certificate"), table(caption, heads, rows, note))

    @property
    def data(self) -> dict[str, Any]:
        return {
            "number": self.number, "compared": self.compared, "differences": [one.data for one in self.differences],
            "added": [one.data for one in self.added],
        }  # fmt: skip

    @classmethod
    def of_results(cls, results: Mapping[str, Any]) -> Reissue | None:
        """Of a results.json; ``None`` where it is of no certificate that replaces another."""
        there = results.get(KEY)
        if not isinstance(there, Mapping):
            return None
        lists = ([ChangedFigure(**{key: foreign(text or "") for key, text in one.items()}) for one in there[key]]
                 for key in ("differences", "added"))  # fmt: skip
        return cls(str(there["number"]), there["compared"], *map(tuple, lists))

    def on(self, document: Document) -> Document:
        """The certificate with the comparison on its first page, and the table of differences after its first section."""
        particulars = tuple(
            Facts(tuple((label, self.sentence if label == COMPARED else text) for label, text in facts.rows))
            for facts in document.particulars
        )
        first, *others = document.sections
        table = (self.section,) if self.section.blocks else ()
        return replace(document, particulars=particulars, sections=(first, *table, *others))
