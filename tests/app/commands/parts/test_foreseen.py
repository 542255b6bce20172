"""What further measurements of its machine would do to a part's uncertainty: on its page, and by a plan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from cmm_uq.analysis.parts.foreseen import foreseen_measurement, foretold
from cmm_uq.app.commands.parts.part import PartOptions, evaluate_part
from cmm_uq.app.commands.parts.proposals import bore_of, foresee, proposals
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.certificate.part.budget_section import foreseen_table, foreseen_words
from cmm_uq.certificate.part.measurement import PartMeasurement, part_results
from cmm_uq.jobs.part.job import read_part
from tests.conftest import ROOT, without_diagnosis
from tests.part_reports import drawn_once

PART, CALIBRATION, PLAN = "part-methods-simulated", "bryan-simulated", "plan-step-gauge"


@pytest.fixture(scope="module")
def found() -> Iterator[PartMeasurement]:
    with pytest.MonkeyPatch.context() as patched, without_diagnosis():
        drawn_once(patched)
        yield evaluate_part(read_part(ROOT / "examples" / PART), PartOptions(trials=4000))


def test_what_is_undecided_is_told_what_would_bring_its_uncertainty_down(found: PartMeasurement) -> None:
    said = part_results(found)["foreseen"]
    assert found.too_uncertain == [0, 1, 2, 3]
    for way in said:
        for one, stated in zip(way["characteristics"], found.stated, strict=True):
            assert 0 < one["U_low"] <= one["U"] <= one["U_high"] <= stated.U
    best = min(said, key=lambda way: float(way["characteristics"][0]["U"]))
    assert best["characteristics"][0]["U"] < 0.1 * found.stated[0].U  # faces met from both sides show play, bars do not
    (words,) = foreseen_words(found)
    assert best["measurement"] in words
    assert f"{1e3 * found.stated[0].U:.0f} to " in words
    table = foreseen_table(found)
    assert table is not None
    assert len([row for row in table.rows if row[1]]) == 4


def test_a_ring_of_the_size_of_a_bore_is_among_them_in_its_place(found: PartMeasurement) -> None:
    """The bore whose size is asked for, by hand: its middle as the scales read it, its axis, probed from inside."""
    bore = bore_of(found.plan, found.too_uncertain)
    assert bore is not None
    feature = next(one for one in found.plan.features if one.nominal.diameter_mm == bore.diameter_mm)
    assert [way.name for way in found.foreseen][-1].startswith("calibrated ring of")
    read = found.virtual.places[0].points.carriages[found.plan.rows[feature.name]]
    (*_, ring) = proposals(found.virtual.places[0].points, found.plan.styli[0], bore=bore)
    points = ring.artefact.points
    assert ring.artefact.sizes[0].nominal == bore.diameter_mm
    assert [effect.name for effect in ring.beside] == ["probe_radius"]
    np.testing.assert_allclose(points.carriages.mean(axis=0), read.mean(axis=0), atol=0.01)
    away = points.xyz - points.xyz.mean(axis=0)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), bore.diameter_mm / 2)
    normals = np.column_stack([points.columns[f"n{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(normals, -away / np.linalg.norm(away, axis=1, keepdims=True), atol=1e-9)
    assert all(np.all(points.columns[f"approach_{a}"] * normals[:, i] <= 0) for i, a in enumerate("xyz"))


def test_a_measurement_that_shows_nothing_leaves_today_s_uncertainty(found: PartMeasurement) -> None:
    assert found.recordings is not None
    model, beside = found.recordings
    one = next(proposals(found.virtual.places[0].points, found.plan.styli[0])).recording(
        model, found.given.machine.noise
    )
    nothing = replace(beside, recordings=(*beside.recordings, replace(one, noise=1e6 * one.noise)))
    U = np.array([each.U for each in found.stated])
    then = foreseen_measurement(say("nothing"), found.virtual, found.given, model, nothing, U).U
    np.testing.assert_allclose(then[1] / U, 1.0, atol=0.1)
    seen = replace(beside, recordings=(*beside.recordings, one))
    assert foreseen_measurement(say("all"), found.virtual, found.given, model, seen, U).U[1, 0] < 0.1 * U[0]


def test_nothing_is_tried_where_nothing_is_too_uncertain(found: PartMeasurement) -> None:
    plain = replace(found, judged=(None,) * len(found.judged), foreseen=())
    assert foresee(plain) is plain
    assert foreseen_words(plain) == []
    assert foreseen_table(plain) is None
    assert "foreseen" not in part_results(plain)


@pytest.mark.long
def test_a_plan_tells_what_it_does_for_a_part(tmp_path: Path) -> None:
    for name in (PART, CALIBRATION, PLAN):
        copytree(ROOT / "examples" / name, tmp_path / name)
    job, of = tmp_path / PLAN / "job.toml", tmp_path / PART
    text = job.read_text(encoding="utf-8").replace('criterion = "separation"\nmore = 1\n', "")
    job.write_text(text.replace("length_mm = 1080.0", "length_mm = 500.0"), encoding="utf-8")
    written = write_plan(tmp_path / PLAN, tmp_path / "out", power=False, for_part=of)
    said = json.loads(written.results)["for_part"]
    (way,) = said["foreseen"]
    assert said["job"] == PART
    assert way["characteristics"][0]["U"] < 0.1 * said["characteristics"][0]["U"]
    page = (tmp_path / "out" / "plan.html").read_text(encoding="utf-8")
    assert "What these set-ups do for the part" in page
    assert any("the set-ups of this plan" in text for text in written.summary.remarks)
    job.write_text(text.replace("y = [0, 1200]", "y = [0, 1100]"), encoding="utf-8")
    with pytest.raises(CmmUqError, match="on another machine than the plan's"):
        write_plan(tmp_path / PLAN, tmp_path / "other", power=False, for_part=of)
    assert not (tmp_path / "other").exists()


def test_widths_of_zones_are_not_foretold(found: PartMeasurement) -> None:
    zone = replace(found.plan.characteristics[0], what="roundness", lower=None, upper=0.01)
    plan = replace(found.plan, characteristics=(zone, *found.plan.characteristics[1:]))
    assert foretold(plan).tolist() == [False, True, True, True]
