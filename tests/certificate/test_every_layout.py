"""How the documents of every kind look in a browser and on paper: nothing cut, hidden, split or alone on its page."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from pypdf import PdfReader

from cmm_uq.app.commands.reading import read_job
from cmm_uq.certificate.clauses import STATEMENTS
from cmm_uq.certificate.document import Block, Document, Facts, Plot, Section, Table
from cmm_uq.certificate.origin import marked
from cmm_uq.certificate.pages.budget import budget_document
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.maths.uncertainty.models.model_file import read_model_file
from tests.artefacts.simulated import diagnosed, document, planned
from tests.certificate.samples import ballbar_certificate
from tests.certificate.test_html_layout import CONTRASTS, LABELS_COLLIDING, OVERLAPS, WIDER_THAN_PAPER
from tests.certificate.test_translatable import MODEL
from tests.conftest import MACHINE_JOBS, ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

REPORTED = sorted(
    path.name for path in MACHINE_JOBS if not path.name.startswith("plan-") and path.name != "iota-1102-maps"
)


def report(name: str) -> Document:
    return marked(document(name), read_job(ROOT / "examples" / name))


def budget(folder: str) -> Document:
    file = Path(folder) / "budget-model.toml"
    file.write_text(MODEL, encoding="utf-8")
    model = read_model_file(file)
    return budget_document(model, model.evaluate(), file.name)


OTHERS: Mapping[str, Callable[[str], Document]] = {
    "diagnosis of iota-1102-20C": lambda _: diagnosed("iota-1102-20C"),
    "diagnosis against a simulation": lambda _: diagnosed("iota-1102-20C-against-simulation"),
    "diagnosis of iota-1102-maps": lambda _: diagnosed("iota-1102-maps"),
    "plan of plan-ballbar": lambda _: planned("plan-ballbar"),
    "plan of plan-step-gauge": lambda _: planned("plan-step-gauge"),
    "sample": lambda _: ballbar_certificate(),
    "budget": budget,
}
NAMES = [*REPORTED, *OTHERS]
ONE_OF_A_SORT = ("iota-1102-20C", "shift-plate-simulated", "diagnosis of iota-1102-20C", "plan of plan-ballbar", "sample",
                 "budget")  # fmt: skip


@cache
def made(name: str, folder: str) -> Document:
    return OTHERS[name](folder) if name in OTHERS else report(name)


@cache
def html(name: str, folder: str) -> str:
    return render_html(made(name, folder))


@cache
def pdf(name: str, folder: str) -> bytes:
    return render_pdf(made(name, folder), {})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(tmp_path_factory.mktemp("layout"))


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(bypass_csp=True)  # axe is a script, and the page allows none
    yield context.new_page()
    context.close()


def shown(page: Page, document: str, folder: Path) -> None:
    path = folder / "document.html"
    path.write_text(document, encoding="utf-8")
    page.goto(path.as_uri())


HIDDEN_COLUMNS = """() => [...document.querySelectorAll('.scroll:has(table)')]
  .filter(frame => frame.scrollWidth > frame.clientWidth)
  .map(frame => frame.parentElement.querySelector('figcaption').textContent)"""

HEADS_RUN_TOGETHER = """() => [...document.querySelectorAll('thead tr')].flatMap(row => {
  const boxes = [...row.cells].map(cell => {
    const range = document.createRange();
    range.selectNodeContents(cell);
    return {text: cell.textContent, ...range.getBoundingClientRect().toJSON()};
  }).filter(box => box.width > 0);
  return boxes.slice(1).map((box, i) => [boxes[i], box]).filter(([a, b]) => b.left - a.right < 3)
    .map(([a, b]) => [a.text, b.text]);
})"""

CUT_LABELS = """() => [...document.querySelectorAll('figure svg')].flatMap(svg => {
  const frame = svg.getBoundingClientRect();
  return [...svg.querySelectorAll('text')].filter(text => {
    const box = text.getBoundingClientRect();
    return box.left < frame.left - 1 || box.right > frame.right + 1
      || box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
  }).map(text => text.textContent);
})"""


def whole(page: Page, width: int) -> None:
    """No column is off the screen and no label is cut or on another."""
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(HIDDEN_COLUMNS) == []
    assert page.evaluate(HEADS_RUN_TOGETHER) == []
    assert page.evaluate(CUT_LABELS) == []
    assert page.evaluate(LABELS_COLLIDING) == []
    assert page.evaluate(OVERLAPS) == []


@pytest.mark.long(but="iota-1102-20C-compensated")
@pytest.mark.parametrize("name", NAMES)
def test_on_a_narrow_screen_nothing_is_cut_and_every_figure_of_a_listed_table_has_its_heading_and_unit(
    page: Page, name: str, folder: str, tmp_path: Path
) -> None:
    page.set_viewport_size({"width": 360, "height": 800})
    shown(page, html(name, folder), tmp_path)
    whole(page, 360)
    labelled = page.evaluate("""() => [...document.querySelectorAll('table.wide td')]
      .filter(cell => cell.textContent).map(cell => getComputedStyle(cell, '::before').content.slice(1, -1))""")
    wide = page.evaluate("""() => [...document.querySelectorAll('table.wide tr')].slice(1).flatMap(row => [...row.cells])
      .filter(cell => cell.textContent && cell.tagName === 'TD').map(cell => {
        const head = cell.closest('table').tHead.rows[0].cells[cell.cellIndex];
        const unit = head.querySelector('.unit');
        const name = head.firstChild ? head.firstChild.textContent.trim() : '';
        return unit ? `${name} / ${unit.textContent}` : name;
      })""")
    assert labelled == wide


@pytest.mark.long(but="triangle-simulated")
@pytest.mark.parametrize("name", NAMES)
def test_on_a_wide_screen_nothing_is_cut_and_axe_finds_nothing(
    page: Page, name: str, folder: str, tmp_path: Path
) -> None:
    """axe-core with all its rules, which hold WCAG 2.2 A and AA; contrast by it on one of a sort, of every text by itself."""
    page.set_viewport_size({"width": 1280, "height": 800})
    shown(page, html(name, folder), tmp_path)
    whole(page, 1280)
    options = {"resultTypes": ["violations"], "rules": {"color-contrast": {"enabled": name in ONE_OF_A_SORT}}}
    found: list[dict[str, Any]] = Axe().run(page, options=options).response["violations"]
    assert [(one["id"], [node["html"][:80] for node in one["nodes"]]) for one in found] == []
    assert min(page.evaluate(CONTRASTS)) >= 4.5


@pytest.mark.long(but="triangle")
@pytest.mark.parametrize("name", NAMES)
def test_every_picture_has_words_in_its_place(name: str, folder: str) -> None:
    plots = [block for block in blocks(made(name, folder).sections) if isinstance(block, Plot)]
    assert all(len(plot.alternative.split()) >= 3 for plot in plots)
    assert all(plot.alternative != plot.caption for plot in plots)


@pytest.mark.long(but="step-gauge-simulated")
@pytest.mark.parametrize("name", NAMES)
def test_printed_from_the_browser_nothing_is_wider_than_the_page_nor_split_nor_alone(
    page: Page, name: str, folder: str, tmp_path: Path
) -> None:
    document = made(name, folder)
    page.set_viewport_size({"width": 643, "height": 900})  # 170 mm at 96 px an inch
    shown(page, html(name, folder), tmp_path)
    page.emulate_media(media="print")
    assert page.evaluate(WIDER_THAN_PAPER) == []
    assert page.evaluate(HEADS_RUN_TOGETHER) == []
    together(document, texts(page.pdf(prefer_css_page_size=True)))


@pytest.mark.parametrize("name", NAMES)
def test_in_the_pdf_nothing_is_split_nor_alone(name: str, folder: str) -> None:
    document = made(name, folder)
    together(document, texts(pdf(name, folder)))


@pytest.mark.parametrize("name", NAMES)
def test_the_pages_of_the_pdf_as_pictures_have_clean_margins_and_are_not_empty(
    name: str, folder: str, tmp_path: Path
) -> None:
    if shutil.which("pdftoppm") is None:
        pytest.skip("no pdftoppm is installed")
    (tmp_path / "document.pdf").write_bytes(pdf(name, folder))
    subprocess.run(["pdftoppm", "-r", "50", "-gray", "document.pdf", "page"], cwd=tmp_path, check=True)
    pictures = [picture(path) for path in sorted(tmp_path.glob("page*.pgm"))]
    for dark in pictures:
        across, down = np.flatnonzero(dark.any(axis=0)) / 50 * 25.4, np.flatnonzero(dark.any(axis=1)) / 50 * 25.4
        assert across.min() >= 18.5
        assert across.max() <= 191.5
        assert down.min() >= 5
        assert down.max() <= 290
        assert ((down > 30) & (down < 270)).any()  # no page has its head and foot alone


@pytest.mark.parametrize("name", NAMES)
def test_the_heads_of_a_table_do_not_run_together_in_the_pdf(name: str, folder: str, tmp_path: Path) -> None:
    if shutil.which("pdftotext") is None:
        pytest.skip("no pdftotext is installed")
    document = made(name, folder)
    (tmp_path / "document.pdf").write_bytes(pdf(name, folder))
    subprocess.run(["pdftotext", "-layout", "document.pdf", "text.txt"], cwd=tmp_path, check=True)
    printed = (tmp_path / "text.txt").read_text(encoding="utf-8")
    heads = [[column.heading for column in block.columns if column.heading]
             for block in blocks(document.sections) if isinstance(block, Table)]  # fmt: skip
    joined = [a.split()[-1] + b.split()[0] for row in heads for a, b in pairwise(row)]
    assert [pair for pair in joined if len(pair) > 6 and pair in printed] == []


def picture(path: Path) -> np.ndarray:
    """Where a page is dark, from a binary PGM."""
    head, size, most, data = path.read_bytes().split(b"\n", 3)
    assert (head, most) == (b"P5", b"255")
    width, height = map(int, size.split())
    return np.frombuffer(data, dtype=np.uint8).reshape(height, width) < 200


def texts(pdf: bytes) -> list[str]:
    """Of the pages, without spaces and hyphens, which line breaks put in and take away."""
    if shutil.which("pdftotext") is None:
        return [plain(sheet.extract_text()) for sheet in PdfReader(io.BytesIO(pdf)).pages]
    read = subprocess.run(["pdftotext", "-raw", "-", "-"], input=pdf, capture_output=True, check=True)
    return [plain(sheet) for sheet in read.stdout.decode().split("\f")[:-1]]


def plain(text: str) -> str:
    return "".join(text.replace("ﬁ", "fi").replace("ﬂ", "fl").replace("ﬀ", "ff").replace("ﬃ", "ffi").split()).replace(
        "-", ""
    )


def blocks(sections: tuple[Section, ...]) -> list[Block]:
    return [block for section in sections for block in section.blocks]


def last_words(block: Block) -> str:
    """Of a block, the words that are printed last."""
    if isinstance(block, Facts):
        return block.rows[-1][1]
    if isinstance(block, Table):
        return block.notes[-1] if block.notes else block.rows[-1][0]
    if isinstance(block, Plot):
        return block.caption
    return getattr(block, "explanation", "") or getattr(block, "text", "")


def together(document: Document, pages: list[str]) -> None:
    """Facts stand on one page; the closing, and the last line, on a page with something before them."""

    def pages_of(text: str) -> set[int]:
        return {k for k, page in enumerate(pages) if plain(text)[:60] in page}

    for block in (*document.particulars, *blocks(document.sections)):
        if isinstance(block, Facts) and sum(len(text) for row in block.rows for text in row) < 1500:
            assert set.intersection(*(pages_of(label) for label, _ in block.rows)), block
    results = [section for section in document.sections if not section.opinion]
    if document.statements:
        last = document.subject if document.decides else last_words(results[-1].blocks[-1])
        assert pages_of(document.statements[0]) & pages_of(last)
        assert pages_of(document.statements[0]) == pages_of(document.statements[-1])
        assert all(pages_of(one.name) & pages_of(document.statements[-1]) for one in document.signatures)
    end = pages_of(document.end + document.number) or pages_of(document.end)
    assert max(end) == len(pages) - 1
    before = document.sections[-1].blocks[-1]
    assert (len(pages) - 1) in pages_of(last_words(before))


def test_the_statements_of_a_certificate_are_looked_for_as_printed() -> None:
    assert plain(STATEMENTS[0])[:60] == "Theresultsrelateonlytotheitemnamedabove,initsconditionandpla"
