"""The site: which address gives which page, and a page in words for whatever goes wrong.

Records are opened for each request and closed after it, so that a page shows what is there now, and not a file that was
moved, restored or migrated meanwhile.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import threading
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from pathlib import Path

from cmm_uq import __version__
from cmm_uq.app.serve.artefacts_page import artefacts_page
from cmm_uq.app.serve.certificate_page import certificate_page, recorded_file
from cmm_uq.app.serve.certificates_page import certificates_page, diagnoses_page
from cmm_uq.app.serve.checking import Checking
from cmm_uq.app.serve.due import DueDates, by_rule
from cmm_uq.app.serve.exchange import Answer, Asked, Refused
from cmm_uq.app.serve.file_page import dropped_page, file_page
from cmm_uq.app.serve.html import icon, render_page, style
from cmm_uq.app.serve.integrity_page import integrity_page
from cmm_uq.app.serve.machine_page import machine_page
from cmm_uq.app.serve.machines_page import machines_page
from cmm_uq.app.serve.overview import Stands, overview
from cmm_uq.app.serve.page import Cell, Notice, Page
from cmm_uq.app.serve.view import View, problem_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.place import shown
from cmm_uq.laboratory.records.store import Records

Made = Callable[[View, Asked], Page | Answer]

PAGES: Mapping[str, Made] = {
    "/": machines_page, "/machine": machine_page, "/certificates": certificates_page, "/certificate": certificate_page,
    "/diagnoses": diagnoses_page, "/artefacts": artefacts_page, "/recorded": recorded_file, "/file": file_page,
    "/integrity": integrity_page,
}  # fmt: skip
"""What is looked at, by path."""

WITH_FORM = ("/file", "/integrity")
"""Pages with a form that is sent: a browser must say where it comes from, which it does to this site alone."""


class Site:
    """Answers requests.

    Parameters
    ----------
    where : file or URL of the records, as :func:`~cmm_uq.laboratory.records.opening.open_records` takes it.
    due : finds due dates.
    today : the day; this machine's own by default.

    Raises
    ------
    CmmUqError : there are no records.
    """

    def __init__(
        self, where: str | Path | None = None, *, due: DueDates = by_rule, today: Callable[[], dt.date] = dt.date.today
    ) -> None:  # fmt: skip
        with open_records(where, read_only=True) as records:  # what is wrong with them is told before anybody looks
            self._where = records.place
        self._due, self._today = due, today
        self._lock = threading.Lock()
        self._kept: tuple[tuple[int, str, dt.date], Sequence[Stands]] | None = None
        self.checking = Checking(self.opened)

    @property
    def place(self) -> str:
        """Of the records, without a password."""
        return shown(self._where)

    def opened(self) -> Records:
        """The records, to be read.

        Raises
        ------
        CmmUqError : they cannot be.
        """
        return open_records(self._where, read_only=True)

    def warm(self) -> None:
        """Load what is slow to load and work out how the machines stand, so that no reader waits for it."""
        import cmm_uq.app.serve.diagnosis_section  # noqa: F401

        with contextlib.suppress(CmmUqError):  # whoever looks is told
            self.machines()

    def answer(self, asked: Asked | Refused) -> Answer:
        """The answer to a request, whatever happens."""
        try:
            if isinstance(asked, Refused):
                raise asked
            return self._answer(asked)
        except Refused as refused:
            return self._shown(_refusal(refused))
        except CmmUqError as error:
            problem, fix = problem_of(error)
            return self._shown(
                _refusal(Refused(HTTPStatus.SERVICE_UNAVAILABLE, problem, fix), say("The records cannot be read"))
            )
        except TimeoutError:
            return self._shown(_refusal(Refused(HTTPStatus.REQUEST_TIMEOUT, say("the request took too long to come"))))
        except Exception as error:  # a fault is told on its page; the others go on
            told = say("a fault of the program: {what}", what=Verbatim(f"{type(error).__name__}: {error}"))
            return self._shown(_refusal(Refused(HTTPStatus.INTERNAL_SERVER_ERROR, told, say("Please report it"))))

    def _answer(self, asked: Asked) -> Answer:
        if asked.method == "POST":
            return self._posted(asked)
        if asked.path in ("/style.css", "/icon.svg"):
            css = asked.path.endswith("css")
            return Answer(style() if css else icon(), "text/css; charset=utf-8" if css else "image/svg+xml")
        make = PAGES.get(asked.path)
        if make is None:
            raise Refused(HTTPStatus.NOT_FOUND, say("there is no page of that address"))
        with self.opened() as records:
            made = make(self._view(records), asked)
        return made if isinstance(made, Answer) else self._shown(made)

    def _posted(self, asked: Asked) -> Answer:
        if asked.path in ("/integrity/chain", "/integrity/files"):
            asked.only(())
            self.checking.begin(files=asked.path.endswith("files"))
            return Answer(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": "/integrity"})
        if asked.path != "/file":
            raise Refused(HTTPStatus.METHOD_NOT_ALLOWED, say("this page can only be looked at"))
        with self.opened() as records:
            return self._shown(dropped_page(self._view(records), asked))

    def _view(self, records: Records) -> View:
        today = self._today()
        return View(records, today, lambda: self._standing(records, today), self.checking)

    def _standing(self, records: Records, today: dt.date) -> Sequence[Stands]:
        head = (*records.head(), today)
        with self._lock:  # worked out once: who asks meanwhile would only do the same
            if self._kept is None or self._kept[0] != head:
                self._kept = head, overview(records, self._due, today)
            return self._kept[1]

    def machines(self) -> Sequence[Stands]:
        """How every machine stands, the most urgent first.

        Raises
        ------
        CmmUqError : the records cannot be read.
        """
        with self.opened() as records:
            return self._standing(records, self._today())

    def forget(self) -> None:
        """Work out anew how the machines stand when it is next asked for, as after a new entry."""
        with self._lock:
            self._kept = None

    def _shown(self, page: Page) -> Answer:
        foot = (
            say("Records: {place}. To be looked at only: nothing here can be changed.", place=Verbatim(self.place)),
            say("cmm-uq {version}", version=Verbatim(__version__)),
        )
        referrer = "same-origin" if page.place in WITH_FORM else "no-referrer"
        return Answer(render_page(page, foot), status=page.status, referrer=referrer)


def _refusal(refused: Refused, title: Text | None = None) -> Page:
    """A page in words."""
    titles = {HTTPStatus.NOT_FOUND: say("Not found"), HTTPStatus.INTERNAL_SERVER_ERROR: say("A fault")}
    head = title or titles.get(refused.status, say("This cannot be shown"))
    problem = say("{problem:capital}.", problem=refused.problem)
    lines = (Cell(say("{fix}.", fix=refused.fix)),) if refused.fix else ()
    return Page(head, "", lead=NOTHING, blocks=(Notice(problem, "bad", lines),), status=refused.status)
