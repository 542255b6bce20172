"""One certificate: how it stands, what it states, what its diagnosis says, who signed it, and its files.

Of the files that its entry names only the very bytes that were recorded are handed out: a name must be one of the entry's, its
path must stay in the certificate's folder without any symbolic link, and what is read must have the recorded SHA-256.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import MEDIA, RefusedRequest, WebRequest, WebResponse, sent_file
from cmm_uq.app.serve.trends import values_table
from cmm_uq.app.serve.view import SiteView, machine_cell, part_cell
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, number, say
from cmm_uq.base.output.manifest import plain_name, read_manifest
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.wording import effect_of, effect_title, probability, size_of
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records.content import unit_of
from cmm_uq.laboratory.records.facts import PART, Entry, RecordedCertificate
from cmm_uq.laboratory.records.listing import entry_of, parts_of
from cmm_uq.maths.uncertainty.quantity import Quantity


def certificate_page(view: SiteView, request: WebRequest) -> p.WebPage:
    request.only(("entry",))
    one, entry = _named(view, request)
    folder = Path(one.folder)
    files = files_of(entry, folder, view.records.signed(one.entry))
    values = [(value.quantity, value.unit, value) for value in one.values]
    decided, standing = decided_words(one)
    stated, part = Verdicts.of_results(entry.data), parts_of(view.records, [one.entry]).get(one.entry)
    return p.page(
        "certificate.html", "/parts" if one.command == PART else "/certificates", one=one, entry=entry,
        machine=machine_cell(one.machine), decided=decided, part=part and part_cell(part), of_part=part,
        origin=None if one.origin == "measured" else p.ORIGINS.get(one.origin, Verbatim(one.origin)), standing=standing,
        warning=p.NOT_MEASURED.get(one.origin), decision=p.cell_of(p.DECISIONS, one.decision),
        outcomes=[(f"{each.by}, {each.name}" if each.by else each.title or each.name, p.cell_of(p.DECISIONS, each.outcome))
                  for each in stated if len(stated) > 1 or not each.by],
        verdict=p.cell_of(p.VERDICTS, one.diagnosis),
        artefact="/artefacts" if any(row.serial == one.artefact for row in view.records.artefacts()) else "",
        values=values_table(say("Values as stated"), values, say("It states no value."), heard=True),
        diagnosis=diagnosed(results_of(files, folder).get("diagnosis")), signatures=_signatures(view, one),
        files=_files(one, files),
    )  # fmt: skip


def recorded_file(view: SiteView, request: WebRequest) -> WebResponse:
    request.only(("entry", "name", "keep"))
    keep, name = request.one_of("keep", ("yes",)) == "yes", request.text("name")
    one, entry = _named(view, request)
    for file in files_of(entry, Path(one.folder), view.records.signed(one.entry)):
        if file.name == name:
            return sent_file(file.name, content_of(file, Path(one.folder)), keep=keep)
    problem = say("the certificate {number} has no file of that name", number=Verbatim(one.number))
    raise RefusedRequest(HTTPStatus.NOT_FOUND, problem)


def _named(view: SiteView, request: WebRequest) -> tuple[RecordedCertificate, Entry]:
    entry_number = request.count("entry", 0)
    if not entry_number:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("the address names no entry of the records"))
    entry = entry_of(view.records, entry_number)
    try:
        one = view.records.certificate(entry_number)
    except CmmUqError:
        entry = None
    if entry is None:
        problem = say("entry {number} is no certificate", number=number(entry_number))
        raise RefusedRequest(HTTPStatus.NOT_FOUND, problem)
    return one, entry


def decided_words(one: RecordedCertificate) -> tuple[Text, Standing]:
    """What it decides and whether it holds, taken together as the worse of both; nothing of a diagnosis."""
    if one.command == "diagnose":
        return NOTHING, "open"
    state, stands = p.STATES.get(one.state, (Verbatim(one.state), "open"))
    decision, conforms = p.DECISIONS.get(one.decision, (Verbatim(one.decision), "open"))
    worse: Standing = max(stands or "good", conforms or "good", key=("good", "open", "bad").index)
    if one.decision == "none":
        return say("{state}; it states no conformity", state=state), worse
    return say("{state}; decision: {decision:small}", state=state, decision=decision), worse


def _signatures(view: SiteView, one: RecordedCertificate) -> p.PageTable:
    words = {"release": say("Released"), "withdrawal": say("Withdrawn"), "replacement": say("Replaced")}
    headings = p.columns(say("What"), say("By"), say("When"), say("Reason"), say("In its place"))
    rows = tuple(
        (p.Cell(words.get(each.what, Verbatim(each.what))), p.Cell(p.shown(each.by)), p.Cell(p.moment(each.at)),
         p.Cell(Verbatim(each.reason)),
         p.Cell(NOTHING) if each.replaced_by is None else
         p.Cell(say("entry {number}", number=number(each.replaced_by)), p.address("/certificate", entry=each.replaced_by)))
        for each in view.records.signatures(one.entry)
    )  # fmt: skip
    return p.PageTable(say("Who released, withdrew or replaced it"), headings, rows, heard=True)


def _files(one: RecordedCertificate, files: tuple[RecordedFile, ...]) -> p.PageTable:
    headings = p.columns(say("File"), say("Keep"), say("SHA-256 as recorded"))
    rows = tuple(
        (
            p.Cell(Verbatim(file.name), p.address("/recorded", entry=one.entry, name=file.name) if file.shown else ""),
            p.Cell(say("Download {name}", name=Verbatim(file.name)),
                 p.address("/recorded", entry=one.entry, name=file.name, keep="yes"), download=True),
            p.Cell(Verbatim(file.sha256)),
        )
        for file in files
    )  # fmt: skip
    empty = say("The records name no file that is still there.")
    note = say("In {folder}. A file is handed out only while it is, byte for byte, the one that was recorded.",
               folder=p.shown(one.folder))  # fmt: skip
    return p.PageTable(say("Files as recorded"), headings, rows, empty, (note,), heard=True)


class Diagnosed(NamedTuple):
    """A diagnosis as results.json has it, in words."""

    facts: list[tuple[Text, p.Cell]]
    effects: p.PageTable | None
    sentences: list[Text]


def diagnosed(diagnosis: Any) -> Diagnosed | None:
    if not isinstance(diagnosis, Mapping) or not diagnosis.get("verdict"):
        return None
    facts: list[tuple[Text, p.Cell]] = [(say("Verdict"), p.cell_of(p.VERDICTS, str(diagnosis["verdict"])))]
    if isinstance(p_value := diagnosis.get("p_value"), (int, float)):
        facts.append((say("Lack-of-fit test, p"), p.Cell(probability(float(p_value)))))
    rows = tuple(filter(None, map(_effect, _list(diagnosis.get("effects")))))
    headings = p.columns(say("Effect"), (say("Probability"), "number"), say("Size"))
    effects = p.PageTable(say("What the model leaves out"), headings, rows) if rows else None
    alike = [group for group in _list(diagnosis.get("indistinguishable")) if isinstance(group, list)]
    each = [commas(effect_title(str(name)) for name in group) for group in alike]
    sentences: list[Text] = [say("This recording cannot tell apart: {names}.", names=names) for names in each]
    further = [one.get("what") for one in _list(diagnosis.get("suggested_measurements")) if isinstance(one, Mapping)]
    sentences += [say("Measure next: {what}", what=Verbatim(str(what))) for what in further if what]
    return Diagnosed(facts, effects, sentences)


def _effect(one: Any) -> tuple[p.Cell, ...]:
    if not isinstance(one, Mapping) or not one.get("effect"):
        return ()
    name, chance, stated = str(one["effect"]), one.get("probability"), one.get("parameters")
    sizes: dict[str, Quantity] = {}
    for key, value in (stated if isinstance(stated, Mapping) else {}).items():
        try:
            (low, high), own = map(float, value["interval95"]), unit(unit_of(str(key)))
            sizes[str(key)] = Quantity(float(value["value"]), float(value["u"]), (low, high), own)
        except (TypeError, KeyError, ValueError):  # not whole
            continue
    size = size_of(effect_of(name), sizes, factors=False) if sizes else NOTHING
    chance_text = probability(float(chance)) if isinstance(chance, (int, float)) else DASH
    return p.Cell(effect_title(name)), p.Cell(chance_text), p.Cell(size)


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


LARGEST = 128 * 2**20  # bytes of a file that the page hands out


class RecordedFile(NamedTuple):
    """One file of a certificate: its name, and the SHA-256 that was recorded of it."""

    name: str
    sha256: str

    @property
    def shown(self) -> bool:
        return Path(self.name).suffix.lower() in MEDIA


def files_of(entry: Entry, folder: Path, signed: Mapping[str, str] = MappingProxyType({})) -> tuple[RecordedFile, ...]:
    """What an entry names, by name; of an entry that names none, what the manifest in the folder does.

    A manifest is believed only where it names the results.json that the entry does; ``signed``: SHA-256 of the files that
    were signed since, by name.
    """
    named = hashes(entry.data)
    results = str(entry.data.get("results_sha256") or "")
    if not named:
        manifest = read_manifest(folder)
        there = dict(manifest.files) if manifest is not None else {}
        named = there if results and there.get("results.json") == results else {}
    return tuple(RecordedFile(name, signed.get(name, named[name])) for name in sorted(named) if plain_name(name))


def hashes(data: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 by name, as an entry's content has them."""
    files = data.get("files")
    each = files.items() if isinstance(files, Mapping) else ()
    stated = ((str(name), one.get("sha256") if isinstance(one, Mapping) else one) for name, one in each)
    return {name: one for name, one in stated if isinstance(one, str)}


def content_of(file: RecordedFile, folder: Path) -> bytes:
    name, place = Verbatim(file.name), Verbatim(str(folder))

    def refused(problem: Text, fix: Text = NOTHING, status: HTTPStatus = HTTPStatus.CONFLICT) -> RefusedRequest:
        return RefusedRequest(status, problem, fix)

    if not plain_name(file.name):
        raise refused(say("{name} is no file of a certificate", name=name), status=HTTPStatus.NOT_FOUND)
    path = folder
    for part in file.name.split("/"):
        path = path / part
        if path.is_symlink():
            raise refused(say("{name} is a link to another place by now", name=name))
    try:
        if not path.is_file():
            raise refused(say("{name} is not in its folder any more", name=name),
                          say("The records name the folder {folder}", folder=place), HTTPStatus.GONE)  # fmt: skip
        if path.stat().st_size > LARGEST:
            raise refused(say("{name} is too large for a browser", name=name), say("It lies in {folder}", folder=place))
        content = path.read_bytes()
    except OSError as error:
        why = Verbatim(error.strerror or "the disk fails")
        raise refused(say("{name} cannot be read: {why}", name=name, why=why)) from None
    if sha256(content).hexdigest() != file.sha256:
        problem = say("{name} is not the file that was recorded: it was altered since", name=name)
        raise refused(problem, say("The page hands out recorded files only; this one lies in {folder}", folder=place))
    return content


def results_of(files: tuple[RecordedFile, ...], folder: Path) -> dict[str, Any]:
    """The recorded results.json; empty where it is not there as it was recorded."""
    for file in files:
        if file.name == "results.json":
            try:
                results = json.loads(content_of(file, folder))
            except (RefusedRequest, ValueError, RecursionError):
                return {}
            return results if isinstance(results, dict) else {}
    return {}
