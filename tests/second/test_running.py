"""The second study's runs: taken up again, sealed before, and no other verdict for what is left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.second.cases import KINDS, case, write
from benchmarks.second.expansions import estimated
from benchmarks.second.running import diagnosed, done, kept, lines, sealed, tasks


@pytest.mark.long
def test_a_consistent_recording_has_the_same_verdict_whether_its_posterior_is_sampled_or_not(tmp_path: Path) -> None:
    made = case(31, "nothing, real", 0)
    write(made, tmp_path)
    short, whole = diagnosed(tmp_path / made.name), diagnosed(tmp_path / made.name, whole=True)
    assert short["verdict"] == "consistent"
    assert short == whole


def test_a_run_is_taken_up_where_it_was_left_and_sealed_before_it_begins(tmp_path: Path) -> None:
    """A line that was cut off is made again; the seal names how many were diagnosed before it."""
    file, listed = tmp_path / "make.jsonl", tasks(tmp_path, 5, 1, 1, "make")[:2]
    file.write_text(json.dumps(done(listed[0])) + "\n" + json.dumps(done(listed[1]))[:40], encoding="utf-8")
    kept(listed, file, workers=1)
    assert [record["name"] for record in lines(file)] == [f"{KINDS.index(k):02d}-{n}" for _, _, k, n, _ in listed]
    truths, mark = sealed(tmp_path, listed)
    assert sealed(tmp_path, listed) == (truths, mark)
    book = (tmp_path / "sealed.txt").read_text(encoding="utf-8").splitlines()
    assert len(book) == 1
    assert book[0].startswith(f"{mark}  2 cases, 0 of them diagnosed before, ")


@pytest.mark.long
def test_a_candidate_that_only_the_noise_of_an_attitude_shows_ends_no_diagnosis(tmp_path: Path) -> None:
    """A level plate displayed in steps of 5 µm: its own squareness YZ follows these, and least squares ran away with it."""
    made = case(20261124, "nothing, display", 258)
    write(made, tmp_path)
    assert "artefact_squareness_yz" not in diagnosed(tmp_path / made.name, whole=True)["effects"]


@pytest.mark.long
def test_an_expansion_is_estimated_where_one_is_concealed() -> None:
    assert estimated((5, 3)) is None
    name, _, _, pull = estimated((5, 0)) or ("", False, False, 9.0)
    assert name.startswith("thermal_scale_")
    assert abs(pull) < 5
