"""The second study's runs: taken up again, sealed before, and no other verdict for what is left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.second.cases import CAUSES, KINDS, NOTHING, case, write
from benchmarks.second.expansions import estimated
from benchmarks.second.page import write as write_page
from benchmarks.second.running import completed, diagnosed, done, kept, lines, sealed, tasks


def test_a_part_of_a_run_has_some_of_every_kind(tmp_path: Path) -> None:
    first = [task[2] for task in tasks(tmp_path, 0, 6, 30, "make")[:168]]
    assert {kind: first.count(kind) for kind in KINDS} == {**dict.fromkeys(NOTHING, 15), **dict.fromkeys(CAUSES, 3)}


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


def test_the_page_counts_what_was_run_and_says_what_was_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = {"kind": "nothing, white", "design": "plate", "hidden": {}, "rivals": {}, "wanted": {}}
    truths = [
        *({**nothing, "name": f"n{i}"} for i in range(20)),
        {**nothing, "name": "a", "kind": "one", "hidden": {"scale_x": 2.0}, "wanted": {"scale_x": 5.0}},
        {
            **nothing,
            "name": "p",
            "kind": "artefact, pattern",
            "wanted": {"pattern": 9.0},
            "is": ["artefact_pattern"],
            "alike": [],
            "same": [],
        },
    ]
    quiet = {"verdict": "consistent", "p": 0.5, "groups": [], "effects": {}, "seconds": 1.0}
    named = {"probability": 0.97, "together": 0.97, "parameters": {"ppm": [2.5, 0.4, 1.7, 3.3]}}
    loud = {"verdict": "explained", "p": 0.0, "groups": [], "effects": {"scale_x": named}, "seconds": 3.0}
    found = {t["name"]: quiet for t in truths[1:20]} | {"n0": loud, "a": loud, "p": loud}
    oracles = {"a": {"estimates": {"effects": ["scale_x"]}, "knows": {"effects": []}, "seconds": 0.5}}
    write_page(truths, found, oracles, "0" * 64, (60, 300, 9), tmp_path)
    page = (tmp_path / "diagnosis-second-study.md").read_text(encoding="utf-8")
    assert "22 cases were diagnosed of 22 made with seed 9" in page
    assert "| False alarms, pooled | ≤ 2 % | 1 of 20: 5.0 % (0.1–24.9) | **not kept** |" in page
    assert (
        "| Machine physics asserted for an artefact's fault | ≤ 1 % | 1 of 1: 100.0 % (2.5–100.0) | **not kept** |"
        in page
    )
    assert (
        "| one | 1 of 1: 100.0 % (2.5–100.0) | 1 of 1: 100.0 % (2.5–100.0) | 0 of 1: 0.0 % (0.0–97.5) | 0 | 0 | 0 |"
        in page
    )
    assert "| 0.9–1.0 | 0.970 | 1 of 3 (0.01–0.91) |" in page
    assert "| `ppm` | 1 of 1: 100.0 % (2.5–100.0) |" in page
    assert (tmp_path / "images" / "diagnosis-second-study.png").stat().st_size > 10_000
    assert "- False alarms, pooled: more than 2 % of white (1 of 20)." in page
    assert "- Machine physics asserted for an artefact's fault: scale_x (case p: plate, artefact, pattern)." in page
    assert "--cases 60 --nulls 300 --seed 9 --workers" in page
    assert "22 cases" in capsys.readouterr().out


def test_a_candidate_that_only_the_noise_of_an_attitude_shows_ends_no_diagnosis(tmp_path: Path) -> None:
    """A level plate displayed in steps of 5 µm: its own squareness YZ follows these, and least squares ran away with it."""
    made = case(20261124, "nothing, display", 258)
    write(made, tmp_path)
    assert "artefact_squareness_yz" not in diagnosed(tmp_path / made.name, whole=True)["effects"]


def test_truths_of_earlier_runs_are_told_which_effects_a_fault_of_the_artefact_is() -> None:
    """A record as it was written before, of an artefact whose temperature changed."""
    made = json.loads(json.dumps(case(20261124, "artefact, temperature", 0).truth))
    name = f"{KINDS.index('artefact, temperature'):02d}-0"
    before = {"name": name, **{key: value for key, value in made.items() if key not in ("is", "alike", "same")}}
    other = {"name": "00-0", "kind": "nothing, white"}
    after = completed([before, other], 20261124)
    assert after[0]["fault"] == "another temperature in every set-up"
    assert after[0]["is"] == ["artefact_set_up_temperature"]  # the mean of all cannot be seen by itself
    assert json.loads(json.dumps(after[0])) == {"name": name, **made}
    assert after[1] is other


def test_an_expansion_is_estimated_where_one_is_concealed() -> None:
    assert estimated((5, 3)) is None
    name, _, _, pull = estimated((5, 0)) or ("", False, False, 9.0)
    assert name.startswith("thermal_scale_")
    assert abs(pull) < 5
