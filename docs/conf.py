"""The documentation as a site: ``python3 start.py docs`` writes it to build/site, to be read without a network.

Sources are the Markdown files as they stand, README and CHANGELOG among them, so that every link works here and where
the files are read as text. Which pages belong together is said in ``CONTENTS`` alone.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from cmm_uq import __version__  # noqa: E402

CONTENTS: dict[str, list[str]] = {
    "Start here": ["tutorial", "desk", "overview", "gallery"],
    "How to": [
        "howto/laboratory", "howto/service", "howto/auditor", "howto/part", "notebooks/*",
        "import/index", "import/*", "instruments/index", "instruments/*",
    ],
    "Records": ["records/index", "records/*"],
    "Reference": [
        "reference/job", "reference/part", "reference/columns", "reference/plan", "reference/truth", "reference/budget",
        "reference/instrument", "reference/schedule",
        "reference/commands", "reference/results", "reference/part-results", "reference/prove", "running",
        "api", "reference/python", "uncertainty/model-file",
        "machine/effects", "limits", "words",
    ],
    "How it works": [
        "report", "certificate", "verify", "ten-years-later", "languages", "dcc", "signing", "iso17025", "provenance", "qif",
        "standards", "noise", "screening", "diagnosis", "planning", "proving", "selfcalibration",
        "artefacts/index",
        "artefacts/*", "machine/kinematics", "machine/rotary", "machine/arms",
        "machine/error-maps", "machine/digitizer", "machine/features",
        "machine/parts", "machine/field", "machine/other-methods",
        "uncertainty/index", "uncertainty/methods", "uncertainty/budgets",
    ],
    "What it rests on": [
        "validation", "validation-parts", "parts-study", "coverage-study", "noise-ranks", "diagnosis-studies",
        "mutation-study",
        "hostile-study", "tampering-study", "records/drift-study", "uncertainty/validation",
        "machine/harris-2004", "machine/benchmarks", "uncertainty/benchmarks", "waiting",
        "peers", "sources", "uncertainty/harris-2004",
    ],
    "The project": ["/README", "/CHANGELOG", "/CONTRIBUTING", "layout"],
}  # fmt: skip
root_doc = "docs/index"

project = "cmm_uq"
author = "The cmm_uq maintainers"
project_copyright = author
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc"]
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**"]
exclude_patterns = [".*", "build", "dist", "cmm_uq", "benchmarks", "examples", "reports", "templates", "tests",
                    "**/.ipynb_checkpoints"]  # fmt: skip
myst_enable_extensions = ["html_image"]
myst_heading_anchors = 4
nb_execution_mode = "off"  # the notebooks hold what the tests found
nb_merge_streams = True
highlight_language = "text"

autodoc_typehints = "none"  # the docstrings have the types
autodoc_member_order = "bysource"

html_theme = "furo"  # fonts of the reader's own system; no page asks for anything from elsewhere
html_title = f"cmm_uq {__version__}"
html_static_path = ["site/site.css"]
html_css_files = ["site.css"]
html_extra_path = ["site/index.html"]
html_copy_source = False
html_show_sourcelink = False
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"

FIELDS = {"Parameters": "param", "Attributes": "ivar", "Raises": "raises", "Returns": "returns"}

ACCESSIBLE = {  # what the theme and Sphinx leave out for readers who hear the page or have no mouse
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="All pages">',
    '<aside class="toc-drawer">': '<aside class="toc-drawer" aria-label="On this page">',
    '<aside class="toc-drawer no-toc">': '<aside class="toc-drawer no-toc" aria-label="On this page">',
    "<pre>": '<pre tabindex="0">',
    '<th class="head"><p></p></th>': "<td></td>",
    "<th></th>": "<td></td>",
    '<div class="table-wrapper ': '<div tabindex="0" class="table-wrapper ',
    '<div id="search-results"></div>': '<h1>Search</h1>\n<div id="search-results"></div>',
}


def add_contents(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the table of contents on the first page as it is read; the file itself stays plain Markdown."""
    if docname == root_doc:
        for caption, pages in CONTENTS.items():
            entries = "\n".join(page if page.startswith("/") else f"/docs/{page}" for page in pages)
            source[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n{entries}\n```\n"


def read_docstring(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Turn the sections of a docstring (``name : what it is``, below ``Parameters`` and the like) into Sphinx's fields."""
    told: list[str] = []
    section = ""
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if following and set(following) == {"-"}:
            section = line
            told += ["", f"**{line}**", ""] if section not in FIELDS else [""]
        elif not line or set(line) != {"-"}:
            named = re.match(r"([\w`*., ]+) : (.+)", line) if section in FIELDS else None
            told.append(f":{FIELDS[section]} {named[1].replace(', ', ',')}: {named[2]}" if named else line)
    lines[:] = told


def make_accessible(app: Sphinx, exception: Exception | None) -> None:
    """Complete the written pages; tests hold every one of them to axe-core's rules."""
    if exception is None and app.builder.format == "html":
        for page in Path(app.outdir).rglob("*.html"):
            text = page.read_text(encoding="utf-8")
            for found, instead in ACCESSIBLE.items():
                text = text.replace(found, instead)
            page.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Register all of them with Sphinx."""
    app.connect("autodoc-process-docstring", read_docstring)
    app.connect("source-read", add_contents)
    app.connect("build-finished", make_accessible)
