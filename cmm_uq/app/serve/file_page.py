"""A file is dropped, and the page says whether the records know its very bytes."""

from __future__ import annotations

from cmm_uq.app.serve.exchange import Asked
from cmm_uq.app.serve.looking_up import Known, look_up
from cmm_uq.app.serve.page import Block, Cell, Drop, Facts, Notice, Page, Paragraph, Section, address
from cmm_uq.app.serve.uploaded import LARGEST, Dropped, read_dropped
from cmm_uq.app.serve.view import View, machine_cell
from cmm_uq.app.serve.words import NOT_MEASURED
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.facts import Certificate

_SCOPE = say(
    "What is compared is the SHA-256 of the whole file with those in the records. No signature is checked, nothing is "
    "computed anew, and the records themselves are taken as they are: whether they agree with their chain, Integrity says."
)


def file_page(view: View, asked: Asked) -> Page:
    """The form.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
    asked.only(())
    return Page(say("Check a file"), "/file",
                lead=say("Is this certificate the one that was issued, and does it still hold?"), blocks=_form())  # fmt: skip


def dropped_page(view: View, asked: Asked) -> Page:
    """What the records know of the file in the request.

    Raises
    ------
    Refused : there is none, or it is too large.
    """
    asked.only(())
    dropped = read_dropped(asked)
    known = look_up(view.records, dropped)
    return Page(
        say("Check a file"), "/file", lead=Verbatim(dropped.name),
        blocks=(verdict(known), _facts(known, dropped), Paragraph(_SCOPE, "note")),
        sections=(Section(say("Another file"), _form()),),
    )  # fmt: skip


def _form() -> tuple[Block, ...]:
    hint = say(
        "A certificate as PDF or HTML, or its results.json; at most {most} MB. It is read once and not kept.",
        most=number(LARGEST // 2**20),
    )
    return (Drop("/file", say("Drop a file here, or choose one"), hint, say("Check it")),)


def verdict(known: Known) -> Notice:
    """What is said first of a file."""
    if known.certificate is None:
        return Notice(say("Unknown: no certificate of these records"), "open", _unknown(known))
    if known.how == "altered":
        told = (
            say("It says that it is {number}, which is in the records, but its bytes are none of those that were recorded.",
                number=Verbatim(known.says)),
            say("It was changed after it was made, or made again without being recorded here. Do not rely on it."),
        )  # fmt: skip
        return Notice(say("Altered: not the file that was recorded"), "bad", tuple(Cell(line) for line in told))
    return _of_state(known.certificate)


def _of_state(one: Certificate) -> Notice:
    heads: dict[str, tuple[Text, Standing]] = {
        "released": (say("Known and released"), "good"),
        "draft": (say("Known, but a draft: nobody has released it"), "open"),
        "withdrawn": (say("Known, but withdrawn: do not rely on it"), "bad"),
        "replaced": (say("Known, but replaced by another certificate: do not rely on it"), "bad"),
    }
    head, standing = heads.get(one.state, (say("Known; its state is {state}", state=Verbatim(one.state)), "open"))
    if one.command != "report":
        head, standing = say("Known: a diagnosis, which is no certificate"), "open"
    lines: list[Text] = [say("Its bytes are those that were recorded.")]
    if (warning := NOT_MEASURED.get(one.origin)) is not None:
        lines, standing = [*lines, warning], "bad" if standing == "bad" else "open"
    return Notice(head, standing, tuple(Cell(line) for line in lines))


def _unknown(known: Known) -> tuple[Cell, ...]:
    lines = [say("Its bytes are not in the records.")]
    if known.says:
        lines.append(say("It says that it is {number}, which is not in them either.", number=Verbatim(known.says)))
    else:
        lines.append(say("It says no number by which it could be found: it may be of another program, a file beside a "
                         "certificate, or damaged."))  # fmt: skip
    return tuple(Cell(line) for line in lines)


def _facts(known: Known, dropped: Dropped) -> Facts:
    rows: list[tuple[Text, Cell]] = []
    if (one := known.certificate) is not None:
        name = say("recorded as {name}", name=Verbatim(known.name)) if known.name else NOTHING
        rows = [
            (say("Certificate"), Cell(Verbatim(one.number), address("/certificate", entry=one.entry), note=name)),
            (say("Machine"), machine_cell(one.machine)),
            (say("Measured on"), Cell(day(one.day))),
        ]
    size = say("{bytes} bytes", bytes=number(dropped.size, ",d"))
    return Facts((*rows, (say("Size"), Cell(size)), (say("SHA-256"), Cell(Verbatim(dropped.sha256)))), wide=True)
