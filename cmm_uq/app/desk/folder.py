"""The folder of a desk: its jobs, what they state by fields, parts, and certificates that are verified."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path

from cmm_uq.app.desk import job_pages as jobs
from cmm_uq.app.desk.drafts import DraftFolder, received
from cmm_uq.app.desk.export_pages import check_blocks
from cmm_uq.app.desk.job_pages import REPORTS, state_of
from cmm_uq.app.desk.part_pages import part_page, with_points
from cmm_uq.app.desk.place import ChangedError, below, jobs_in, safe_name, sha256, write_over
from cmm_uq.app.desk.verify_page import verify_page
from cmm_uq.app.desk.workers import Worker
from cmm_uq.app.serve.exchange import WebRequest, WebResponse, read_form
from cmm_uq.app.serve.page import WebPage, address
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of, text_of
from cmm_uq.base.files.limits import JOB_BYTES

VERIFY_S = 180.0  # s that reading and comparing a certificate may take


def to(path: str, **query: str) -> WebResponse:
    """After a form: a page to be got, so that reload sends nothing again."""
    return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": address(path, **query)})


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

    def facts(self, request: WebRequest) -> WebPage:
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

    def state_facts(self, request: WebRequest) -> WebPage | WebResponse:
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

    def part(self, request: WebRequest) -> WebPage:
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

    def verify(self, request: WebRequest) -> WebPage:
        request.only(())
        with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder:
            name = received(request, Path(folder), written=True)
            return verify_page(name, self.reader.ask("verification", seconds=VERIFY_S, path=str(Path(folder) / name)))

    def check_new(self, name: str) -> None:
        if not name or safe_name(name) != name or name == REPORTS:
            fix = "Use letters, digits, - and _, such as K-2026-115"
            raise CmmUqError(f"{name!r} is no name of a folder on every system", fix=fix)
