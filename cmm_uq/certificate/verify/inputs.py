"""Whether the inputs are those that ``results.json`` names, and whether it speaks of the job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import degrees
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.certificate.part.results import standing_data
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import JOB, RESULTS, Given, canonical
from cmm_uq.jobs.chain import certified_on_this_machine, dates_out_of_order
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob

if TYPE_CHECKING:
    from cmm_uq.base.points import Floats
    from cmm_uq.certificate.part.measurement import CertificateStatus


def check_results(inquiry: Inquiry, given: Given) -> None:
    """``results.json`` given and attached, and as this program writes it."""
    if given.results is None:
        return
    name, data, content = given.results
    inquiry.looked("forms")
    if content != canonical(data):
        inquiry.wrong("files", name, _first(content, canonical(data)), "is not as cmm-uq writes it")
    if given.pdf is None:
        return
    inside = given.pdf[1].files.get(RESULTS)
    if inside is None:
        inquiry.wrong("forms", given.pdf[0], "", f"has no {RESULTS} inside")
    elif inside != content:
        inquiry.wrong("forms", given.pdf[0], f"attachment {RESULTS}: {_first(inside, content)}", f"is not {name}")


def inputs_of(inquiry: Inquiry, given: Given) -> dict[str, bytes] | None:
    """The inputs by name, each with the hash that results.json says; ``None`` where one is missing or another."""
    if given.results is None:
        return None
    name, data, _ = given.results
    wanted = data["job"]["inputs_sha256"]
    files, sound, found = given.files, True, dict[str, bytes]()
    for input_, digest in wanted.items():
        inquiry.looked("inputs")
        if input_ not in files:
            sound = False
            if given.pdf is not None:
                inquiry.wrong(
                    "inputs", given.pdf[0], f"attachment {input_}", f"is missing, and {name} names it as an input"
                )
            continue
        found[input_] = files[input_]
        stands = sha256(files[input_]).hexdigest()
        if stands != digest:
            sound = False
            inquiry.wrong(
                "inputs", _file_of(given, input_), "", f"is not the file whose hash {name} has", stands, digest
            )
    if given.pdf is None and not sound and not (wanted.keys() & files.keys()):
        inquiry.left("inputs", "neither a PDF that has them inside nor the files themselves are given")
    elif given.pdf is None and not sound:
        inquiry.left("inputs", f"not given: {', '.join(sorted(wanted.keys() - files.keys()))}")
    _check_posterior(inquiry, given, data, files)
    return found if sound and JOB in found else None


def _file_of(given: Given, name: str) -> str:
    inside = given.pdf is not None and name in given.pdf[1].files
    return f"{name} in {given.pdf[0]}" if inside and given.pdf else name


def _check_posterior(inquiry: Inquiry, given: Given, data: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    entry = data.get("posterior")
    if not entry:
        return
    name = str(entry["file"])
    if name not in files:
        if given.pdf is not None:
            inquiry.wrong("inputs", given.pdf[0], f"attachment {name}", "is missing, and results.json names it")
        return
    inquiry.looked("inputs")
    stands = sha256(files[name]).hexdigest()
    if stands != entry["sha256"]:
        inquiry.wrong("inputs", _file_of(given, name), "", "is not the file whose hash results.json has", stands,
                      entry["sha256"])  # fmt: skip


def check_job(inquiry: Inquiry, job: Job, data: Mapping[str, Any], file: str) -> None:
    """Whether results.json speaks of this job: its name, dates, machine, and what it wishes to be decided."""
    said, facts = data["job"], job.facts
    asked: list[tuple[str, object, object]] = [
        ("job.id", said.get("id"), facts.job.id), ("job.origin", said.get("origin"), facts.job.origin),
        ("job.date", said.get("date"), facts.job.date.isoformat()), ("job.machine", said.get("machine"), facts.machine.name),
        ("job.serial", said.get("serial") or "", facts.machine.serial or ""),
        ("job.altered", said.get("altered") or [], list(job.altered)),
        ("job.inputs_sha256", sorted(said["inputs_sha256"]), sorted(job.inputs)),
    ]  # fmt: skip
    entries = data.get("conformity") or ()
    if "estimates" in data and len(entries) != len(facts.conformity):
        asked.append(("conformity", len(entries), len(facts.conformity)))
    for i, (entry, wish) in enumerate(zip(entries, facts.conformity, strict=False)):
        mpe = None if wish.mpe is None else wish.mpe.model_dump()
        prior = None if wish.prior is None else wish.prior.model_dump()
        asked += [
            (f"conformity[{i}].standard", entry.get("standard"), wish.standard),
            (f"conformity[{i}].rule", entry.get("rule"), rule_name(wish.rule)),
            (f"conformity[{i}].mpe", entry.get("mpe"), mpe), (f"conformity[{i}].prior", entry.get("prior"), prior),
        ]  # fmt: skip
        if wish.characteristic is not None:
            asked.append((f"conformity[{i}].characteristic", entry.get("characteristic"), wish.characteristic))
        if wish.limit_um is not None:
            asked.append((f"conformity[{i}].limit_um", entry.get("limit_um"), float(f"{wish.limit_um:.10g}")))
    for place, stands, should in asked:
        inquiry.looked("inputs")
        if stands != should:
            inquiry.wrong("inputs", file, place, f"is not what {JOB} says", stands, should)


def check_dates(inquiry: Inquiry, job: Job) -> None:
    """Whether every artefact was in date on the day of the measurement, and the other dates are in order."""
    inquiry.looked("dates")
    for text in dates_out_of_order(job):
        inquiry.wrong("dates", JOB, "", str.__str__(text))
    chain = job.facts.artefact.certificate
    if certified_on_this_machine(job.facts):
        inquiry.notes.append("The artefact was certified on the machine that it tests; the certificate says so.")
    if chain is not None and chain.number and chain.until is None:
        inquiry.notes.append(
            "The artefact's certificate has no date by which it is due: that it was in date is not shown."
        )


def _first(stands: bytes, should: bytes) -> str:
    """The first line in which two texts differ."""
    pairs = enumerate(zip(stands.split(b"\n"), should.split(b"\n"), strict=False), 1)
    line = next((number for number, (a, b) in pairs if a != b), min(stands.count(b"\n"), should.count(b"\n")) + 1)
    return f"line {line}"


_OF_THE_MACHINE = (
    "source", "files", "number", "laboratory", "machine", "serial", "origin", "date", "age_days", "valid_until", "draft",
    "inputs_sha256",
)  # fmt: skip
"""Of ``machine``, what its certificate says; what was verified of it depends on the version that did."""

_SAME = 1e-9
_NEAR_MM = 1e-7  # features that are found by going on from a start agree so well on any processor
Asked = tuple[str, object, object]


def check_part_job(
    inquiry: Inquiry, job: PartJob, plan: Plan, measured: Floats | None, data: Mapping[str, Any], file: str
) -> None:
    """Keep what the job says otherwise; ``measured``: (c,) values of the measured points, mm and rad."""
    facts, said = job.facts, data["job"]
    part, decision = data["part"], data["decision"]
    prior = None if facts.decision.prior is None else facts.decision.prior.model_dump()
    asked: list[Asked] = [
        ("job.id", said["id"], facts.job.id), ("job.number", said.get("number") or "", facts.job.number or ""),
        ("job.origin", said["origin"], facts.job.origin), ("job.date", said["date"], facts.job.date.isoformat()),
        ("part.name", part["name"], facts.part.name), ("part.drawing", part["drawing"] or "", facts.part.drawing),
        ("part.serial", part["serial"] or "", facts.part.serial),
        ("part.not_measured", part["not_measured"], list(facts.part.not_measured)),
        ("decision.rule", decision["rule"], rule_name(facts.decision.rule)), ("decision.prior", decision["prior"], prior),
        ("simulation.points", data["simulation"]["points"], len(plan.points)),
        ("characteristics", len(data["characteristics"]), len(facts.characteristic)),
    ]  # fmt: skip
    for i, (one, wish, known) in enumerate(
        zip(data["characteristics"], facts.characteristic, plan.characteristics, strict=False)
    ):
        where = f"characteristics[{i}]"
        angle = wish.asks.limits == "angles"
        asked += [(f"{where}.name", one["name"], wish.name), (f"{where}.what", one["what"], wish.what),
                  (f"{where}.features", one["features"], list(wish.features)),
                  (f"{where}.datums", one["datums"], list(wish.datums)),
                  (f"{where}.association", one["association"], known.association),
                  (f"{where}.unit", one["unit"], "°" if angle else "mm")]  # fmt: skip
        limits = one["limits"] or {"lower": None, "upper": None}
        numbers: list[tuple[str, Any, float | None, float]] = [
            (f"limits.{key}", limits[key], getattr(known, key), _SAME) for key in ("lower", "upper")
        ]
        value = None if measured is None else float(measured[i])
        numbers.append(("measured", one["measured"], value, _NEAR_MM))
        for key, stands, should, room in numbers:
            inquiry.looked("inputs")
            inside = None if should is None else degrees(should) if angle else should
            if not _near(stands, inside, room):
                inquiry.wrong("inputs", file, f"{where}.{key}", _otherwise(key), stands, f"{inside}")
    _compare(inquiry, asked, file, f"is not what {JOB} says")


def check_standing(inquiry: Inquiry, standing: CertificateStatus, data: Mapping[str, Any], file: str) -> None:
    """Keep what the machine's certificate says otherwise."""
    should, said = standing_data(standing), data["machine"]
    _compare(inquiry, [(f"machine.{key}", said[key], should[key]) for key in _OF_THE_MACHINE], file,
             "is not what the machine's certificate says")  # fmt: skip


def _compare(inquiry: Inquiry, asked: Sequence[Asked], file: str, problem: str) -> None:
    for place, stands, should in asked:
        inquiry.looked("inputs")
        if stands != should:
            inquiry.wrong("inputs", file, place, problem, stands, should)


def _otherwise(key: str) -> str:
    return "is not the value of the measured points" if key == "measured" else f"is not what {JOB} says"


def _near(a: float | None, b: float | None, room: float) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= room * max(1.0, abs(b))
