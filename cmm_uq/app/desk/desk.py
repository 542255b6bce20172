"""The desk's pages by address: what each shows, what each form does, and the records' pages behind the same guard.

A form that changes something is answered with a redirect, so that reload and back are safe; a GET changes nothing.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.desk import job_pages as jobs
from cmm_uq.app.desk.folder import DeskFolder
from cmm_uq.app.desk.job_pages import ARTEFACT, FIELDS, READ, JobState, state_of
from cmm_uq.app.desk.place import ChangedError, Draft, below, jobs_in, plans_in, sha256, write_over
from cmm_uq.app.desk.workers import ReportRun, shown_file
from cmm_uq.app.serve.accounts import Accounts, Guard
from cmm_uq.app.serve.application import POLICY, Answer, routed
from cmm_uq.app.serve.exchange import DESK, RECORDED, RefusedRequest, WebRequest, WebResponse, read_form, to
from cmm_uq.app.serve.page import WebPage, page
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.laboratory.records.place import is_url, place_of

if TYPE_CHECKING:
    from cmm_uq.app.serve.site import Site

AT_ONCE = 2  # reports under way


def records_pages() -> tuple[Any, Any]:
    """The modules of the records' pages and of a certificate's, which load what computes."""
    from cmm_uq.app.serve import certificate_page, site

    return site, certificate_page


def typed(form: Mapping[str, str], *but: str) -> dict[str, str]:
    """What somebody filled in, without what goes with the form."""
    return {name: value for name, value in form.items() if name not in ("draft", "kind", "seen", "then", *but)}


class Desk(DeskFolder):
    """Answers the requests of one start; ``root``: the folder that it works in."""

    desk = True

    def __init__(self, root: Path, tell: Callable[[str], None] = lambda line: None) -> None:
        super().__init__(root)
        self.tell = tell
        self.runs: dict[str, ReportRun] = {}
        self.checked: dict[str, tuple[str, Text]] = {}
        self._lock, self._opening = threading.Lock(), threading.Lock()
        self._site: Site | None = None

    def open_at(self, url: str, port: int, accounts: Path | None = None) -> str:
        """Begin with a link that is opened once, or with ``accounts`` of those who may sign in."""
        self.url = url
        if accounts is not None:
            self.guard = Accounts(accounts, port, self.tell, (jobs.VERIFY,), DESK)
            return f"{url.rstrip('/')}{DESK}"
        self.guard = Guard(self.tell, port)
        return self.guard.link(url)

    def begin(self) -> None:
        """Load what is slow to load, in the worker first, so that no page waits for it."""
        self.reader.ask("ready")
        records_pages()

    def close(self) -> None:
        for run in self.runs.values():
            run.cancel()
        self.reader.end()

    def respond(self, request: WebRequest) -> Answer:
        if self.guard is None:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the desk is not open yet"))
        if not (request.path + "/").startswith(DESK + "/"):
            return self.records.respond(request)
        return routed(request, self._pages(), self._forms())(request)

    def foot(self, page: WebPage) -> Text:
        return say("Folder: {root}", root=Verbatim(str(self.root))) if page.place == DESK else self.records.foot(page)

    @property
    def records(self) -> Site:
        """The pages of the records that reports of this folder are kept in; loaded when they are first looked at."""
        with self._opening:
            if self._site is None:
                where = place_of(None)
                if where is None:
                    fix = "Start the desk without CMM_UQ_RECORDS=none to keep them"
                    raise CmmUqError("no records are kept here", fix=fix)
                place = where if is_url(where) else self.root / where
                if isinstance(place, Path) and not place.exists():
                    raise CmmUqError("no certificate is recorded here yet", fix="Make the first one on the desk")
                site, _ = records_pages()
                self._site = site.Site(place)
            return self._site

    def _pages(self) -> Mapping[str, Callable[[WebRequest], Answer]]:
        return {
            DESK: self.home,
            READ: self.reading,
            ARTEFACT: self.artefact,
            FIELDS: self.fields,
            jobs.JOB: self.job,
            jobs.RUN: self.running,
            jobs.CERTIFICATE: self.certificate,
            jobs.FILE: partial(shown_file, self.root),
            jobs.PART: self.part,
            jobs.FACTS: self.facts,
            jobs.VERIFY: lambda request: page("desk/verify.html", DESK, name="", found=None),
            jobs.EVENTS: self.events,
            jobs.FIELD: self.field,
            jobs.MACHINE: self.machine,
        }

    def _forms(self) -> Mapping[str, Callable[[WebRequest], Answer]]:
        return {
            f"{DESK}/drop": self.drop,
            READ: self.correct,
            FIELDS: self.fill_in,
            jobs.JOB: self.save,
            jobs.RUN: self.run,
            jobs.CANCEL: self.cancel,
            f"{DESK}/check": self.check,
            jobs.DELETE: self.delete,
            jobs.PLAN: self.plan,
            jobs.PART: self.create_part,
            jobs.POINTS: partial(self.add_file, "recording"),
            jobs.CERTIFIED: partial(self.add_file, "artefact.certificate"),
            jobs.FACTS: self.state_facts,
            jobs.VERIFY: self.verify,
        }

    def home(self, request: WebRequest) -> WebPage:
        request.only(())
        folders = jobs_in(self.root)
        states = (self._checked(state_of(self.root, folder)) for folder in folders[: jobs.LISTED])
        return jobs.home_page(self.root, states, self.drafts.every(), len(folders))

    def _checked(self, one: JobState) -> JobState:
        """With what check said of it, unless it was changed since."""
        seen, told = self.checked.get(one.name, ("", NOTHING))
        same = seen and seen == sha256((self.root / one.name / "job.toml").read_bytes())
        return replace(one, checked=told) if same else one

    def drop(self, request: WebRequest) -> WebResponse:
        request.only(())
        one = self.drafts.take(request)
        try:
            one.keys = self.reader.ask("first_keys", path=one.export)
            self.drafts.write(one)
        except CmmUqError:  # told where it is read
            pass
        return to(READ, draft=one.id)

    def delete(self, request: WebRequest) -> WebResponse:
        self.drafts.delete(self.drafts.read(read_form(request).get("draft", "")))
        return to(DESK)

    def reading(self, request: WebRequest) -> WebPage:
        request.only(("draft",))
        one = self.drafts.read(request.text("draft"))
        found = self.reader.ask("read", path=one.export, keys=one.keys)
        return jobs.read_page(one, found, plans_in(self.root) if found["lines"] else ())

    def correct(self, request: WebRequest) -> Answer:
        form = read_form(request)
        one = self.drafts.read(form.get("draft", ""))
        one.seen = form.get("seen", "")
        chosen, said = jobs.said_in(form)
        if said.get("plan"):
            said["plan"] = below(self.root, said["plan"]).relative_to(self.root).as_posix()
        one.keys = self.reader.ask("corrected", path=one.export, keys=one.keys, chosen=chosen, said=said)
        self.drafts.write(one)
        if form.get("then") == "remember":
            self.reader.ask("remembered", path=one.export, keys=one.keys)
        return to(READ if form.get("then") == "read" else ARTEFACT, draft=one.id)

    def artefact(self, request: WebRequest) -> WebPage:
        request.only(("draft",))
        one = self.drafts.read(request.text("draft"))
        found = self.reader.ask("read", path=one.export, keys=one.keys)
        kinds = self.reader.ask("kinds", export=one.export, keys=one.keys)
        return page("desk/artefact.html", DESK, draft=one, kinds=kinds, amounts=found["amounts"])

    def fields(self, request: WebRequest) -> WebPage:
        request.only(("draft", "kind"))
        one, kind = self.drafts.read(request.text("draft")), request.text("kind")
        return self._fields(one, kind)

    def _fields(self, one: Draft, kind: str, refused: CmmUqError | None = None) -> WebPage:
        fields = self.reader.ask("fields", kind=kind, export=one.export, keys=one.keys)
        values = {each["key"]: one.values.get(each["key"], "") for each in fields}
        found = None
        if refused is not None:
            found = {"problems": [str(refused)], "warnings": []}
        elif one.values:
            found = self.reader.ask("check_answers", kind=kind, export=one.export, keys=one.keys, values=values)
        shown = jobs.fields_page(one, kind, fields, self.drafts.last(), found)
        return shown if refused is None else shown._replace(status=HTTPStatus.CONFLICT)

    def fill_in(self, request: WebRequest) -> Answer:
        form = read_form(request)
        one, kind = self.drafts.read(form.get("draft", "")), form.get("kind", "")
        one.seen = form.get("seen", "")
        one.values = typed(form)
        self.drafts.write(one)
        if form.get("then") != "create":
            return to(FIELDS, draft=one.id, kind=kind)
        folder = one.values.get("folder", "").strip()
        values = typed(one.values, "folder")
        try:
            self.check_new(folder)
            self.reader.ask("create", kind=kind, export=one.export, keys=one.keys, values=values, folder=folder)
        except CmmUqError as error:
            return self._fields(one, kind, error)
        self.drafts.remember({**one.values, "kind": kind})
        self.drafts.delete(one)
        return to(jobs.JOB, name=folder)

    def check(self, request: WebRequest) -> WebResponse:
        """What is wrong with what is being typed; nothing is written."""
        form = read_form(request)
        if "name" in form:
            name = self.job_of(form["name"])
            text = form["text"] if "text" in form else self.with_facts(name, form)[0]
            found = self.reader.ask("check", job=name, text=text)
        else:
            one = self.drafts.read(form.get("draft", ""))
            asked: dict[str, Any] = {"kind": form.get("kind", ""), "export": one.export, "keys": one.keys}
            found = self.reader.ask("check_answers", **asked, values=typed(form, "folder"))
        return WebResponse(json.dumps(found).encode(), "application/json", policy=POLICY)

    def job(self, request: WebRequest) -> WebPage:
        request.only(("name",))
        name = self.job_of(request.text("name"))
        content = content_of(self.root / name / "job.toml", JOB_BYTES, "")
        return self._job(name, content.decode("utf-8", "replace"), sha256(content))

    def machine(self, request: WebRequest) -> WebResponse:
        """Its picture, as the job describes it."""
        request.only(("name",))
        svg = self.reader.ask("machine", job=self.job_of(request.text("name")))
        return WebResponse(svg.encode(), "image/svg+xml", policy=RECORDED)

    def _job(self, name: str, text: str, seen: str, difference: str | None = None, draft: str | None = None) -> WebPage:
        check = self.reader.ask("check", job=name, text=draft)
        if draft is None:
            count = len(check["problems"])
            told = say("checked: {count} problems", count=count) if count else say("checked: nothing would stop it")
            self.checked[name] = seen, told
        return jobs.job_page(self.root, state_of(self.root, self.root / name), check, text, seen, difference)

    def save(self, request: WebRequest) -> Answer:
        form = read_form(request)
        name, text = self.job_of(form.get("name", "")), form.get("text", "")
        if form.get("then") != "save":
            return self._job(name, text, form.get("seen", ""), draft=text)
        try:
            write_over(self.root / name / "job.toml", text.encode(), form.get("seen", ""))
        except ChangedError as changed:
            difference = jobs.difference(changed.now, text.encode())
            shown = self._job(name, text, sha256(changed.now), difference, text)
            return shown._replace(status=HTTPStatus.CONFLICT)
        return to(jobs.JOB, name=name)

    def run(self, request: WebRequest) -> WebResponse:
        name = self.job_of(read_form(request).get("name", ""))
        with self._lock:
            under_way = [one for one in self.runs.values() if not one.over]
            if not any(one.job == name for one in under_way):
                if len(under_way) >= AT_ONCE:
                    raise RefusedRequest(
                        HTTPStatus.CONFLICT,
                        say("{count} certificates are under way", count=len(under_way)),
                        say("Wait for one of them, or cancel it"),
                    )
                self.runs[name] = ReportRun(self.root, name, self._keep_field)
        return to(jobs.RUN, name=name)

    def _run_of(self, request: WebRequest) -> ReportRun | None:
        request.only(("name",))
        return self.runs.get(request.text("name"))

    def running(self, request: WebRequest) -> Answer:
        run = self._run_of(request)
        if run is None:  # of an earlier start
            return to(jobs.JOB, name=self.job_of(request.text("name")))
        if run.found is not None:
            return to(jobs.CERTIFICATE, name=run.job)
        return page("desk/run.html", DESK, run=run)

    def cancel(self, request: WebRequest) -> WebResponse:
        name = read_form(request).get("name", "")
        if name in self.runs:
            self.runs[name].cancel()
        return to(jobs.RUN, name=name)

    def events(self, request: WebRequest) -> WebResponse:
        run = self._run_of(request)
        if run is None:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, say("nothing of that name is under way"))
        return WebResponse(b"retry: 1000\n\n", "text/event-stream", policy=POLICY, stream=run.events())

    def certificate(self, request: WebRequest) -> WebPage:
        request.only(("name",))
        one = self._state(request.text("name"))
        warnings = self.reader.ask("check", job=one.name, text=None)["warnings"]
        _, certificates = records_pages()
        diagnosed = certificates.diagnosed(one.results.get("diagnosis"))
        return jobs.certificate_page(one, diagnosed, self._field_of(one).is_file(), warnings)

    def _state(self, name: str) -> JobState:
        one = state_of(self.root, self.root / self.job_of(name))
        if one.made is None:
            raise RefusedRequest(
                HTTPStatus.NOT_FOUND, say("this job has no certificate yet"), say("Make it on the page of the job")
            )
        return one

    def _field_of(self, one: JobState) -> Path:
        """The residual field, kept for the certificate that it came with."""
        return (
            self.drafts.folder
            / "fields"
            / f"{sha256(below(self.root, one.file('results.json')).read_bytes())[:32]}.json"
        )

    def _keep_field(self, found: Mapping[str, Any]) -> None:
        """Once a report is done."""
        if found["field"] is not None:
            path = self.drafts.folder / "fields" / f"{found['sha256'][:32]}.json"
            if not path.exists():
                write_over(path, json.dumps(found["field"]).encode(), "")

    def field(self, request: WebRequest) -> WebResponse:
        request.only(("name",))
        path = self._field_of(self._state(request.text("name")))
        return WebResponse(
            content_of(path, TABLE_BYTES, "Make the certificate again"), "application/json", policy=POLICY
        )
