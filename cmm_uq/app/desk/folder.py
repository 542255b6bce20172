"""The folder of a desk: its jobs, what they state by fields, parts, and certificates that are verified.

A certificate that somebody received: who says what in it, what that rests on, and whether it holds.

A part on the desk: its plan and the machine's certificate make a job, and measured points that are dropped on it decide.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from cmm_uq.app.desk import job_pages as jobs, place
from cmm_uq.app.desk.job_pages import REPORTS, state_of
from cmm_uq.app.desk.workers import Worker
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.application import Application
from cmm_uq.app.serve.exchange import DESK, WebRequest, WebResponse, read_form, to
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of, text_of
from cmm_uq.base.messages import Verbatim, number, say

VERIFY_S = 180.0  # s that reading and comparing a certificate may take


def facts_page(
    name: str, found: Mapping[str, Any], values: Mapping[str, str], seen: str, check: Any = None, differing: Any = ()
) -> p.WebPage:
    """What a job states, by fields; what else stands in its job.toml stays as it is."""
    return p.page(
        "desk/facts.html", DESK, name=name, found=found, values=values, seen=seen, check=check, differing=differing
    )


class DeskFolder(Application):
    """``root``: the folder that a desk works in."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.drafts, self.reader = place.DraftFolder(self.root), Worker(self.root)

    def job_of(self, name: str) -> str:
        """A job by its path below the root."""
        folder = place.below(self.root, name)
        place.below(self.root, f"{name}/job.toml")
        return folder.relative_to(self.root).as_posix()

    def facts(self, request: WebRequest) -> p.WebPage:
        request.only(("name",))
        name = self.job_of(request.text("name"))
        content = self._job_file(name)
        found = self.reader.ask("facts", text=text_of(content, "job.toml"))
        return facts_page(name, found, found["values"], place.sha256(content))

    def _job_file(self, name: str) -> bytes:
        return content_of(self.root / name / "job.toml", JOB_BYTES, "")

    def with_facts(self, name: str, form: Mapping[str, str]) -> tuple[str, str]:
        """Text of job.toml with the fields of a form, and the SHA-256 of the file that they change."""
        content = self._job_file(name)
        values = {key: value for key, value in form.items() if "." in key}
        return self.reader.ask("with_facts", text=text_of(content, "job.toml"), values=values), place.sha256(content)

    def state_facts(self, request: WebRequest) -> p.WebPage | WebResponse:
        form = read_form(request)
        name, seen = self.job_of(form.get("name", "")), form.get("seen", "")
        text, now = self.with_facts(name, form)
        if form.get("then") == "save" and now == seen:
            try:
                place.write_over(self.root / name / "job.toml", text.encode(), seen)
                return to(jobs.JOB, name=name)
            except place.ChangedError as changed:
                now = place.sha256(changed.now)
        found = self.reader.ask("facts", text=text_of(self._job_file(name), "job.toml"))
        if now != seen:
            page = facts_page(name, found, form, now, differing=jobs.differing(found, form))
            return page._replace(status=HTTPStatus.CONFLICT)
        return facts_page(name, found, form, seen, self.reader.ask("check", job=name, text=text))

    def part(self, request: WebRequest) -> p.WebPage:
        request.only(("draft",))
        draft = self.drafts.read(request.text("draft")) if request.text("draft") else None
        machines = (state_of(self.root, folder) for folder in place.jobs_in(self.root))
        certificates = [
            (one.file(".pdf"), say("{id}: {machine}", id=Verbatim(one.id), machine=p.shown(one.machine)))
            for one in machines
            if one.file(".pdf") and not one.part
        ]
        if len(certificates) > 1:  # none is meant before one is chosen
            certificates.insert(0, ("", say("choose it")))
        return p.page("desk/part.html", DESK, draft=draft, certificates=certificates)

    def plan(self, request: WebRequest) -> WebResponse:
        one = self.drafts.take(request)
        one.values = {"part": "plan"}
        self.drafts.write(one)
        return to(jobs.PART, draft=one.id)

    def create_part(self, request: WebRequest) -> WebResponse:
        form = read_form(request)
        one, folder = self.drafts.read(form.get("draft", "")), form.get("folder", "").strip()
        self.check_new(folder)
        if not form.get("certificate"):
            raise CmmUqError("the certificate of the machine is not chosen", fix="Go back, and choose it")
        certificate = place.below(self.root, form.get("certificate", "")).relative_to(self.root).as_posix()
        self.reader.ask(
            "create_part",
            plan=one.export,
            certificate=certificate,
            folder=folder,
            date=form.get("date", ""),
            not_measured=form.get("not_measured") == "yes",
            facts={key: value for key, value in form.items() if "." in key},
        )
        self.drafts.delete(one)
        return to(jobs.JOB, name=folder)

    def add_file(self, table: str, request: WebRequest) -> WebResponse:
        """A dropped file into the folder of a job, and its name into a table of job.toml."""
        request.only(("name",))
        name = self.job_of(request.text("name"))
        path = self.root / name / "job.toml"
        content = self._job_file(name)
        file = place.received(request, path.parent)
        try:
            text = self.reader.ask("with_file", text=text_of(content, "job.toml"), table=table, name=file)
            place.write_over(path, text.encode(), place.sha256(content))
        except CmmUqError:
            (path.parent / file).unlink(missing_ok=True)
            raise
        return to(jobs.JOB, name=name)

    def verify(self, request: WebRequest) -> p.WebPage:
        request.only(())
        with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder:
            name = place.received(request, Path(folder), written=True)
            found = self.reader.ask("verification", seconds=VERIFY_S, path=str(Path(folder) / name))
        rows = tuple(
            (p.Cell(say("wrong") if wrong else say("right"), standing="bad" if wrong else "good"), p.Cell(Verbatim(what)),
             p.Cell(number(count, ",d")))
            for wrong, what, count in found["checks"]
        )  # fmt: skip
        headings = p.columns(say("Is"), say("What"), (say("Things"), "number"))
        table = p.PageTable(say("Comparisons"), headings, rows, heard=True)
        return p.page("desk/verify.html", DESK, name=name, found=found, comparisons=table)

    def check_new(self, name: str) -> None:
        if not name or place.safe_name(name) != name or name == REPORTS:
            fix = "Use letters, digits, - and _, such as K-2026-115"
            raise CmmUqError(f"{name!r} is no name of a folder on every system", fix=fix)
