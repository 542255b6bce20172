"""What the third study counts as right, located and withheld; and a run that is stopped and taken up again."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from benchmarks.second.cases import seal
from benchmarks.second.running import lines
from benchmarks.third import running, study
from benchmarks.third.cases import CYCLE, Hidden, case
from benchmarks.third.judging import Judged, Name, calibration, covariates_of, judged
from benchmarks.third.page import figures

IMPROVEMENT = {"heldout_rms_before_um": 4.0, "heldout_rms_after_um": 3.0}


def of_kind(kind: str, seed: int = 6) -> tuple[Hidden, dict[str, Any]]:
    number = next(i for i in range(len(CYCLE)) if CYCLE[i] == kind)
    found = case(seed, number)
    return found, {"name": found.one.name, **found.one.truth}


def oracle(form: str, least: float) -> dict[str, Any]:
    return {"p_covariate": 0.005, "p_form": 1e-9, "heldout_before_um": 4.0, "heldout_after_um": 2.0,
            "log_odds": {"smooth": least, "other": least + 1, form + "?": 50.0}}  # fmt: skip


def said(verdict: str, *functions: dict[str, Any], effects: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    found: dict[str, Any] = {"verdict": verdict, "where": [], "effects": list(effects), "improvement": IMPROVEMENT}
    if functions:
        found["empirical"] = {"functions": list(functions), "heldout_rms_before_um": 4.0, "heldout_rms_after_um": 2.5}
    return found


def function(found: Hidden, name: str | None) -> dict[str, Any]:
    assert found.outside is not None
    of: Any = list(found.outside.of) if len(found.outside.of) > 1 else found.outside.of[0]
    form = name and {"name": name, "probability": 0.9, "parameters": {}}
    return {"of": of, "along": "xyz"[found.outside.along], "scale": found.outside.scale, "name": "words", "form": form}


def test_a_diagnosis_that_knows_no_empirical_model_is_counted() -> None:
    found, truth = of_kind("dictionary")
    assert found.outside is not None
    one = judged(found, truth, said("consistent"), oracle(found.outside.form, 9.0))
    assert (one.located, one.form_named, one.form_said, one.decided) == (False, False, None, True)
    assert one.taken == (0.25, 0.5)


def test_the_true_form_is_right_another_wrong_and_none_withheld() -> None:
    found, truth = of_kind("dictionary")
    assert found.outside is not None
    form, far = found.outside.form, oracle(found.outside.form, 9.0)
    named = judged(found, truth, said("explained", function(found, form)), far)
    assert named.located
    assert named.form_named
    assert [(n.right, n.wrong) for n in named.names] == [(True, False)]
    assert named.taken == (0.375, 0.5)
    wrong = "cubic" if form != "cubic" else "bowl"
    far["log_odds"][wrong] = 9.0
    missed = judged(found, truth, said("explained", function(found, wrong)), far)
    assert not missed.form_named
    assert missed.names[0].wrong
    far["log_odds"][wrong] = 2.0
    assert not judged(found, truth, said("explained", function(found, wrong)), far).names[0].wrong
    empirical = judged(found, truth, said("empirical", function(found, None)), far)
    assert empirical.located
    assert empirical.form_said is None
    denied = said("unexplained", function(found, None))
    denied["empirical"] |= {"predicts": False, "heldout_rms_after_um": 6.0}
    assert judged(found, truth, denied, far).taken == (0.25, 0.5)


def test_an_effect_is_right_where_the_truth_is_in_its_group() -> None:
    found, truth = of_kind("squareness")
    effect = {"effect": "rotation_x_x", "probability": 0.6, "probability_together": 0.9, "parameters": {}}
    nothing = {"effects": [], "p": 0.5}
    alone = judged(found, truth, said("explained", effects=(effect,)), nothing)
    assert [(n.probability, n.right) for n in alone.names] == [(0.6, False)]
    grouped = judged(found, truth, said("explained", effects=(effect | {"group": ["squareness_xy"]},)), nothing)
    assert [(n.probability, n.right) for n in grouped.names] == [(0.9, True)]
    listed = said("explained", effects=(effect,)) | {"indistinguishable": [["rotation_x_x", "squareness_zx"]]}
    assert judged(found, truth, listed, nothing).names[0].right
    all_three = [{"effect": name, "probability": 0.9} for name in ("squareness_xy", "squareness_yz", "squareness_zx")]
    assert judged(found, truth, said("explained", effects=tuple(all_three)), nothing).found == (True, False)


def test_a_class_is_counted_with_the_members_that_the_recording_parts_from_its_best() -> None:
    """Of three squarenesses of √λ above 4.5 each, two named, the third is one with itself and parted from a scale of Z."""
    found, truth = of_kind("squareness")
    first, second, third = found.errors
    effects = [{"effect": name, "probability": 0.9} for name in (first, second)]
    effects.append(
        {"effect": third, "probability": 0.5, "probability_together": 0.9, "group": ["scale_z", "some words"]}
    )
    one = judged(found, truth, said("explained", effects=tuple(effects)), {"effects": [], "p": 0.5})
    assert one.classes == [(2, 1)]
    assert one.found == (True, False)


def test_another_run_is_read_as_it_was_counted(tmp_path: Path) -> None:
    one = Judged("0", "dictionary", "step", "plate", "white", 9.0, "partial", taken=(0.2, 0.4), classes=[(2, 1)],
                 names=[Name("scale_x", 0.9, right=False, wrong=True, form=False)])  # fmt: skip
    (tmp_path / "counted.json").write_text(json.dumps([asdict(one)]), encoding="utf-8")
    (again,) = study.recounted(tmp_path / "counted.json")
    assert figures([again]) == figures([one])


def test_nothing_is_a_false_alarm_where_something_is_asserted() -> None:
    found, truth = of_kind("nothing")
    alarms = {
        v: judged(found, truth, said(v), {"effects": []}).alarm for v in ("consistent", "undetermined", "empirical")
    }
    assert alarms == {"consistent": False, "undetermined": False, "empirical": True}


@pytest.mark.parametrize("of", [["x_mm", "y_mm"], "x_mm, y_mm", "x_mm × y_mm", "y_mm·x_mm"])
def test_two_covariates_are_read_as_a_list_or_as_words(of: Any) -> None:
    assert covariates_of({"of": of}) == {"x_mm", "y_mm"}


def test_what_is_right_as_often_as_is_said_is_calibrated() -> None:
    def names(right: int) -> list[Name]:
        return [Name("a", 0.8, i < right, i >= right, form=False) for i in range(100)]

    assert calibration(names(80)) == pytest.approx(1.0)
    assert calibration(names(70)) == pytest.approx(0.0124, abs=1e-3)  # two-sided normal, 10 over 4


def test_figures_are_those_of_the_cases() -> None:
    def one(**more: Any) -> Judged:
        return Judged("0", "dictionary", "step", "plate", "white", 9.0, "empirical", **more)

    every = [one(oracle_sees=True, located=i < 19, taken=(0.3, 0.4), decided=i < 10, form_named=i < 8,
                 form_said=None if i >= 9 else "step") for i in range(20)]  # fmt: skip
    rows = {row.asked: row for row in figures(every)}
    assert rows["Outside, located where the oracle sees it"].shown.startswith("19 of 20: 95.0 %")
    assert rows["Outside, located where the oracle sees it"].kept
    assert rows["Held-out rms that goes, of what the oracle removes"].shown.startswith("75 %, of 20")
    assert rows["Form named where the oracle decides"].shown.startswith("8 of 10")
    assert rows["Form withheld where it does not"].shown.startswith("10 of 10")
    assert rows["Form withheld where it does not"].kept is None  # too few


@pytest.mark.long
def test_a_run_is_sealed_stopped_and_taken_up_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def diagnosed(folder: Path) -> dict[str, Any]:
        if len(calls) == 2:
            calls.append("stopped")
            raise KeyboardInterrupt
        assert (folder / "job.toml").exists()
        calls.append(folder.name)
        return said("consistent")

    monkeypatch.setattr(running, "diagnosed", diagnosed)
    arguments = ["study", str(tmp_path / "run"), "--count", "4", "--seed", "9", "--page", str(tmp_path)]
    for more in ([], ["--resume"]):
        monkeypatch.setattr(sys, "argv", [*arguments, *more])
        study.main()
    assert calls == ["0000", "0001", "stopped", "0002", "0003"]
    records = lines(tmp_path / "run" / "said.jsonl")
    assert [record["name"] for record in records] == ["0000", "0001", "0002", "0003"]
    truths = lines(tmp_path / "run" / "truths.jsonl")
    book = (tmp_path / "run" / "sealed.txt").read_text(encoding="utf-8")
    assert book.startswith(f"{seal(truths)}  4 cases, 0 of them diagnosed before")
    assert json.loads(json.dumps(case(9, 3).one.truth)) == {
        k: v for k, v in truths[3].items() if k not in ("name", "number")
    }
    page = (tmp_path / "diagnosis-studies.md").read_text(encoding="utf-8")
    assert "4 cases were diagnosed of 4 made with seed 9" in page
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit):
        study.main()
