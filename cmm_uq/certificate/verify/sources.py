"""Whether a certificate says what it rests on says: its inputs and its job, a machine's certificate, the laboratory's records.

The head of the records that it states, whose form is compared elsewhere, brackets the signatures, too: a file that states an
entry was signed after it, and before the entry that has its hash.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import PDF_BYTES, content_of
from cmm_uq.certificate.sign.found import AFTER
from cmm_uq.certificate.verify.given import JOB, PART_SCHEMA, RESULTS, Given, Inquiry, given_of
from cmm_uq.certificate.verify.texts import strict_json
from cmm_uq.certificate.verify.views import AHEAD, Signed
from cmm_uq.jobs.chain import dates_out_of_order
from cmm_uq.jobs.dcc import read
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.facts import ChainHead, Witness, instant

if TYPE_CHECKING:
    from cmm_uq.certificate.sign import FileSignature
    from cmm_uq.laboratory.records.facts import Entry
    from cmm_uq.laboratory.records.store import Records


_FIX = "Give certificates of cmm-uq (PDF, XML), their results.json, or folders that hold some"


def witness_of(given: Given) -> Witness | None:
    """What the results.json states that is given, in the PDF or in the DCC; ``None`` where there is no head, or no file."""
    if given.results is not None:
        name, data, content = given.results
    elif given.xml is not None:
        name, xml = given.xml
        results = [result for one in read(xml, name).measurements for result in one.results if result.data]
        parts = (part for result in results for part in result.data.parts)
        content = next((part.data for part in parts if getattr(part, "file_name", None) == RESULTS), b"{}")
        data = strict_json(content, f"{RESULTS} in {name}")
    else:
        return None
    head = ChainHead.of_results(data)
    what = "report" if data.get("schema") == PART_SCHEMA else "certificate"
    return None if head is None else Witness(name, head, sha256(content).hexdigest(), what)


def witnesses_of(paths: Iterable[Path]) -> tuple[list[Witness], list[str]]:
    """What certificates state, each once, also those in folders at any depth; and files that state no head, with why."""
    found: dict[tuple[ChainHead, str], Witness] = {}
    without: list[str] = []
    for path, inside in ((file, root.is_dir()) for root in paths for file in _files(root)):
        try:
            stated = witness_of(given_of({str(path): content_of(path, PDF_BYTES, _FIX)}))
        except CmmUqError as error:
            if not inside:
                raise
            without.append(f"{path}: {error.problem}")
            continue
        if stated is None:
            without.append(f"{path}: it states no head of records")
        else:
            found.setdefault((stated.head, stated.results_sha256), replace(stated, name=str(path)))
    if not found:
        why = f": {without[0]}" if without else ""
        raise CmmUqError(f"no certificate states a head of records{why}", where="--witness", fix=_FIX)
    return list(found.values()), without


def _files(root: Path) -> list[Path]:
    """A file itself; of a folder what may be a certificate."""
    if not root.is_dir():
        return [root]
    inside = (one for one in root.rglob("*") if one.suffix.lower() in (".pdf", ".xml") or one.name == RESULTS)
    return sorted(one for one in inside if one.is_file() and not one.is_symlink())


def check_records(inquiry: Inquiry, given: Given, records: Records, signed: Sequence[Signed]) -> None:
    """Keep where records are others than the certificate states, and say between which of their entries it was signed."""
    if (stated := witness_of(given)) is None:
        what = "report" if given.of_part else "certificate"
        inquiry.left("the records", f"the {what} states no head of them: made without, or by an earlier version")
        return
    inquiry.looked("records")
    wrong = partial(inquiry.wrong, "records", records.shown)
    if (broken := records.broken()) is not None:
        wrong(f"entry {broken.entry}", f"{broken.problem}: cmm-uq records verify says all")
    found = records.disagreements([stated])
    for one in found:
        wrong("", one.problem)
    if found or broken:
        return
    recorded, number = records.files_of(stated.results_sha256), stated.head.entries
    own = recorded[stated.results_sha256].number
    told = f"have entry {number}, which it states: nothing up to there was rewritten since."
    if number or own == 1:
        empty = "were empty when it was made."
        inquiry.notes.append(f"The {stated.what} is entry {own} of the records. They {told if number else empty}")
    else:
        why = f"it says that they were empty, and is their entry {own}: it may have been imported from others"
        inquiry.left("whether it was made with these records", why)
    for name, content, signature in signed:
        if signature.intact:
            digests = (sha256(each).hexdigest() for each in (signature.content, content))
            after = next((recorded[each] for each in digests if each in recorded), None)
            _check_bracket(inquiry, name, signature, (stated.head, after), records)


_STATED = re.compile(AFTER.format(number="([0-9]{1,15})", hash="([0-9a-f]{64})"))


def _check_bracket(
    inquiry: Inquiry, name: str, signature: FileSignature, ends: tuple[ChainHead, Entry | None], records: Records
) -> None:
    """Say after which entry a file was signed, the one that the signature names or else the printed one, and before which."""
    first, last = ends
    if (named := _STATED.fullmatch(signature.reason)) is not None:
        entry = next(records.entries(int(named[1])), None)
        if entry is None or (entry.number, entry.hash) != (int(named[1]), named[2]):
            there = "is not there" if entry is None else f"has the hash {entry.hash}"
            problem = f"{there}, and {name} was signed after it with the hash {named[2]}"
            inquiry.wrong("records", records.shown, f"entry {named[1]}", problem)
            return
        first = ChainHead(entry.number, entry.hash, entry.at)
    until = "no entry has it as it was signed" if last is None else f"before entry {last.number} of {last.at}"
    of = f" of {first.at}" if first.at else ""
    inquiry.notes.append(f"{name}: {signature.name} signed after entry {first.entries}{of}, {until}.")
    begin, end = first.moment, None if last is None else instant(last.at)
    early = begin is not None and signature.time is not None and signature.time < begin - AHEAD
    late = end is not None and signature.time is not None and signature.time > end + AHEAD
    if late or (early and first is not ends[0]):  # the printed head was looked at with the signatures
        inquiry.wrong("signatures", name, "", f"says {signature.time:%Y-%m-%d %H:%M} UTC, not between these entries")


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
    elif given.pdf is None and (lacking := wanted.keys() - files.keys()):
        inquiry.left("inputs", f"not given: {', '.join(sorted(lacking))}")
    if entry := data.get("posterior"):
        draws = str(entry["file"])
        inquiry.looked("inputs", draws in files)
        is_sound(draws, entry["sha256"], RESULTS, f"is missing, and {RESULTS} names it")
    return {file: files[file] for file in wanted} if sound and JOB in wanted else None


def check_job(inquiry: Inquiry, job: Job, data: Mapping[str, Any], file: str) -> None:
    """Whether results.json speaks of this job: its name, dates, machine, and what it wishes to be decided."""
    said, facts = data["job"], job.facts
    stated: list[tuple[str, object, object]] = [
        ("job.id", said.get("id"), facts.job.id), ("job.origin", said.get("origin"), facts.job.origin),
        ("job.date", said.get("date"), facts.job.date.isoformat()), ("job.machine", said.get("machine"), facts.machine.name),
        ("job.serial", said.get("serial") or "", facts.machine.serial or ""),
        ("job.altered", said.get("altered") or [], list(job.altered)),
        ("job.inputs_sha256", sorted(said["inputs_sha256"]), sorted(job.inputs)),
    ]  # fmt: skip
    entries = data.get("conformity") or ()
    if "estimates" in data and len(entries) != len(facts.conformity):
        stated.append(("conformity", len(entries), len(facts.conformity)))
    for i, (entry, wish) in enumerate(zip(entries, facts.conformity, strict=False)):
        wished: dict[str, object] = {
            "standard": wish.standard, "rule": rule_name(wish.rule), "mpe": wish.mpe and wish.mpe.model_dump(),
            "prior": wish.prior and wish.prior.model_dump(),
        }  # fmt: skip
        if wish.characteristic is not None:
            wished["characteristic"] = wish.characteristic
        if wish.limit_um is not None:
            wished["limit_um"] = float(f"{wish.limit_um:.10g}")
        if wish.angle_arcsec is not None or "limit_arcsec" in entry:
            wished["limit_arcsec"] = wish.angle_arcsec and float(f"{wish.angle_arcsec:.10g}")
        stated += [(f"conformity[{i}].{key}", entry.get(key), should) for key, should in wished.items()]
    for place, stands, should in stated:
        inquiry.compare("inputs", file, place, f"is not what {JOB} says", stands, should)


def check_dates(inquiry: Inquiry, job: Job) -> None:
    """Whether every artefact was in date on the day of the measurement, and the other dates are in order."""
    inquiry.looked("dates")
    for text in dates_out_of_order(job):
        inquiry.wrong("dates", JOB, "", str.__str__(text))
    chain = job.facts.artefact.certificate
    if job.facts.certified_on_this_machine:
        inquiry.notes.append("The artefact was certified on the machine that it tests; the certificate says so.")
    if chain is not None and chain.number and chain.until is None:
        note = "The artefact's certificate has no date by which it is due: that it was in date is not shown."
        inquiry.notes.append(note)
