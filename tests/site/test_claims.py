"""What the documentation claims is what the pages that it rests on say, and what the examples hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import cmm_uq
from cmm_uq.artefacts import BUILT_IN
from tests.conftest import ROOT
from tests.site.pages import snippets

DOCS = ROOT / "docs"
VALIDATION = "\n".join((DOCS / name).read_text(encoding="utf-8") for name in ("validation.md", "validation-parts.md"))
ROWS = [line for line in VALIDATION.splitlines() if line.startswith("|") and "**" in line]
GALLERY = (DOCS / "gallery.md").read_text(encoding="utf-8")


def plain(text: str) -> str:
    """Without marks of Markdown and line breaks."""
    return re.sub(r"\s+", " ", re.sub(r"[*`]", "", text))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[2:40].strip())
def test_a_figure_stands_on_the_page_that_is_named_for_it(row: str) -> None:
    pages = re.findall(r"\]\(([^)#]+\.md)[^)]*\)", row)
    lines = [
        line for page in pages for line in (DOCS / page).read_text(encoding="utf-8").splitlines() if line not in ROWS
    ]
    told = plain(" ".join(lines))
    for figure in re.findall(r"\*\*(.+?)\*\*", row):
        assert plain(figure) in told, (figure, pages)


def test_a_study_that_can_be_run_again_is_there() -> None:
    scripts = re.findall(r"`python (?:-m )?(benchmarks[./\w]+)", VALIDATION)
    assert len(scripts) >= 10
    for name in scripts:
        assert (ROOT / (name if name.endswith(".py") else name.replace(".", "/") + ".py")).is_file(), name
    for job in re.findall(r"`cmm-uq report (\S+)`", VALIDATION):
        assert (ROOT / job / "job.toml").is_file()


def test_the_gallery_has_every_kind_with_its_pictures() -> None:
    artefacts = [
        block.text for block in snippets(DOCS / "gallery.md", "toml", excerpt=True) if "[artefact]" in block.text
    ]
    assert {re.search(r'kind = "(\w+)"', text)[1] for text in artefacts} == set(BUILT_IN)  # type: ignore[index]


def test_what_the_gallery_shows_of_a_job_stands_in_it() -> None:
    jobs = re.findall(r"\]\(\.\./(examples/[\w.-]+/job\.toml)\)", GALLERY)
    blocks = snippets(DOCS / "gallery.md", "toml", excerpt=True)
    assert len(jobs) == len(blocks)
    for job, block in zip(jobs, blocks, strict=True):
        assert block.text in (ROOT / job).read_text(encoding="utf-8"), job


@pytest.mark.parametrize("picture", sorted((DOCS / "images").rglob("*.*")), ids=lambda path: path.name)
def test_a_picture_is_small_and_shown(picture: Path) -> None:
    assert picture.stat().st_size <= (60_000 if picture.parent.name in ("gallery", "tutorial") else 120_000)
    pages = [*DOCS.rglob("*.md"), ROOT / "README.md"]
    assert any(picture.name in page.read_text(encoding="utf-8") for page in pages)


def test_every_public_name_has_its_place_in_the_reference() -> None:
    page = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"\.\. auto(?:function|exception):: cmm_uq\.(\w+)$", page, re.MULTILINE))
    assert named == set(cmm_uq.__all__) - {"__version__"}
