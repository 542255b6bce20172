"""``--language``: documents in another language, everything for programs as it is in English."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cmm_uq.certificate.plots import style as fonts
from tests.app.cli.process import run
from tests.certificate.test_translatable import MODEL


@pytest.fixture(scope="module")
def german(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a report in German and, beside it, one in English."""
    folder = tmp_path_factory.mktemp("language")
    example = Path(__file__).parents[3] / "examples" / "iota-1102-20C"
    told = [
        run("report", example, "--out", folder / "de", "--language", "de"),
        run("report", example, "--out", folder / "en"),
    ]
    assert [process.returncode for process in told] == [0, 0]
    assert told[0].stdout.splitlines()[0] == told[1].stdout.splitlines()[0]
    return folder / "de"


def test_the_documents_are_in_the_language(german: Path) -> None:
    page = (german / "certificate.html").read_text(encoding="utf-8")
    assert '<html lang="de">' in page
    assert "<h1>Kalibrierschein</h1>" in page
    assert "404,2051" in page
    assert "404.2051" not in page


def test_the_results_are_the_english_ones_but_for_the_name_of_the_language(german: Path) -> None:
    data, english = (json.loads((folder / "results.json").read_bytes()) for folder in (german, german.parent / "en"))
    assert data["job"].pop("language") == "de"
    assert data == english
    assert (german / "posterior.npz").read_bytes() == (german.parent / "en" / "posterior.npz").read_bytes()


def test_a_budget_is_said_in_the_language_with_the_words_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    process = run("budget", tmp_path / "model.toml", "--out", tmp_path / "out", "--language", "fr")
    assert process.returncode == 0, process.stderr
    page = (tmp_path / "out" / "budget.html").read_text(encoding="utf-8")
    assert '<html lang="fr">' in page
    assert "certificate 123" in page
    assert re.search(r"\b0,05\d*", page)
    assert json.loads((tmp_path / "out" / "results.json").read_bytes())["language"] == "fr"


def test_a_language_that_nobody_translated_is_refused(iota: Path, tmp_path: Path) -> None:
    process = run("report", iota, "--out", tmp_path / "out", "--language", "it")
    assert process.returncode == 2
    assert "'de'" in process.stderr
    assert not (tmp_path / "out").exists()


def test_with_a_schedule_jobs_have_the_language_that_they_name(tmp_path: Path) -> None:
    process = run("report", "--scheduled", tmp_path, "--language", "de")
    assert process.returncode == 2
    assert "--language: goes without --scheduled" in process.stderr


def test_japanese_without_its_font_leaves_nothing_behind(
    iota: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fonts, "find_spec", lambda name: None)
    process = run("report", iota, "--out", tmp_path / "out", "--language", "ja")
    assert process.returncode == 2
    assert "cmm-uq[ja]" in process.stderr
    assert not (tmp_path / "out").exists()
