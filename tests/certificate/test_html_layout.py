"""The HTML view in a real browser: on a phone, on a screen, on paper."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from pypdf import PdfReader

from cmm_uq.certificate.document import Column, Document, Section, Table
from cmm_uq.certificate.render import render_html
from tests.certificate.samples import HOSTILE, NUMBER, UNBREAKABLE, document_of

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

OVERLAPS = """() => {
  const shown = element => {
    let box = element.getBoundingClientRect(), frame = element.closest('.scroll');
    let {left, top, right, bottom} = box;
    if (frame && frame !== element) {
      const f = frame.getBoundingClientRect();
      left = Math.max(left, f.left); right = Math.min(right, f.right);
    }
    return {left, top, right, bottom};
  };
  const leaves = [...document.querySelectorAll('h1,h2,h3,p,dt,dd,th,td,li,figcaption,address,figure svg')]
    .map(element => ({element, ...shown(element)})).filter(b => b.right > b.left && b.bottom > b.top);
  leaves.sort((a, b) => a.top - b.top);
  const pairs = [];
  for (let i = 0; i < leaves.length; i++) for (let j = i + 1; j < leaves.length; j++) {
    const a = leaves[i], b = leaves[j];
    if (b.top >= a.bottom - 1) break;  // nor is any that follows as high
    const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const high = Math.min(a.bottom, b.bottom) - b.top;
    if (wide <= 1 || high <= 1 || a.element.contains(b.element) || b.element.contains(a.element)) continue;
    pairs.push([a.element.textContent.slice(0, 40), b.element.textContent.slice(0, 40)]);
  }
  return pairs;
}"""

LABELS_COLLIDING = """() => [...document.querySelectorAll('figure svg')].flatMap(svg => {
  const boxes = [...svg.querySelectorAll('text')].filter(t => !(t.getAttribute('transform') || '').includes('rotate'))
    .map(text => ({text: text.textContent, ...text.getBoundingClientRect().toJSON()}));
  return boxes.flatMap((a, i) => boxes.slice(i + 1).filter(b =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2
  ).map(b => [a.text, b.text]));
})"""

CONTRASTS = """() => {
  const linear = v => v <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
  const light = c => { const [r, g, b] = c.map(v => linear(v / 255)); return .2126 * r + .7152 * g + .0722 * b; };
  const rgb = text => text.match(/[\\d.]+/g).map(Number);
  const known = new Map();
  const ground = e => {
    if (!e) return [255, 255, 255];
    if (!known.has(e)) {
      const c = rgb(getComputedStyle(e).backgroundColor);
      known.set(e, c.length < 4 || c[3] > 0 ? c.slice(0, 3) : ground(e.parentElement));
    }
    return known.get(e);
  };
  const speaks = e => [...e.childNodes].some(node => node.nodeType === 3 && node.data.trim());
  return [...document.querySelectorAll('body *')].filter(speaks).map(e => {
    const ink = rgb(getComputedStyle(e)[e.namespaceURI.endsWith('svg') ? 'fill' : 'color']).slice(0, 3);
    const [a, b] = [light(ink), light(ground(e))];
    return (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
  });
}"""

WIDER_THAN_PAPER = """() => [...document.querySelectorAll('body *')]
  .filter(element => element.getBoundingClientRect().right > 644).map(element => element.textContent.slice(0, 40))"""


class Opened:
    """A document in the browser, with all it asked for and complained of."""

    def __init__(self, page: Page, document: Document, folder: Path) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda message: self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        path = folder / "certificate.html"
        path.write_text(render_html(document), encoding="utf-8")
        self.address = path.as_uri()
        page.goto(self.address)


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    yield page
    page.close()


@pytest.mark.long
@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_overlaps_or_leaves_the_page(page: Page, certificate: Document, tmp_path: Path, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    Opened(page, certificate, tmp_path)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate(LABELS_COLLIDING) == []


@pytest.mark.long
@pytest.mark.parametrize("width", [360, 1280])
def test_hostile_text_stays_on_the_page(page: Page, tmp_path: Path, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    opened = Opened(page, document_of(f"{HOSTILE} {UNBREAKABLE}"), tmp_path)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(OVERLAPS) == []
    assert opened.complaints == []


@pytest.mark.long
def test_the_browser_asks_for_nothing_and_complains_of_nothing(
    page: Page, certificate: Document, tmp_path: Path
) -> None:
    opened = Opened(page, certificate, tmp_path)
    assert [url for url in opened.requests if not url.startswith("data:")] == [opened.address]
    assert opened.complaints == []


@pytest.mark.long
def test_a_wide_table_scrolls_in_its_own_frame(page: Page, certificate: Document, tmp_path: Path) -> None:
    page.set_viewport_size({"width": 360, "height": 800})
    Opened(page, certificate, tmp_path)
    frames = page.evaluate("[...document.querySelectorAll('.scroll')].map(f => f.scrollWidth > f.clientWidth)")
    assert any(frames)


@pytest.mark.long
def test_text_has_enough_contrast(page: Page, certificate: Document, tmp_path: Path) -> None:
    """WCAG 2.2, 1.4.3: at least 4.5 : 1 for text of every size that is used."""
    Opened(page, certificate, tmp_path)
    ratios = page.evaluate(CONTRASTS)
    assert len(ratios) > 100
    assert min(ratios) >= 4.5


@pytest.mark.long
def test_on_paper_nothing_is_wider_than_the_page(page: Page, certificate: Document, tmp_path: Path) -> None:
    page.set_viewport_size({"width": 643, "height": 900})  # 170 mm at 96 px an inch
    Opened(page, certificate, tmp_path)
    page.emulate_media(media="print")
    assert page.evaluate(WIDER_THAN_PAPER) == []
    assert page.evaluate(OVERLAPS) == []


@pytest.mark.long
def test_every_printed_page_says_which_it_is(page: Page, certificate: Document, tmp_path: Path) -> None:
    Opened(page, certificate, tmp_path)
    printed = PdfReader(io.BytesIO(page.pdf(prefer_css_page_size=True)))
    texts = [" ".join(sheet.extract_text().replace("ﬁ", "fi").split()) for sheet in printed.pages]
    assert 4 <= len(texts) <= 7
    for number, text in enumerate(texts, start=1):
        assert NUMBER in text
        assert f"Page {number} of {len(texts)}" in text
    assert "End of certificate" in texts[-1]
    width, height = printed.pages[0].mediabox[2:]
    assert (float(width), float(height)) == pytest.approx((595.3, 841.9), abs=1.0)


@pytest.mark.long
def test_a_table_over_several_sheets_has_its_heading_on_each(page: Page, certificate: Document, tmp_path: Path) -> None:
    rows = tuple((f"place {k}", f"{404 + k / 1000:.4f}") for k in range(150))
    table = Table("Lengths", (Column("Position", numeric=False), Column("Length", "mm")), rows)
    Opened(page, replace(certificate, sections=(Section("Results", (table,)),)), tmp_path)
    printed = PdfReader(io.BytesIO(page.pdf(prefer_css_page_size=True)))
    sheets = [" ".join(sheet.extract_text().split()) for sheet in printed.pages]
    filled = [text for text in sheets if "place" in text]
    assert len(filled) >= 3
    assert all("Position" in text for text in filled)
    found = re.findall(r"(place \d+) (404\.\d{4})", " ".join(filled))
    assert sorted(found) == sorted(rows)
