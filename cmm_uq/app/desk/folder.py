"""The folder of a desk: its jobs, what they state by fields, parts, and certificates that are verified.

A certificate that somebody received: who says what in it, what that rests on, and whether it holds.

A part on the desk: its plan and the machine's certificate make a job, and measured points that are dropped on it decide.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, Literal

from cmm_uq.app.desk import job_pages as jobs
from cmm_uq.app.desk.export_pages import check_blocks
from cmm_uq.app.desk.job_pages import DELETE, PART, PLAN, REPORTS, VERIFY, JobState, state_of
from cmm_uq.app.desk.place import (
    ChangedError,
    Draft,
    DraftFolder,
    below,
    jobs_in,
    received,
    safe_name,
    sha256,
    write_over,
)
from cmm_uq.app.desk.workers import Worker
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import DESK, WebRequest, WebResponse, read_form
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of, text_of
from cmm_uq.base.messages import Text, Verbatim, number, say

_RECORDING = re.compile(r"^\[recording\][^\n]*\n", re.MULTILINE)
_FILE = re.compile(r"^file = [^\n]*\n", re.MULTILINE)


def part_page(draft: Draft | None, machines: Iterable[JobState]) -> p.WebPage:
    """A plan to be dropped, then the certificate of the machine to be chosen."""
    certificates = tuple(
        (one.file(".pdf"), say("{id}: {machine}", id=Verbatim(one.id), machine=p.shown(one.machine)))
        for one in machines
        if one.file(".pdf") and not one.part
    )
    blocks: tuple[p.Block, ...]
    if draft is None:
        hint = say("QIF 3.0 with features and tolerances, a DMIS program, or a table of features.")
        blocks = (p.Drop(PLAN, say("Drop the plan of the part here, or choose it"), hint, say("Read it")),)
    elif not certificates:
        blocks = (p.PageNotice(say("No certificate of a machine lies in this folder yet: make one first"), "open"),)
    else:
        no_yes: tuple[tuple[str, Text], ...] = (
            ("", say("is refused by its name")),
            ("yes", say("is left out, and named")),
        )
        fields = (
            p.FormEntry("folder", say("Name of the job, and of its folder"), example="bracket-7"),
            p.FormEntry("certificate", say("Certificate of the machine"), "", "select", certificates),
            p.FormEntry("date", say("Date of the measurement"), "", "date"),
            p.FormEntry("not_measured", say("What of the plan is not understood"), "", "select", no_yes),
        )
        given = (("draft", draft.id),)
        delete = p.PageForm(DELETE, (), (("delete", say("Delete this plan")),), given)
        blocks = (p.PageForm(PART, fields, (("create", say("Make the job")),), given), delete)
    lead = say("Features and tolerances from its plan, errors from the certificate of the machine.")
    return p.WebPage(say("A part"), DESK, lead, blocks, above=(p.Cell(say("Desk"), DESK),))


def with_points(text: str, name: str) -> str:
    """job.toml with the file of its measured points; nothing else is changed."""
    line = f'file = "{name}"\n'
    found = _RECORDING.search(text)
    if found is None:
        return f"{text.rstrip()}\n\n[recording]\n{line}"
    end = text.find("\n[", found.end())
    block = text[found.end() : end + 1 if end >= 0 else len(text)]
    changed = _FILE.sub(lambda _: line, block, count=1) if _FILE.search(block) else line + block
    return text[: found.end()] + changed + text[found.end() + len(block) :]


_HINT = say(
    "PDF, HTML, XML (DCC) or results.json of a certificate, or of the report of a part. It is read once and not kept."
)


def verify_page(name: str = "", found: Mapping[str, Any] | None = None) -> p.WebPage:
    """The form, below what was found of the file that was dropped."""
    form = p.Drop(VERIFY, say("Drop a certificate here, or choose one"), _HINT, say("Verify it"))
    above = (p.Cell(say("Desk"), DESK),)
    lead = say("Who says what, what it rests on, and whether it holds.")
    if found is None:
        return p.WebPage(say("Verify a certificate"), DESK, lead, (form,), above=above)
    word: Text = say("Something in it is wrong: do not rely on it")
    if found["word"] == "VERIFIED":
        word = say("Its files, figures and decisions agree with each other and with its inputs")
    elif not found["findings"]:
        word = say("Nothing in it is wrong, but not all of it could be checked from this file")
    standing: Literal["good", "open", "bad"] = (
        "bad" if found["findings"] else "good" if found["word"] == "VERIFIED" else "open"
    )
    head = p.PageNotice(Verbatim(found["said"]), standing, (p.Cell(word), p.Cell(Verbatim(found["signed"]))))
    rows = tuple(
        (
            p.Cell(say("wrong") if wrong else say("right"), standing="bad" if wrong else "good"),
            p.Cell(Verbatim(what)),
            p.Cell(number(count, ",d")),
        )
        for wrong, what, count in found["checks"]
    )
    headings = p.columns(say("Is"), say("What"), (say("Things"), "number"))
    table = p.PageTable(say("Comparisons"), headings, rows, heard=True)
    wrong: tuple[p.Block, ...] = tuple(p.PageParagraph(Verbatim(one)) for one in found["findings"])
    left: tuple[p.Block, ...] = tuple(p.PageParagraph(Verbatim(one), "note") for one in found["unchecked"])
    again = p.SourceText(say("Command"), f"cmm-uq verify {name}")
    records = p.Links((p.Cell(say("Is it in the records of this folder?"), "/file"),))
    sections = [(say("What is wrong"), wrong)] if wrong else []
    sections += [
        (say("What was compared"), (table,)),
        (say("What was not"), (*left, again, records)),
        (say("Another file"), (form,)),
    ]
    return p.WebPage(say("Verify a certificate"), DESK, Verbatim(name), (head,), tuple(sections), above)


VERIFY_S = 180.0  # s that reading and comparing a certificate may take


def to(path: str, **query: str) -> WebResponse:
    """After a form: a page to be got, so that reload sends nothing again."""
    return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": p.address(path, **query)})


class DeskFolder:
    """``root``: the folder that a desk works in."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.drafts, self.reader = DraftFolder(self.root), Worker(self.root)

    def job_of(self, name: str) -> str:
        """A job by its path below the root."""
        folder = below(self.root, name)
        below(self.root, f"{name}/job.toml")
        return folder.relative_to(self.root).as_posix()

    def facts(self, request: WebRequest) -> p.WebPage:
        request.only(("name",))
        name = self.job_of(request.text("name"))
        content = self._job_file(name)
        found = self.reader.ask("facts", text=text_of(content, "job.toml"))
        return jobs.facts_page(name, found, found["values"], sha256(content), ())

    def _job_file(self, name: str) -> bytes:
        return content_of(self.root / name / "job.toml", JOB_BYTES, "")

    def with_facts(self, name: str, form: Mapping[str, str]) -> tuple[str, str]:
        """Text of job.toml with the fields of a form, and the SHA-256 of the file that they change."""
        content = self._job_file(name)
        values = {key: value for key, value in form.items() if "." in key}
        return self.reader.ask("with_facts", text=text_of(content, "job.toml"), values=values), sha256(content)

    def state_facts(self, request: WebRequest) -> p.WebPage | WebResponse:
        form = read_form(request)
        name, seen = self.job_of(form.get("name", "")), form.get("seen", "")
        text, now = self.with_facts(name, form)
        if form.get("then") == "save" and now == seen:
            try:
                write_over(self.root / name / "job.toml", text.encode(), seen)
                return to(jobs.JOB, name=name)
            except ChangedError as changed:
                now = sha256(changed.now)
        found = self.reader.ask("facts", text=text_of(self._job_file(name), "job.toml"))
        if now != seen:
            page = jobs.facts_page(name, found, form, now, (jobs.differing(found, form),))
            return page._replace(status=HTTPStatus.CONFLICT)
        checked = check_blocks(self.reader.ask("check", job=name, text=text))
        return jobs.facts_page(name, found, form, seen, checked)

    def part(self, request: WebRequest) -> p.WebPage:
        request.only(("draft",))
        draft = self.drafts.read(request.text("draft")) if request.text("draft") else None
        return part_page(draft, (state_of(self.root, folder) for folder in jobs_in(self.root)))

    def plan(self, request: WebRequest) -> WebResponse:
        one = self.drafts.take(request)
        one.values = {"part": "plan"}
        self.drafts.write(one)
        return to(jobs.PART, draft=one.id)

    def create_part(self, request: WebRequest) -> WebResponse:
        form = read_form(request)
        one, folder = self.drafts.read(form.get("draft", "")), form.get("folder", "").strip()
        self.check_new(folder)
        certificate = below(self.root, form.get("certificate", "")).relative_to(self.root).as_posix()
        self.reader.ask(
            "create_part",
            plan=one.export,
            certificate=certificate,
            folder=folder,
            date=form.get("date", ""),
            not_measured=form.get("not_measured") == "yes",
        )
        self.drafts.delete(one)
        return to(jobs.JOB, name=folder)

    def points(self, request: WebRequest) -> WebResponse:
        """Measured points of a part, into its folder and its job.toml."""
        request.only(("name",))
        name = self.job_of(request.text("name"))
        path = self.root / name / "job.toml"
        content = content_of(path, JOB_BYTES, "")
        points = received(request, path.parent)
        write_over(path, with_points(content.decode(), points).encode(), sha256(content))
        return to(jobs.JOB, name=name)

    def verify(self, request: WebRequest) -> p.WebPage:
        request.only(())
        with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder:
            name = received(request, Path(folder), written=True)
            return verify_page(name, self.reader.ask("verification", seconds=VERIFY_S, path=str(Path(folder) / name)))

    def check_new(self, name: str) -> None:
        if not name or safe_name(name) != name or name == REPORTS:
            fix = "Use letters, digits, - and _, such as K-2026-115"
            raise CmmUqError(f"{name!r} is no name of a folder on every system", fix=fix)
