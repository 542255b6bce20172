"""One certificate: how it stands, what it states, what its diagnosis says, who signed it, and its files."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse
from cmm_uq.app.serve.page import (
    DECISIONS,
    NOT_MEASURED,
    ORIGINS,
    STATES,
    VERDICTS,
    Block,
    Cell,
    PageFacts,
    PageNotice,
    PageParagraph,
    PageSection,
    PageTable,
    WebPage,
    address,
    cell_of,
    columns,
    moment,
    shown,
)
from cmm_uq.app.serve.recorded_files import RecordedFile, content_of, files_of, results_of, sent
from cmm_uq.app.serve.trends import values_table
from cmm_uq.app.serve.view import SiteView, machine_cell
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, number, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.wording import effect_of, effect_title, probability, size_of
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records.content import unit_of
from cmm_uq.laboratory.records.facts import Entry, RecordedCertificate, RecordedValue
from cmm_uq.laboratory.records.listing import entry_of
from cmm_uq.maths.uncertainty.quantity import Quantity


def certificate_page(view: SiteView, asked: WebRequest) -> WebPage:
    """The certificate whose entry the address names."""
    asked.only(("entry",))
    one, entry = _named(view, asked)
    folder = Path(one.folder)
    files = files_of(entry, folder, view.records.signed(one.entry))
    number = Verbatim(one.number)
    if one.command != "report":
        title = say("Diagnosis {number}", number=number)
    else:
        title = (
            say("Interim check {number}", number=number) if one.interim else say("Certificate {number}", number=number)
        )
    return WebPage(
        title, "/certificates",
        lead=_lead(one),
        above=(Cell(say("Certificates"), "/certificates"), machine_cell(one.machine)),
        blocks=(*_notices(one), _facts(view, one, entry)),
        sections=(
            PageSection(say("Values"), (_values(one.values),)),
            *_diagnosed(results_of(files, folder)),
            *_signed(view, one),
            PageSection(say("Files"), tuple(_files(one, files))),
        ),
    )  # fmt: skip


def _lead(one: RecordedCertificate) -> Text:
    machine, date = Verbatim(one.machine), day(one.day)
    if one.origin == "measured":
        return say("Machine {machine}, measured on {day}", machine=machine, day=date)
    return say("Machine {machine}, {origin:small} recording of {day}", machine=machine, day=date,
               origin=ORIGINS.get(one.origin, Verbatim(one.origin)))  # fmt: skip


def recorded_file(view: SiteView, asked: WebRequest) -> WebResponse:
    """A file of a certificate, as it was recorded."""
    asked.only(("entry", "name", "keep"))
    keep, name = asked.one_of("keep", ("yes",)) == "yes", asked.text("name")
    one, entry = _named(view, asked)
    for file in files_of(entry, Path(one.folder), view.records.signed(one.entry)):
        if file.name == name:
            return sent(file, content_of(file, Path(one.folder)), keep=keep)
    raise RefusedRequest(
        HTTPStatus.NOT_FOUND, say("the certificate {number} has no file of that name", number=Verbatim(one.number))
    )


def _named(view: SiteView, asked: WebRequest) -> tuple[RecordedCertificate, Entry]:
    number_of = asked.count("entry", 0)
    if not number_of:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("the address names no entry of the records"))
    entry = entry_of(view.records, number_of)
    try:
        one = view.records.certificate(number_of)
    except CmmUqError:
        entry = None
    if entry is None:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("entry {number} is no certificate", number=number(number_of)))
    return one, entry


def _notices(one: RecordedCertificate) -> list[PageNotice]:
    """What it decides and whether it holds, taken together as the worse of both; before that, that nothing was measured."""
    warning = NOT_MEASURED.get(one.origin)
    found = [PageNotice(warning, "open")] if warning is not None else []
    if one.command != "report":
        return found
    state, stands = STATES.get(one.state, (Verbatim(one.state), "open"))
    decision, conforms = DECISIONS.get(one.decision, (Verbatim(one.decision), "open"))
    worse: Standing = max(stands or "good", conforms or "good", key=("good", "open", "bad").index)
    if one.decision == "none":
        return [*found, PageNotice(say("{state}; it states no conformity", state=state), worse)]
    return [*found, PageNotice(say("{state}; decision: {decision:small}", state=state, decision=decision), worse)]


def _facts(view: SiteView, one: RecordedCertificate, entry: Entry) -> PageFacts:
    artefact = next((row for row in view.records.artefacts() if row.serial == one.artefact), None)
    stated = Verdicts.of_results(entry.data)
    rows: list[tuple[Text, Cell]] = [
        (say("Decision"), cell_of(DECISIONS, one.decision)),
        *(
            (
                Verbatim(f"{each.by}, {each.name}" if each.by else each.title or each.name),
                cell_of(DECISIONS, each.outcome),
            )
            for each in stated
            if len(stated) > 1 or not each.by
        ),
        (say("Diagnosis"), cell_of(VERDICTS, one.diagnosis)),
        (say("Machine"), machine_cell(one.machine)),
        (say("Artefact"), Cell(shown(one.artefact), "/artefacts" if artefact else "")),
        (say("Measurement"), Cell(shown(one.kind))),
        (say("Job"), Cell(shown(one.job))),
    ]
    if one.adjusted_since is not None:
        rows.append((say("Adjusted before, on"), Cell(day(one.adjusted_since))))
    rows += [
        (say("Recorded"), Cell(moment(one.recorded))),
        (say("Made by"), Cell(say("cmm-uq {version}", version=Verbatim(one.version)) if one.version else DASH)),
        (say("Entry of the records"), Cell(number(one.entry), note=Verbatim(entry.hash))),
    ]
    return PageFacts(tuple(rows))


def _values(values: tuple[RecordedValue, ...]) -> PageTable:
    rows = [(one.quantity, one.unit, one) for one in values]
    return values_table(say("Values as stated"), rows, say("It states no value."), heard=True)


def _diagnosed(results: Mapping[str, Any]) -> tuple[PageSection, ...]:
    """Words for effects load half of the package: only where a diagnosis is shown."""
    if not isinstance(results.get("diagnosis"), Mapping):
        return ()

    return diagnosis_section(results["diagnosis"])


def _signed(view: SiteView, one: RecordedCertificate) -> tuple[PageSection, ...]:
    found = view.records.signatures(one.entry)
    if not found:
        return ()
    words = {"release": say("Released"), "withdrawal": say("Withdrawn"), "replacement": say("Replaced")}
    headings = columns(say("What"), say("By"), say("When"), say("Reason"), say("In its place"))
    rows = tuple(
        (Cell(words.get(each.what, Verbatim(each.what))), Cell(shown(each.by)), Cell(moment(each.at)),
         Cell(Verbatim(each.reason)),
         Cell(NOTHING) if each.replaced_by is None else
         Cell(say("entry {number}", number=number(each.replaced_by)), address("/certificate", entry=each.replaced_by)))
        for each in found
    )  # fmt: skip
    return (
        PageSection(
            say("Release"), (PageTable(say("Who released, withdrew or replaced it"), headings, rows, heard=True),)
        ),
    )


def _files(one: RecordedCertificate, files: tuple[RecordedFile, ...]) -> list[Block]:
    headings = columns(say("File"), say("Keep"), say("SHA-256 as recorded"))
    rows = tuple(
        (
            Cell(Verbatim(file.name), address("/recorded", entry=one.entry, name=file.name) if file.shown else ""),
            Cell(say("Download {name}", name=Verbatim(file.name)),
                 address("/recorded", entry=one.entry, name=file.name, keep="yes"), download=True),
            Cell(Verbatim(file.sha256)),
        )
        for file in files
    )  # fmt: skip
    empty = say("The records name no file that is still there.")
    note = say("In {folder}. A file is handed out only while it is, byte for byte, the one that was recorded.",
               folder=shown(one.folder))  # fmt: skip
    return [PageTable(say("Files as recorded"), headings, rows, empty, (note,), heard=True)]


def diagnosis_section(found: Mapping[str, Any]) -> tuple[PageSection, ...]:
    """A section, where there is a verdict."""
    if not found.get("verdict"):
        return ()
    blocks: list[Block] = [PageFacts(tuple(_verdict(found)))]
    rows = tuple(row for one in _list(found.get("effects")) if (row := _effect(one)) is not None)
    if rows:
        headings = columns(say("Effect"), (say("Probability"), "number"), say("Size"))
        blocks.append(PageTable(say("What the model leaves out"), headings, rows))
    pairs = [one for one in _list(found.get("indistinguishable")) if isinstance(one, list)]
    for pair in pairs:
        names = commas(effect_title(str(name)) for name in pair)
        blocks.append(PageParagraph(say("This recording cannot tell apart: {names}.", names=names)))
    asked = [one.get("what") for one in _list(found.get("suggested_measurements")) if isinstance(one, Mapping)]
    blocks += [PageParagraph(say("Measure next: {what}", what=Verbatim(str(what)))) for what in asked if what]
    return (PageSection(say("Diagnosis"), tuple(blocks)),)


def _verdict(found: Mapping[str, Any]) -> list[tuple[Text, Cell]]:
    rows: list[tuple[Text, Cell]] = [(say("Verdict"), cell_of(VERDICTS, str(found["verdict"])))]
    p = found.get("p_value")
    if isinstance(p, (int, float)):
        rows.append((say("Lack-of-fit test, p"), Cell(probability(float(p)))))
    return rows


def _effect(one: Any) -> tuple[Cell, ...] | None:
    if not isinstance(one, Mapping) or not one.get("effect"):
        return None
    name, p = str(one["effect"]), one.get("probability")
    given = one.get("parameters")
    sizes = {str(key): quantity for key, value in (given if isinstance(given, Mapping) else {}).items()
             if (quantity := _quantity(str(key), value)) is not None}  # fmt: skip
    size = size_of(effect_of(name), sizes, factors=False) if sizes else NOTHING
    return Cell(effect_title(name)), Cell(probability(float(p)) if isinstance(p, (int, float)) else DASH), Cell(size)


def _quantity(name: str, value: Any) -> Quantity | None:
    """A quantity of results.json; ``None`` where it is not whole."""
    try:
        low, high = value["interval95"]
        return Quantity(float(value["value"]), float(value["u"]), (float(low), float(high)), unit(unit_of(name)))
    except (TypeError, KeyError, ValueError):
        return None


def _list(found: Any) -> list[Any]:
    return found if isinstance(found, list) else []
