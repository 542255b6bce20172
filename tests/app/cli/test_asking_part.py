"""What is answered at a terminal is the job of a part that runs as it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cmm_uq.analysis.parts.setup import plan_of, refuse_unfit
from cmm_uq.app.cli import asking
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.parts.new import PART
from cmm_uq.jobs.part.job import PartJob, read_part
from tests.conftest import ROOT

CERTIFICATE = ROOT / "examples" / "part-plate-simulated" / "machine" / "certificate-simulated.pdf"
BEGIN = ["Shaft", "D 7", "11.5e-6", str(CERTIFICATE), "3", "0 0 -120", "0.2"]


def seat(name: str, x: float) -> list[str]:
    """A cylinder about the x axis."""
    return [name, "cylinder", f"{x} 0 0", "1 0 0", "30", "n", "20", "24"]


def plane(name: str, at: str, normal: str) -> list[str]:
    return [name, "plane", at, normal, "8", "8", "9"]


def said(monkeypatch: pytest.MonkeyPatch, answers: list[str]) -> list[str]:
    """Answer every question; what was asked."""
    asked: list[str] = []
    given: Iterator[str] = iter(answers)

    def prompt(question: str, default: str, **_: object) -> str:
        asked.append(question)
        return next(given, default)

    monkeypatch.setattr("typer.prompt", prompt)
    return asked


def job_of(folder: Path) -> PartJob:
    write_new(PART, folder, {}, answers=asking.part_answers())
    job = read_part(folder)
    refuse_unfit(job)
    return job


def test_a_shaft_described_at_the_terminal_is_a_sound_job(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    features = [*seat("A", 0), *seat("B", 200), *seat("gear", 100), *plane("end", "-10 0 0", "-1 0 0"),
                *plane("key", "150 0 15", "0 0 1"), ""]  # fmt: skip
    runout, size = ["1", "total_runout", "gear", "A-B", "0.02"], ["2", "size", "gear", "29.9", "30.1"]
    tolerances = [*runout, *size, "3", "x", "gear", "", "99", "", ""]
    said(monkeypatch, [*BEGIN, *features, "A-B, end, key", *tolerances])
    job = job_of(tmp_path / "shaft")
    plan = plan_of(job)
    assert [one.name for one in plan.features] == ["A", "B", "gear", "end", "key"]
    assert [(one.what, one.datums, one.lower, one.upper) for one in plan.characteristics] == [
        ("total_runout", ("A-B",), None, 0.02), ("size", (), 29.9, 30.1), ("x", (), 99.0, None)]  # fmt: skip
    assert plan.alignment.datums == ("A-B", "end", "key")
    assert job.machine_files["machine/certificate-simulated.pdf"] == CERTIFICATE.read_bytes()
    assert job.facts.stylus[0].diameter_mm == 3.0


def test_an_answer_that_no_reader_would_take_is_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A certificate that is not there, a word for a number, too few points, loose datums, a size of a plane."""
    begin = [*BEGIN[:3], "nowhere.pdf", *BEGIN[3:4], "three", *BEGIN[4:]]
    few = ["A", "circel", "circle", "0 0", "0 0 0", "0 0 1", "30", "perhaps", "y", "2"]
    again = ["circle", "0 0 0", "0 0 1", "30", "y", "8", "A", "top", *plane("top", "0 0 0", "0 0 1")[1:], ""]
    aligned = ["top, A", "best fit"]
    size = ["1", "size", "top", "1", "2", "size", "A", "29.9", "30.1", ""]
    said(monkeypatch, [*begin, *few, *again, *aligned, *size])
    job = job_of(tmp_path / "part")
    told = " ".join(capsys.readouterr().out.split())
    assert [(one.facts.name, len(one.points)) for one in job.features] == [("A", 8), ("top", 9)]
    for words in ("'three' is not understood", "'circel' is none of them. Did you mean 'circle'", "'perhaps' is not",
                  "2 points are too few for a circle", "'A' is there already", "leave free rotation about z",
                  "a size is of a circle or sphere or cylinder, and 'top' is a plane"):  # fmt: skip
        assert words in told


def test_where_no_feature_is_named_the_job_is_that_of_the_example(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = said(monkeypatch, [*BEGIN, ""])
    job = job_of(tmp_path / "plate")
    assert [one.facts.name for one in job.features] == ["A", "B", "C", "bore"]
    assert asked[-1] == "Name of a feature, empty for no more"
