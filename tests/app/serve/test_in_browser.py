"""The page in a real browser: on a telephone, on a screen, in the dark, on paper; by keyboard alone; for those who hear it."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from axe_playwright_python.sync_playwright import Axe
from pypdf import PdfReader

from cmm_uq.app.serve.server import RecordsServer
from tests.app.serve.laboratory import entry_of, files
from tests.certificate.test_html_layout import CONTRASTS, LABELS_COLLIDING

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

FIXED = ["", "certificates", "certificates?decision=fail", "certificates?text=nothing", "diagnoses", "artefacts", "file",
         "integrity", "machine?serial=K1", "machine?serial=%3Cscript%3Ealert%281%29%3C%2Fscript%3E", "nowhere"]  # fmt: skip


class Tab:
    def __init__(self, page: Page, url: str) -> None:
        self.page, self.url = page, url
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda message: self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", lambda dialog: self.complaints.append(dialog.message))

    def open(self, address: str) -> Page:
        self.page.goto(self.url + address)
        return self.page


@pytest.fixture(scope="module")
def addresses(laboratory: Path) -> list[str]:
    return [*FIXED, *(f"certificate?entry={entry_of(laboratory, number)}" for number in ("k-4", "sim-1", "h-1"))]


@pytest.fixture
def tab(browser: Browser, server: RecordsServer) -> Iterator[Tab]:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    yield Tab(context.new_page(), server.url)
    context.close()


@pytest.mark.long
def test_no_page_is_wider_than_the_screen_or_complains_or_asks_for_anything_elsewhere(
    tab: Tab, addresses: list[str]
) -> None:
    wide = {}
    for width in (360, 1280):
        tab.page.set_viewport_size({"width": width, "height": 800})
        for address in addresses:
            page = tab.open(address)
            if (found := page.evaluate("document.documentElement.scrollWidth")) > width:
                wide[width, address] = found
            assert page.evaluate("document.scripts.length") == 0
    assert wide == {}
    assert [request for request in tab.requests if not request.startswith(tab.url)] == []
    assert [complaint for complaint in tab.complaints if "404" not in complaint] == []


@pytest.mark.long
def test_axe_finds_nothing_on_any_page(tab: Tab, addresses: list[str]) -> None:
    """By WCAG 2.2 A and AA, and its best practices, in light and in dark, wide and narrow."""
    alike = ("certificates?decision=fail", "certificates?text=nothing", addresses[-2], addresses[9])
    looks = [(one, 1280, "light") for one in addresses if one not in alike]
    looks += [
        ("", 360, "dark"),
        (addresses[-1], 360, "dark"),
        ("machine?serial=K3", 1280, "dark"),
        ("file", 360, "dark"),
    ]
    found = {}
    for address, width, scheme in looks:
        tab.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        tab.page.set_viewport_size({"width": width, "height": 900})
        wrong = Axe().run(tab.open(address), options={"resultTypes": ["violations"]}).response["violations"]
        if wrong:
            found[address, scheme] = [(one["id"], [node["html"][:90] for node in one["nodes"]][:2]) for one in wrong]
    assert found == {}


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_enough_contrast_in_pictures_too(tab: Tab, scheme: str) -> None:
    """WCAG 2.2, 1.4.3: at least 4.5 : 1; axe does not look into SVG."""
    tab.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    ratios = [ratio for address in ("", "machine?serial=K3", "machine?serial=K1")
              for ratio in tab.open(address).evaluate(CONTRASTS)]  # fmt: skip
    assert len(ratios) > 100
    assert min(ratios) >= 4.5


CUT_OFF = """() => [...document.querySelectorAll('figure svg')].flatMap(svg => {
  const frame = svg.getBoundingClientRect();
  return [...svg.querySelectorAll('text')].filter(text => {
    const box = text.getBoundingClientRect();
    return box.left < frame.left - .5 || box.right > frame.right + .5 ||
      box.top < frame.top - .5 || box.bottom > frame.bottom + .5;
  }).map(text => text.textContent);
})"""


@pytest.mark.long
@pytest.mark.parametrize("serial", ["100000", "K3", "K1"])
def test_words_in_a_picture_are_whole_and_do_not_collide(tab: Tab, serial: str) -> None:
    for width in (360, 1280):
        tab.page.set_viewport_size({"width": width, "height": 900})
        page = tab.open(f"machine?serial={serial}")
        assert page.locator("figure svg").count() > 0
        assert page.evaluate(CUT_OFF) == []
        assert page.evaluate(LABELS_COLLIDING) == []


def pressed(tab: Tab, *keys: str) -> None:
    for key in keys:
        tab.page.keyboard.press(key)


def tabbed_to(tab: Tab, text: str, most: int = 60) -> None:
    for _ in range(most):
        pressed(tab, "Tab")
        found = tab.page.evaluate(
            "(e => [e.textContent.trim(), e.name || '', getComputedStyle(e).outlineStyle])(document.activeElement)"
        )
        if text in found[:2]:
            assert found[2] != "none", "the focus cannot be seen"
            return
    raise AssertionError(f"no Tab leads to {text!r}")


@pytest.mark.long
def test_everything_is_reached_by_the_keyboard_alone(tab: Tab) -> None:
    tab.open("")
    tabbed_to(tab, "To the content", 1)
    pressed(tab, "Enter")
    assert tab.page.evaluate("document.activeElement.id") == "content"
    tabbed_to(tab, "text")
    tab.page.keyboard.type("k3")
    with tab.page.expect_navigation():
        pressed(tab, "Enter")
    assert "text=k3" in tab.page.url
    tabbed_to(tab, "K3")
    with tab.page.expect_navigation():
        pressed(tab, "Enter")
    assert tab.page.title() == "Machine K3 · Calibration records"
    tabbed_to(tab, "k-3")
    with tab.page.expect_navigation():
        pressed(tab, "Enter")
    assert tab.page.locator("h1").inner_text() == "Certificate k-3"
    tab.open("integrity")
    tabbed_to(tab, "Compare entries and tables")
    with tab.page.expect_navigation():
        pressed(tab, "Enter")
    assert tab.page.locator(".notice .head").first.inner_text().endswith("The records agree with their chain")


@pytest.mark.long
@pytest.mark.parametrize(("number", "altered", "told"), [
    ("k-1", b"", "Known and released"), ("k-4", b"", "Known, but withdrawn: do not rely on it"),
    ("k-1", b" ", "Altered: not the file that was recorded"), ("elsewhere", b"", "Unknown: no certificate of these records"),
])  # fmt: skip
def test_a_chosen_file_is_looked_up(tab: Tab, number: str, altered: bytes, told: str) -> None:
    page = tab.open("file")
    content = files(number)["certificate.html"] + altered
    page.set_input_files("input[type=file]", {"name": "k.html", "mimeType": "text/html", "buffer": content})
    with page.expect_navigation():
        page.get_by_role("button", name="Check it").click()
    assert page.locator(".notice .head").inner_text().endswith(told)
    assert tab.complaints == []


@pytest.mark.long
def test_a_file_is_dropped_on_the_field_without_a_script_of_the_page(tab: Tab) -> None:
    page = tab.open("file")
    content = files("k-1")["results.json"].decode()
    moved = page.evaluate_handle(
        "content => { const d = new DataTransfer(); d.items.add(new File([content], 'results.json')); return d; }",
        content,
    )
    field = page.locator("input[type=file]")
    page.evaluate("([field, data]) => { field.files = data.files; }", [field.element_handle(), moved])
    box = field.bounding_box()
    assert box is not None
    assert box["height"] > 100, "too small to drop something on"
    with page.expect_navigation():
        page.get_by_role("button", name="Check it").click()
    assert page.locator(".notice .head").inner_text().endswith("Known and released")


@pytest.mark.long
def test_a_recorded_page_shows_itself_and_can_do_nothing_here(tab: Tab, laboratory: Path) -> None:
    page = tab.open(f"recorded?entry={entry_of(laboratory, 'k-1')}&name=certificate.html")
    assert page.locator("bdi").inner_text() == "k-1"
    assert page.evaluate("origin") == "null"


@pytest.mark.long
def test_on_paper_the_list_is_a_list(tab: Tab) -> None:
    page = tab.open("")
    printed = PdfReader(io.BytesIO(page.pdf(prefer_css_page_size=True)))
    text = " ".join(" ".join(sheet.extract_text().split()) for sheet in printed.pages)
    assert len(printed.pages) == 1
    assert re.search(r"K3 Machine K3 ✗ Overdue.* Does not conform 2026-08-01", text)
    assert "Serial, name, model or place" not in text
    assert "Diagnoses" not in text
