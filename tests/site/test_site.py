"""The documentation as a site: every link leads somewhere, nothing comes from elsewhere, everybody can read and search it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe

pytestmark = pytest.mark.long  # all need what takes long to make

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

ELSEWHERE = {
    "arxiv.org", "docs.hexagonmi.com", "doi.org", "github.com", "openturns.github.io", "pradyunsg.me", "pypi.org",
    "python.arviz.org", "uncertainty.nist.gov", "www.scielo.br", "www.sphinx-doc.org", "www.w3.org",
}  # fmt: skip
"""Where links of the documentation lead outside; looked at by eye when one is added, since tests fetch nothing."""


class Read(HTMLParser):
    """What one page links to, what it loads, and which places in it can be linked to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.places: set[str] = {""}
        self.titles = 0
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.titles += tag == "h1"
        if "id" in given:
            self.places.add(given["id"])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in ("script", "img", "iframe", "source") and "src" in given:
            self.loads.append(given["src"])
        if tag == "link" and given.get("rel") not in ("author", "canonical"):
            self.loads.append(given["href"])


@pytest.fixture(scope="module")
def read(site: Path) -> dict[Path, Read]:
    return {path.resolve(): Read(path) for path in sorted(site.rglob("*.html")) if "_static" not in path.parts}


FIRST = "site/index.html"
"""Leads on to the first page of the documentation at once, so that a browser cannot look at it."""

ALIKE = """() => {
  const further = {'tbody': 5, 'pre': 40, 'article ul': 12};
  for (const [of, kept] of Object.entries(further))
    for (const one of document.querySelectorAll(of)) [...one.children].slice(kept).forEach(child => child.remove());
  const seen = {};
  for (const word of document.querySelectorAll('article pre span, article code span')) {
    if (word.children.length || word.closest('a, th, h1, h2, h3, h4, h5, h6')) continue;
    const around = [...Array(4)].reduce((way, _) => [...way, way.at(-1).parentElement], [word]);
    const sort = around.map(one => `${one.tagName} ${one.className}`).join();
    seen[sort] = (seen[sort] || 0) + 1;
    if (seen[sort] > 5) word.remove();
  }
}"""
"""Takes away what is like what stands before it: further rows of a long table, words of code of a sort, items of lists."""

IN_PLACE = """async ([text, address]) => {
  const other = new DOMParser().parseFromString(text, 'text/html');
  const base = document.head.querySelector('base') || document.head.appendChild(document.createElement('base'));
  base.href = address;
  document.title = other.title;
  document.body.replaceChildren(...other.body.childNodes);
  await Promise.all([...document.images].map(image => image.decode().catch(() => null)));
}"""
"""Puts another page in the place of this one, whose styles are the same: they, and axe, are read once."""

AXE = Axe()

WHOLE = ("index", "search", "genindex", "tutorial", "posterior", "python")
"""A page of each sort, read by axe with what stands around its text, and for the contrast of colours, the theme's."""

TELEPHONE = 360
"""Width of a screen, CSS pixels."""


@dataclass(frozen=True)
class Look:
    """What a browser found of one page."""

    wrong: list[tuple[str, list[str]]]
    width: int


@pytest.fixture(scope="module")
def looks(read: dict[Path, Read], browser: Browser) -> dict[str, Look]:
    """Of every page, opened once: what axe-core finds with all its rules, and how wide the page is on a telephone."""
    tab = browser.new_page()
    found = {}
    for path in read:
        if path.as_posix().endswith(FIRST):
            continue
        tab.set_viewport_size({"width": TELEPHONE, "height": 800})
        whole = path.stem in WHOLE
        if whole or not found:
            tab.goto(path.as_uri())
            tab.evaluate(AXE.axe_script)
        else:
            tab.evaluate(IN_PLACE, [path.read_text(encoding="utf-8"), path.as_uri()])
        width = tab.evaluate("document.documentElement.scrollWidth")
        tab.set_viewport_size({"width": 1280, "height": 900})
        tab.evaluate(ALIKE)
        part, rules = (None, {}) if whole else ({"include": [["article"]]}, {"color-contrast": {"enabled": False}})
        options = {"resultTypes": ["violations"], "rules": rules}
        wrong = tab.evaluate("([part, options]) => axe.run(part || document, options)", [part, options])["violations"]
        told = [(one["id"], [node["html"][:90] for node in one["nodes"]][:2]) for one in wrong]
        found[f"{path.parent.name}/{path.name}"] = Look(told, width)
    tab.close()
    return found


def test_every_link_leads_to_a_page_and_a_place_in_it(read: dict[Path, Read]) -> None:
    broken = []
    for path, page in read.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (target in read and unquote(parts.fragment) not in read[target].places):
                broken.append((path.name, link))
    assert broken == []


def test_links_that_lead_outside_are_known(read: dict[Path, Read]) -> None:
    outside = {urlsplit(link).netloc for page in read.values() for link in page.links if urlsplit(link).scheme}
    assert outside <= ELSEWHERE, outside - ELSEWHERE


def test_no_page_loads_anything_from_elsewhere(read: dict[Path, Read], site: Path) -> None:
    for page in read.values():
        assert [load for load in page.loads if urlsplit(load).netloc] == []
    for style in (site / "_static").rglob("*.css"):
        assert "url(http" not in style.read_text(encoding="utf-8").replace('"', "").replace("'", "")


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    yield context.new_page()
    context.close()


def test_axe_finds_nothing_on_any_page(looks: dict[str, Look]) -> None:
    """By WCAG 2.2 A and AA; what stands around the text and the theme's colours are alike, and are read on some pages."""
    assert {page: look.wrong for page, look in looks.items() if look.wrong} == {}
    assert len(looks) > 50


def test_every_page_has_one_title(read: dict[Path, Read]) -> None:
    assert {path.name: page.titles for path, page in read.items() if page.titles != 1} == {}


def test_on_a_telephone_no_page_is_wider_than_the_screen(looks: dict[str, Look]) -> None:
    assert {page: look.width for page, look in looks.items() if look.width > TELEPHONE} == {}


def test_the_search_works_without_a_network(site: Path, tab: Page) -> None:
    tab.context.set_offline(True)
    tab.goto((site / "search.html").as_uri() + "?q=hysteresis")
    tab.wait_for_selector("#search-results li a", timeout=10_000)
    assert "effects.html" in " ".join(tab.eval_on_selector_all("#search-results li a", "all => all.map(a => a.href)"))


def test_the_first_address_leads_to_the_documentation(site: Path, tab: Page) -> None:
    tab.goto((site / "index.html").as_uri())
    tab.wait_for_url("**/docs/index.html*")
    assert tab.inner_text("h1").startswith("The documentation of cmm_uq")
