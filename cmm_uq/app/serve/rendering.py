"""Pages as HTML by the one template, their style sheet, and a page in words for whatever goes wrong."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from cmm_uq.app.serve.exchange import RefusedRequest
from cmm_uq.app.serve.page import CHART, Cell, Chart, PageNotice, WebPage, kind
from cmm_uq.base.errors import printable
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.certificate.look import BAND, COLOURS, template_folder

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

DESK = "/desk"  # where the pages of a desk begin
ACCOUNT = "/account"
CONTENTS: tuple[tuple[str, Text], ...] = (
    ("/", say("Machines")), ("/certificates", say("Certificates")), ("/diagnoses", say("Diagnoses")),
    ("/artefacts", say("Artefacts")), ("/file", say("Check a file")), ("/integrity", say("Integrity")),
)  # fmt: skip
WORDS: dict[str, Text] = {  # what stands around every page
    "site": say("Calibration records"), "skip": say("To the content"), "contents": say("Contents"),
    "above": say("Belongs to"),
}  # fmt: skip


def render_page(page: WebPage, foot: Sequence[Text], *, desk: bool = False, account: bool = False) -> bytes:
    """``desk``: whether the site is a desk's, whose own pages have a script; ``account``: whether somebody signed in."""
    contents, words = (
        (((DESK, say("Desk")), *CONTENTS), WORDS | {"site": say("Calibration desk")}) if desk else (CONTENTS, WORDS)
    )
    if account:
        contents = *contents, (ACCOUNT, say("Account"))
    template = _environment().get_template("page.html")
    script = "/desk.js" if page.place == DESK else ""
    return template.render(page=page, foot=foot, contents=contents, words=words, script=script).encode()


def refusal(refused: RefusedRequest, title: Text | None = None) -> WebPage:
    """A page in words for a request that is answered with nothing else."""
    titles = {HTTPStatus.NOT_FOUND: say("Not found"), HTTPStatus.INTERNAL_SERVER_ERROR: say("A fault")}
    head = title or titles.get(refused.status, say("This cannot be shown"))
    problem = say("{problem:capital}.", problem=refused.problem)
    lines = (Cell(say("{fix}.", fix=refused.fix)),) if refused.fix else ()
    return WebPage(head, "", lead=NOTHING, blocks=(PageNotice(problem, "bad", lines),), status=refused.status)


def fault(error: Exception) -> RefusedRequest:
    """A fault of the program, told on its page; the others go on."""
    told = say("a fault of the program: {what}", what=Verbatim(f"{type(error).__name__}: {error}"))
    return RefusedRequest(HTTPStatus.INTERNAL_SERVER_ERROR, told, say("Please report it"))


@cache
def style() -> bytes:
    """The style sheet, in the colours of the documents."""
    colours = {**COLOURS, "band": BAND}
    return _environment().get_template("style.css").render(colour=colours).encode()


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template_folder() / "serve"), autoescape=True, undefined=StrictUndefined,
        finalize=_visible, trim_blocks=True, lstrip_blocks=True, auto_reload=False,
    )  # fmt: skip
    environment.filters |= {"picture": _picture, "kind": kind, "drawn": _drawn, "source": _source}
    return environment


def _visible(value: Any) -> Any:
    """A text with what would turn it round, or hide in it, written as an escape."""
    return printable(str.__str__(value)) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _picture(chart: Chart) -> Markup:
    """A picture with its alternative text; its elements were drawn here, of numbers and escaped words."""
    from markupsafe import Markup, escape

    size, label = "0 0 {} {}".format(*CHART), escape(printable(chart.alternative))
    return Markup(f'<svg viewBox="{size}" role="img" aria-label="{label}">{chart.svg}</svg>')  # noqa: S704 - nothing in it is from elsewhere


def _drawn(svg: str) -> Markup:
    """A drawing of this program."""
    from markupsafe import Markup

    return Markup(svg)  # noqa: S704 - nothing in it is from elsewhere


def _source(text: str, *, exact: bool = False) -> Markup:
    """A text of several lines; ``exact``: as it is, to be changed and sent back."""
    from markupsafe import escape

    return escape(text if exact else "\n".join(map(printable, text.split("\n"))))
