"""One certificate: how it stands, what it states, what its diagnosis says, who signed it, and its files."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from cmm_uq.app.serve.exchange import Answer, Asked, Refused
from cmm_uq.app.serve.page import Block, Cell, Column, Facts, Notice, Page, Section, Table, address
from cmm_uq.app.serve.recorded_files import RecordedFile, content_of, files_of, results_of, sent
from cmm_uq.app.serve.values import values_table
from cmm_uq.app.serve.view import View, machine_cell
from cmm_uq.app.serve.words import DECISIONS, NOT_MEASURED, ORIGINS, STATES, VERDICTS, cell_of, moment, shown
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Standing
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records.entries import Entry
from cmm_uq.laboratory.records.facts import Certificate, Value
from cmm_uq.laboratory.records.listing import entry_of


def certificate_page(view: View, asked: Asked) -> Page:
    """The certificate whose entry the address names.

    Raises
    ------
    Refused : there is none.
    """
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
    return Page(
        title, "/certificates",
        lead=_lead(one),
        above=(Cell(say("Certificates"), "/certificates"), machine_cell(one.machine)),
        blocks=(*_notices(one), _facts(view, one, entry)),
        sections=(
            Section(say("Values"), (_values(one.values),)),
            *_diagnosed(results_of(files, folder)),
            *_signed(view, one),
            Section(say("Files"), tuple(_files(one, files))),
        ),
    )  # fmt: skip


def _lead(one: Certificate) -> Text:
    machine, date = Verbatim(one.machine), day(one.day)
    if one.origin == "measured":
        return say("Machine {machine}, measured on {day}", machine=machine, day=date)
    return say("Machine {machine}, {origin:small} recording of {day}", machine=machine, day=date,
               origin=ORIGINS.get(one.origin, Verbatim(one.origin)))  # fmt: skip


def recorded_file(view: View, asked: Asked) -> Answer:
    """A file of a certificate, as it was recorded.

    Raises
    ------
    Refused : it is not one of the certificate's, or not as it was recorded.
    """
    asked.only(("entry", "name", "keep"))
    keep, name = asked.one_of("keep", ("yes",)) == "yes", asked.text("name")
    one, entry = _named(view, asked)
    for file in files_of(entry, Path(one.folder), view.records.signed(one.entry)):
        if file.name == name:
            return sent(file, content_of(file, Path(one.folder)), keep=keep)
    raise Refused(
        HTTPStatus.NOT_FOUND, say("the certificate {number} has no file of that name", number=Verbatim(one.number))
    )


def _named(view: View, asked: Asked) -> tuple[Certificate, Entry]:
    number_of = asked.count("entry", 0)
    if not number_of:
        raise Refused(HTTPStatus.NOT_FOUND, say("the address names no entry of the records"))
    entry = entry_of(view.records, number_of)
    try:
        one = view.records.certificate(number_of)
    except CmmUqError:
        entry = None
    if entry is None:
        raise Refused(HTTPStatus.NOT_FOUND, say("entry {number} is no certificate", number=number(number_of)))
    return one, entry


def _notices(one: Certificate) -> list[Notice]:
    """What it decides and whether it holds, taken together as the worse of both; before that, that nothing was measured."""
    warning = NOT_MEASURED.get(one.origin)
    found = [Notice(warning, "open")] if warning is not None else []
    if one.command != "report":
        return found
    state, stands = STATES.get(one.state, (Verbatim(one.state), "open"))
    decision, conforms = DECISIONS.get(one.decision, (Verbatim(one.decision), "open"))
    worse: Standing = max(stands or "good", conforms or "good", key=("good", "open", "bad").index)
    if one.decision == "none":
        return [*found, Notice(say("{state}; it states no conformity", state=state), worse)]
    return [*found, Notice(say("{state}; decision: {decision:small}", state=state, decision=decision), worse)]


def _facts(view: View, one: Certificate, entry: Entry) -> Facts:
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
    return Facts(tuple(rows))


def _values(values: tuple[Value, ...]) -> Table:
    rows = [(one.quantity, one.unit, one) for one in values]
    return values_table(say("Values as stated"), rows, say("It states no value."), heard=True)


def _diagnosed(results: Mapping[str, Any]) -> tuple[Section, ...]:
    """Words for effects load half of the package: only where a diagnosis is shown."""
    if not isinstance(results.get("diagnosis"), Mapping):
        return ()
    from cmm_uq.app.serve.diagnosis_section import diagnosis_section

    return diagnosis_section(results["diagnosis"])


def _signed(view: View, one: Certificate) -> tuple[Section, ...]:
    found = view.records.signatures(one.entry)
    if not found:
        return ()
    words = {"release": say("Released"), "withdrawal": say("Withdrawn"), "replacement": say("Replaced")}
    columns = (
        Column(say("What")),
        Column(say("By")),
        Column(say("When")),
        Column(say("Reason")),
        Column(say("In its place")),
    )
    rows = tuple(
        (Cell(words.get(each.what, Verbatim(each.what))), Cell(shown(each.by)), Cell(moment(each.at)),
         Cell(Verbatim(each.reason)),
         Cell(NOTHING) if each.replaced_by is None else
         Cell(say("entry {number}", number=number(each.replaced_by)), address("/certificate", entry=each.replaced_by)))
        for each in found
    )  # fmt: skip
    return (Section(say("Release"), (Table(say("Who released, withdrew or replaced it"), columns, rows, heard=True),)),)


def _files(one: Certificate, files: tuple[RecordedFile, ...]) -> list[Block]:
    columns = (Column(say("File")), Column(say("Keep")), Column(say("SHA-256 as recorded")))
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
    return [Table(say("Files as recorded"), columns, rows, empty, (note,), heard=True)]
