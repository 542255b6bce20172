"""The history of a machine as a document."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.base.messages import DASH, Text, Verbatim, commas, day, plural, say
from cmm_uq.certificate.document import Block, Column, Document, Facts, Overview, Paragraph, Section, Standing, Table
from cmm_uq.certificate.history_words import HEADINGS, STATE_WORDS, WORDS, meets, notes, value_row
from cmm_uq.certificate.trend_plot import trend_plot
from cmm_uq.certificate.wording import OUTCOME_WORDS
from cmm_uq.jobs.verdicts import BEYOND, NONE
from cmm_uq.laboratory.due.history import MachineHistory
from cmm_uq.laboratory.records.facts import RecordedCertificate


def history_document(history: MachineHistory) -> Document:
    """The page of a machine."""
    machine = history.machine
    return Document(
        title=say("History of a machine"),
        number=Verbatim(machine.serial),
        subject=say("{name}, up to {on}", name=Verbatim(machine.name), on=day(history.on)),
        issuer=(),
        particulars=(Facts(_particulars(history)),),
        warnings=history.remarks,
        sections=tuple(
            section
            for section in (
                Section(say("Values and trends"), _values(history)),
                Section(say("Over time"), tuple(trend_plot(history, one) for one in history.values)),
                Section(say("Certificates and interim checks"), _certificates(history)),
            )
            if section.blocks
        ),
        statements=(),
        signatures=(),
        attachments=(Verbatim("history.json"),),
        produced_by=say("cmm-uq {version}", version=Verbatim(__version__)),
        end=say("End of history"),
        overview=overview_of(history),
    )


def overview_of(history: MachineHistory) -> Overview:
    """Whether anything is beyond its limit, and what changed."""
    beyond = [Verbatim(one.series.quantity) for one in history.values if one.beyond]
    probable = [Verbatim(one.series.quantity) for one in history.values if one.probably_beyond(history.on)]
    changed = [Verbatim(one.series.quantity) for one in history.values if history.significant(one)]
    last = history.decision
    fails, open_ = bool(beyond) or last in BEYOND, last not in (*BEYOND, "pass", NONE)
    standing: Standing = "bad" if fails else "open" if open_ or probable or changed or not history.values else "good"
    verdicts = (
        (not history.values, say("Nothing is recorded yet")), (fails, say("Beyond its limits")),
        (open_, say("Its last certificate does not state that it conforms")),
        (bool(probable), say("Probably beyond a limit by now")), (bool(changed), say("Changed since the last time")),
    )  # fmt: skip
    verdict = next((text for holds, text in verdicts if holds), say("No change that stands out"))
    rows: list[tuple[Text, Text]] = []
    if last != NONE:
        rows.append((say("Last decision"), OUTCOME_WORDS.get(last, Verbatim(last))))
    if beyond:
        rows.append((say("Beyond a limit"), commas(beyond)))
    if changed:
        rows.append((say("Changed significantly"), commas(changed)))
    nearest = min(
        (
            (day, i) for i, one in enumerate(history.values)
            if one.crossing is not None and not one.beyond and (day := one.crossing.quantile(0.5)) is not None
        ), default=None,
    )  # fmt: skip
    if nearest is not None:
        first = history.values[nearest[1]]
        rows.append((say("First to cross its limit"), say(
            "{name}: {when}", name=Verbatim(first.series.quantity), when=meets(first, history.on),
        )))  # fmt: skip
    return Overview(verdict, standing, tuple(rows))


def _particulars(history: MachineHistory) -> tuple[tuple[Text, Text], ...]:
    machine = history.machine
    said = (
        (say("Machine"), machine.name), (say("Serial number"), "" if machine.by_name else machine.serial),
        (say("Manufacturer"), machine.manufacturer), (say("Model"), machine.model), (say("Place"), machine.place),
    )  # fmt: skip
    rows: list[tuple[Text, Text]] = [(label, Verbatim(text)) for label, text in said if text]
    rows.append((say("Recordings"), _counted(history)))
    if machine.adjusted:
        rows.append((say("Adjusted"), commas([day(one) for one in machine.adjusted])))
    return tuple(rows)


def _counted(history: MachineHistory) -> Text:
    checks = sum(one.interim for one in history.certificates)
    count = len(history.certificates) - checks
    told = plural(count, one=say("one certificate"), many=say("{count} certificates", count=count))
    if not checks:
        return told
    more = plural(checks, one=say("one interim check"), many=say("{count} interim checks", count=checks))
    return say("{certificates}, {checks}", certificates=told, checks=more)


def _values(history: MachineHistory) -> tuple[Block, ...]:
    if not history.values:
        return (Paragraph(say("No value of this machine is recorded.")),)
    columns = tuple(Column(heading, numeric=heading not in WORDS) for heading in HEADINGS)
    rows = tuple(value_row(history, one) for one in history.values)
    return (Table(say("Error factors and figures of performance"), columns, rows, notes(history)),)


def _certificates(history: MachineHistory) -> tuple[Block, ...]:
    if not history.certificates:
        return ()
    heads = (
        say("Date"),
        say("Number"),
        say("What"),
        say("State"),
        say("Artefact"),
        say("Decision"),
        say("Adjusted before"),
    )
    rows = tuple(_row(one) for one in reversed(history.certificates))
    return (Table(say("Newest first"), tuple(Column(head, numeric=False) for head in heads), rows),)


def _row(one: RecordedCertificate) -> tuple[Text, ...]:
    return (
        day(one.day), Verbatim(one.number), say("interim check") if one.interim else say("certificate"),
        STATE_WORDS.get(one.state, Verbatim(one.state)), Verbatim(one.artefact) if one.artefact else DASH,
        OUTCOME_WORDS.get(one.decision, DASH), DASH if one.adjusted_since is None else day(one.adjusted_since),
    )  # fmt: skip
