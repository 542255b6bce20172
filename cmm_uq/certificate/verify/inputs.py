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
    wanted, files = data["job"]["inputs_sha256"], given.files

    def is_sound(file: str, digest: str, source: str, missing: str) -> bool:
        if file not in files:
            if given.pdf is not None:
                inquiry.wrong("inputs", given.pdf[0], f"attachment {file}", missing)
            return False
        stands = sha256(files[file]).hexdigest()
        if stands != digest:
            where = f"{file} in {given.pdf[0]}" if given.pdf is not None and file in given.pdf[1].files else file
            inquiry.wrong("inputs", where, "", f"is not the file whose hash {source} has", stands, digest)
        return stands == digest

    inquiry.looked("inputs", len(wanted))
    missing = f"is missing, and {name} names it as an input"
    sound = sum(is_sound(file, digest, name, missing) for file, digest in wanted.items()) == len(wanted)
    if given.pdf is None and not sound and not (wanted.keys() & files.keys()):
        inquiry.left("inputs", "neither a PDF that has them inside nor the files themselves are given")
    elif given.pdf is None and not sound:
        inquiry.left("inputs", f"not given: {', '.join(sorted(wanted.keys() - files.keys()))}")
    if entry := data.get("posterior"):
        draws = str(entry["file"])
        inquiry.looked("inputs", draws in files)
        is_sound(draws, entry["sha256"], RESULTS, f"is missing, and {RESULTS} names it")
    return {file: files[file] for file in wanted} if sound and JOB in wanted else None


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
    _compare(inquiry, asked, file, f"is not what {JOB} says")


def check_dates(inquiry: Inquiry, job: Job) -> None:
    """Whether every artefact was in date on the day of the measurement, and the other dates are in order."""
    inquiry.looked("dates")
    for text in dates_out_of_order(job):
        inquiry.wrong("dates", JOB, "", str.__str__(text))
    chain = job.facts.artefact.certificate
    if certified_on_this_machine(job.facts):
        inquiry.notes.append("The artefact was certified on the machine that it tests; the certificate says so.")
    if chain is not None and chain.number and chain.until is None:
        note = "The artefact's certificate has no date by which it is due: that it was in date is not shown."
        inquiry.notes.append(note)


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
    facts, said, problem = job.facts, data["job"], f"is not what {JOB} says"
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
        value = None if measured is None else float(measured[i])
        numbers: list[tuple[str, Any, float | None, float, str]] = [
            *((f"limits.{key}", limits[key], getattr(known, key), _SAME, problem) for key in ("lower", "upper")),
            ("measured", one["measured"], value, _NEAR_MM, "is not the value of the measured points"),
        ]
        for key, stands, should, room, otherwise in numbers:
            inquiry.looked("inputs")
            inside = None if should is None else degrees(should) if angle else should
            if stands is None or inside is None:
                near = stands is inside
            else:
                near = abs(stands - inside) <= room * max(1.0, abs(inside))
            if not near:
                inquiry.wrong("inputs", file, f"{where}.{key}", otherwise, stands, f"{inside}")
    _compare(inquiry, asked, file, problem)


def check_standing(inquiry: Inquiry, standing: CertificateStatus, data: Mapping[str, Any], file: str) -> None:
    """Keep what the machine's certificate says otherwise."""
    should, said = standing_data(standing), data["machine"]
    _compare(inquiry, [(f"machine.{key}", said[key], should[key]) for key in _OF_THE_MACHINE], file,
             "is not what the machine's certificate says")  # fmt: skip


def _compare(inquiry: Inquiry, asked: Sequence[Asked], file: str, problem: str) -> None:
    for place, stands, should in asked:
        inquiry.compare("inputs", file, place, problem, stands, should)
