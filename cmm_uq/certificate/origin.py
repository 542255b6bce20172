"""Where a recording comes from and which program made a document of it, as files say it; quantities and draws as data.

Further certificates of a machine, whose recordings are taken together with that of its calibration.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isfinite
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, commas, day, listed, names, number, say, together
from cmm_uq.base.plugins import KINDS, STANDARDS, versions
from cmm_uq.base.values import asdict, dataclass, replace
from cmm_uq.certificate.document import Document, Table, table
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import COMPENSATED, MEASURED, SIMULATED, Origin
from cmm_uq.machine.physics.catalogue import plugins
from cmm_uq.maths.inference.draws import Draws
from cmm_uq.maths.uncertainty.quantity import Quantity

if TYPE_CHECKING:
    from cmm_uq.jobs.part.machine_state import PassedFacts
    from cmm_uq.laboratory.records.facts import ChainHead

BANNERS = {
    SIMULATED: say("SIMULATED RECORDING, not a calibration certificate"),
    COMPENSATED: say("COMPENSATED RECORDING, not a calibration certificate"),
}
TITLES = {
    SIMULATED: say("Evaluation of a simulated recording"),
    COMPENSATED: say("Evaluation of a compensated recording"),
}
_WHAT = {
    SIMULATED: say("The recording was simulated: no machine was measured, and nothing here certifies one."),
    COMPENSATED: say(
        "The coordinates were corrected by computation: nothing here certifies what the machine indicates."
    ),
}


def file_name(name: str, origin: str) -> str:
    """Name of a document, with the origin of a recording that was not measured: ``certificate-simulated.pdf``."""
    path = PurePosixPath(name)
    return name if origin == MEASURED else f"{path.stem}-{origin}{path.suffix}"


def marked(document: Document, job: Job) -> Document:
    """Its origin on every page, without signature and number of a certificate; unchanged where the recording was measured."""
    return marked_as(document, job.origin, job.facts.job.id, origin_warnings(job))


def marked_as(document: Document, origin: Origin, id: str, told: Iterable[Text]) -> Document:  # noqa: A002
    warnings = (*told, *document.warnings)
    if origin == MEASURED:
        return replace(document, warnings=warnings)
    title: Text = TITLES[origin]
    end: Text = say("End of evaluation")
    if document.title != CERTIFICATE:
        simulated = say("{title} of a simulated recording", title=document.title)
        compensated = say("{title} of a compensated recording", title=document.title)
        title, end = simulated if origin == SIMULATED else compensated, document.end
    return replace(document, title=title, number=Verbatim(id), banner=BANNERS[origin], draft=False, warnings=warnings,
                   statements=(), signatures=(), end=end)  # fmt: skip


DIGITAL = "certificate.xml"  # the digital certificate
CERTIFICATE = say("Calibration certificate")  # title of a document that certifies


def came_about(job: Job) -> Text:
    return say("simulated, dated") if job.origin == SIMULATED else say("measured on")


def origin_warnings(job: Job) -> list[Text]:
    """What the reader must know of where the recording comes from."""
    taken = [] if job.acquired is None else job.acquired.warnings
    if job.origin == MEASURED:
        return taken
    source = job.facts.job.derived_from
    texts: list[Text] = [_WHAT[job.origin]]
    if source:
        told = say(
            "It was derived from job {job} by {program} ({by}).",
            job=Verbatim(source.job), program=Verbatim(source.program), by=Verbatim(source.by),
        )  # fmt: skip
        texts = [after(texts[0], told)]
    if job.altered:
        texts.append(say("Changed after it was derived: {files}.", files=commas(names(job.altered))))
    return [*texts, *taken]


def made_after(head: ChainHead | None) -> Text:
    """How the laboratory's records stood when a document was made: their newest entry, which its own follows."""
    if head is None:
        return say("Records of the laboratory: none; this document was not recorded.")
    if head.at is None:
        return say("Records of the laboratory before this document: empty, entry 0.")
    at, digest = Verbatim(head.at[:19].replace("T", " ")), Verbatim(head.head)
    return say("Records of the laboratory before this document: entry {number} of {at} UTC, SHA-256 {digest}.",
               number=head.entries, at=at, digest=digest)  # fmt: skip


NAME = "cmm-uq"


def software(job: Job, *, effects: bool = True) -> dict[str, Any]:
    """For results.json: name and version, also of packages of kind and standards, and, with ``effects``, of candidates."""
    taking_part = (plugins() if effects else {}) | _of_the_job(job)
    return {"name": NAME, "version": __version__, **({"plugins": taking_part} if taking_part else {})}


def program(job: Job, effects: Iterable[str] | None = None) -> Text:
    """The same in words: ``cmm-uq 1.0`` or ``cmm-uq 1.0 with outside-effects 0.1``; of the effects named only, if any are."""
    parts = [_versioned(package, version) for package, version in (plugins(effects) | _of_the_job(job)).items()]
    own = _versioned(NAME, __version__)
    return say("{program} with {plugins}", program=own, plugins=together(parts)) if parts else own


def _of_the_job(job: Job) -> dict[str, str]:
    return versions({KINDS: [job.facts.artefact.kind], STANDARDS: [wish.standard for wish in job.facts.conformity]})


def _versioned(package: str, version: str) -> Text:
    return say("{package} {version}", package=Verbatim(package), version=Verbatim(version))


def as_json(data: Mapping[str, Any]) -> bytes:
    """Plain data as UTF-8 JSON with finite numbers of ten digits, so that the last bits of rounding do not show."""
    text = StringIO()  # a list of all its parts, as dumps makes, is ten times as large
    try:
        json.dump(_rounded(data), text, indent=2, ensure_ascii=False, allow_nan=False)
        return f"{text.getvalue()}\n".encode()
    except ValueError as error:
        raise CmmUqError(f"a figure is not finite: {error}", where="results.json",
                         fix="Look for a number in the input that no measurement gives") from error  # fmt: skip


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.10g}") if isinstance(value, float) else value


def attributes(of: object, *names: str) -> dict[str, Any]:
    """What stands under its own name in results.json; a sequence as a list."""
    values = ((name, getattr(of, name)) for name in names)
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values}


def rows(**columns: Iterable[object]) -> list[dict[str, Any]]:
    """Columns of a table as its rows."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def quantity_data(quantity: Quantity) -> dict[str, Any]:
    """Value, standard uncertainty, 95 % interval, expanded uncertainty, coverage factor; its unit is in the key above it."""
    return {
        "value": quantity.value, "u": quantity.u, "interval95": list(quantity.interval95), "U": quantity.expanded,
        "k": quantity.coverage_factor,
    }  # fmt: skip


MOST_NUMBERS = 2**16
"""In the file, of four bytes each: several thousand effective draws of eight quantities, and a certificate to be mailed."""


@dataclass(frozen=True)
class PosteriorFile:
    name: str
    content: bytes
    entry: dict[str, Any]


def posterior_name(origin: str) -> str:
    return file_name("posterior.npz", origin)


def posterior_file(draws: Draws, origin: str) -> PosteriorFile:
    """Draws thinned to what a certificate can carry; ``rhat_max``, ``ess_bulk_min`` of all, each walker a chain (ArviZ)."""
    kept = draws.thinned(MOST_NUMBERS)
    content, name = kept.as_npz(), posterior_name(origin)
    chains, count, _ = kept.array.shape
    return PosteriorFile(name, content, {
        "file": name, "sha256": hashlib.sha256(content).hexdigest(), "parameters": kept.names, "units": dict(kept.units),
        "chains": chains, "draws": count, "every": kept.every,
        "rhat_max": draws.rhat_max if isfinite(draws.rhat_max) else None,
        "ess_bulk_min": draws.ess_bulk_min if isfinite(draws.ess_bulk_min) else None,
    })  # fmt: skip


@dataclass(frozen=True)
class FurtherCertificate:
    """Another certificate of the machine, whose recording is taken together with that of its calibration."""

    file: str
    number: str
    laboratory: str
    artefact: str
    date: dt.date
    verdict: str  # of the verification
    corrected: bool  # whether the machine then corrected what its calibration found
    origin: str  # of the recording
    observations: int = 0  # that are reckoned with
    chance: float = 1.0  # of a recording that contradicts the machine as much, as its other certificates have it
    used: bool = True


@dataclass(frozen=True)
class PassedTest:
    """A test of lengths that the machine passed, as a job states it."""

    facts: PassedFacts
    lengths: int
    chance: float  # the least of a length to keep its limit, by the machine as its recordings have it
    used: bool
    u_without: tuple[float, ...] = ()  # u of each characteristic without this and other tests, over that with them


@dataclass(frozen=True)
class FurtherCertificates:
    each: tuple[FurtherCertificate, ...] = ()
    warnings: tuple[Text, ...] = ()

    @property
    def used(self) -> tuple[FurtherCertificate, ...]:
        return tuple(one for one in self.each if one.used)

    @property
    def together(self) -> Text:
        """Which of them are taken together with the recording of the calibration, in a sentence."""
        numbers = listed(names(one.number for one in self.used))
        told = say("The recordings of {certificates} are taken together with it.", certificates=numbers)
        return told if numbers else NOTHING


NO_FURTHER = FurtherCertificates()


def further_table(certificates: Sequence[FurtherCertificate]) -> Table | None:
    heads = [say("Certificate"), say("Issued by"), say("Artefact"), say("Calibrated on"), say("Machine")]
    figures = [say("Observations"), say("Chance of as much contradiction"), say("Reckoned with")]
    rows = []
    for one in certificates:
        seen = say("corrected") if one.corrected else say("not corrected")
        named = (Verbatim(one.number), Verbatim(one.laboratory), Verbatim(one.artefact), day(one.date), seen)
        used = say("yes") if one.used else say("no")
        rows.append((*named, number(one.observations), number(one.chance, ".2g"), used))
    return table(say("Further certificates of the machine"), [*heads, *figures], rows)


def passed_data(tests: Sequence[PassedTest]) -> dict[str, Any]:
    """Of results.json: ``passed``, nothing where there is none."""
    told = [
        {
            "stated": one.facts.model_dump(mode="json"),
            "lengths": one.lengths,
            "least_chance": one.chance,
            "used": one.used,
            "u_without": list(one.u_without),
        }
        for one in tests
    ]
    return {"passed": told} if told else {}


def further_data(certificates: Sequence[FurtherCertificate]) -> dict[str, Any]:
    """Of results.json: ``further``, nothing where there is none."""
    told = [asdict(one) | {"date": one.date.isoformat()} for one in certificates]
    return {"further": told} if told else {}
