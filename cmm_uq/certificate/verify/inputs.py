"""Whether the inputs are those that ``results.json`` names, by their hashes, and it speaks of the job that they are."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import JOB, RESULTS, Given
from cmm_uq.certificate.verify.strict_json import canonical
from cmm_uq.jobs.chain import certified_on_this_machine, dates_out_of_order
from cmm_uq.jobs.job import Job


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
