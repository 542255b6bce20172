"""The head of the laboratory's records that a certificate states, looked for in the records; its form is compared elsewhere.

It brackets the signatures, too: a file that states an entry was signed after it, and before the entry that has its hash.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import PDF_BYTES
from cmm_uq.certificate.sign.found import AFTER
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import RESULTS, Given, given_of, strict_json
from cmm_uq.certificate.verify.views import AHEAD, Signed
from cmm_uq.jobs.dcc import read
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
    return None if head is None else Witness(name, head, sha256(content).hexdigest())


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
        inquiry.left("the records", "the certificate states no head of them: made without, or by an earlier version")
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
    own = f"The certificate is entry {recorded[stated.results_sha256].number} of the records. They "
    told = f"have entry {number}, which it states: nothing up to there was rewritten since."
    inquiry.notes.append(own + (told if number else "were empty when it was made."))
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
