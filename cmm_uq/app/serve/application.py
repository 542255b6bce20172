"""One application for whoever looks at records and for whoever works at the desk: guard, router, page writer, faults.

A role gives its pages and forms by address.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, TypeVar

from cmm_uq import __version__
from cmm_uq.app.serve.accounts import Accounts, Guard
from cmm_uq.app.serve.exchange import ACCOUNT, DESK, OWN, RefusedRequest, WebRequest, WebResponse, refusal
from cmm_uq.app.serve.page import Cell, WebPage, address, moment, shown
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.look import BAND, COLOURS, template_folder

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

POLICY = OWN.replace("style-src", "script-src 'self'; connect-src 'self'; frame-src 'self'; style-src")
"""What a page of the desk may load: what records' pages may, the desk's own script, its events, and documents in frames."""
# pages with a form that is sent: a browser must say where it comes from, which it does to this site alone
WITH_FORM = (DESK, ACCOUNT, "/file", "/integrity")
OWN_FILES = {
    "/desk.js": "text/javascript; charset=utf-8", "/icon.svg": "image/svg+xml", "/style.css": "text/css; charset=utf-8",
}  # fmt: skip
Answer = WebPage | WebResponse
Handler = TypeVar("Handler")


def routed(request: WebRequest, pages: Mapping[str, Handler], forms: Mapping[str, Handler]) -> Handler:
    """What answers a request, of pages that are looked at and of forms that are sent."""
    if request.method == "POST" and request.path not in forms:
        raise RefusedRequest(HTTPStatus.METHOD_NOT_ALLOWED, say("this page can only be looked at"))
    if request.method != "POST" and request.path not in pages:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("there is no page of that address"))
    return (forms if request.method == "POST" else pages)[request.path]


class Application:
    """Answers requests; a role says what it shows (:meth:`respond`), and what stands at the foot of a page.

    ``desk``: whether it has the desk's own pages; ``guard``: lets in whoever may look, where not everybody may;
    ``url``: at which it is.
    """

    desk = False
    guard: Guard | Accounts | None = None
    url = ""

    def respond(self, request: WebRequest) -> Answer:
        raise NotImplementedError

    def foot(self, page: WebPage) -> Text:
        raise NotImplementedError

    def answer(self, request: WebRequest | RefusedRequest) -> WebResponse:
        admitted = False
        try:
            if isinstance(request, RefusedRequest):
                raise request
            found: Answer | None = None if self.guard is None else self.guard.admit(request, self.url)
            admitted = found is None
            if found is None:
                own = request.path in OWN_FILES and request.method != "POST"
                found = own_file(request.path) if own else self.respond(request)
            return self._response(found, admitted)
        except RefusedRequest as error:
            refused = error
        except CmmUqError as error:
            told: Text = Verbatim(error.problem)
            if not admitted:
                refused = RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, told)
            else:
                told = say("{problem} ({where})", problem=told, where=Verbatim(error.where)) if error.where else told
                refused = RefusedRequest(HTTPStatus.CONFLICT, told, Verbatim(error.fix or ""))
        except TimeoutError:
            refused = RefusedRequest(HTTPStatus.REQUEST_TIMEOUT, say("the request took too long to come"))
        except Exception as error:  # a fault is told on its page; the others go on
            told = say("a fault of the program: {what}", what=Verbatim(f"{type(error).__name__}: {error}"))
            refused = RefusedRequest(HTTPStatus.INTERNAL_SERVER_ERROR, told, say("Please report it"))
        return self._response(refusal(refused), admitted)

    def _response(self, page: Answer, admitted: bool) -> WebResponse:
        """A page as HTML; of the site itself whoever is not let in learns nothing."""
        if isinstance(page, WebResponse):
            return page
        page = page._replace(place=page.place or DESK) if self.desk else page
        whole = {"lead": NOTHING, "above": (), "waiting": False, **page.values}
        body = _environment().get_template(page.template).render(
            place=page.place, foot=self.foot(page) if admitted else NOTHING, version=Verbatim(__version__), desk=self.desk,
            account=isinstance(self.guard, Accounts), **whole,
        )  # fmt: skip
        policy = POLICY if page.place == DESK else OWN
        referrer = "same-origin" if page.place in WITH_FORM else "no-referrer"
        return WebResponse(body.encode(), status=page.status, policy=policy, referrer=referrer, headers=page.headers)


@cache
def own_file(path: str) -> WebResponse:
    """The style sheet, in the colours of the documents, the icon, and the desk's script."""
    if path == "/style.css":
        content = _environment().get_template("style.css").render(colour={**COLOURS, "band": BAND}).encode()
    else:
        content = (template_folder() / "serve" / path[1:]).read_bytes()
    return WebResponse(content, OWN_FILES[path])


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template_folder() / "serve"), autoescape=True, undefined=StrictUndefined,
        finalize=_visible, trim_blocks=True, lstrip_blocks=True, auto_reload=False,
    )  # fmt: skip
    environment.filters |= {"source": _source, "px": "{:.1f}".format}
    environment.globals |= {"say": say, "number": number, "verbatim": Verbatim, "address": address, "shown": shown}
    environment.globals |= {"day": day, "moment": moment}
    environment.globals |= {"Cell": Cell, "desk_cell": Cell(say("Desk"), DESK)}
    blocks = environment.get_template("blocks.html").module.__dict__
    environment.globals |= {name: block for name, block in blocks.items() if name[0] != "_"}
    return environment


def _visible(value: Any) -> Any:
    """A text with what would turn it round, or hide in it, written as an escape."""
    return printable(str.__str__(value)) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _source(text: str, *, exact: bool = False) -> Markup:
    """A text of several lines; ``exact``: as it is, to be changed and sent back."""
    from markupsafe import escape

    return escape(text if exact else "\n".join(map(printable, text.split("\n"))))
