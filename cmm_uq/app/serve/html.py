"""A page as HTML, by ``templates/serve``: every value is escaped, and what no reader can see is written out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from cmm_uq.app.serve import drawing
from cmm_uq.app.serve.page import Chart, Page
from cmm_uq.base.errors import printable
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.plots import style as plot_style
from cmm_uq.certificate.render.html import template_folder

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

CONTENTS: tuple[tuple[str, Text], ...] = (
    ("/", say("Machines")), ("/certificates", say("Certificates")), ("/diagnoses", say("Diagnoses")),
    ("/artefacts", say("Artefacts")), ("/file", say("Check a file")), ("/integrity", say("Integrity")),
)  # fmt: skip
"""What every page leads to."""

WORDS: dict[str, Text] = {
    "site": say("Calibration records"), "skip": say("To the content"), "contents": say("Contents"),
    "above": say("Belongs to"),
}  # fmt: skip
"""What stands around every page."""


def render_page(page: Page, foot: Sequence[Text]) -> bytes:
    """A whole page.

    Parameters
    ----------
    foot : lines below it.
    """
    made = _environment().get_template("page.html").render(page=page, foot=foot, contents=CONTENTS, words=WORDS)
    return made.encode()


@cache
def style() -> bytes:
    """The style sheet, in the colours of the documents."""
    colours = {**plot_style.COLOURS, "band": plot_style.BAND}
    return _environment().get_template("style.css").render(colour=colours).encode()


@cache
def icon() -> bytes:
    """The picture in the browser's tab."""
    return (template_folder() / "serve" / "icon.svg").read_bytes()


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template_folder() / "serve"), autoescape=True, undefined=StrictUndefined,
        finalize=_visible, trim_blocks=True, lstrip_blocks=True, auto_reload=False,
    )  # fmt: skip
    environment.filters["picture"] = _picture
    return environment


def _visible(value: Any) -> Any:
    """A text with what would turn it round, or hide in it, written as an escape."""
    return printable(str.__str__(value)) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _picture(chart: Chart) -> Markup:
    """A picture with its alternative text; its elements were drawn here, of numbers and escaped words."""
    from markupsafe import Markup, escape

    size, label = f"0 0 {drawing.WIDTH} {drawing.HEIGHT}", escape(printable(chart.alternative))
    return Markup(f'<svg viewBox="{size}" role="img" aria-label="{label}">{chart.svg}</svg>')  # noqa: S704 - nothing in it is from elsewhere
