"""A part against the certificate of the machine that it stands on: the same machine, or nothing is called conforming."""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import machine_stated
from cmm_uq.app.commands.certificates.further import GivenRecordings, given_recordings
from cmm_uq.app.commands.parts.part import PartOptions, evaluate_part
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.part.measurement import part_results
from cmm_uq.certificate.sections.agreement import against_certificate
from tests.artefacts.simulated import analysed, outcome
from tests.part_machines import THERE, by_results, plate_of

JOB = "step-gauge-simulated"


@cache
def machine() -> tuple[GivenRecordings, dict[str, Any]]:
    """The machine of a calibration as a part has it, and what its certificate says."""
    found = outcome(JOB)
    assert found.draws is not None
    results = json.loads(json.dumps(dict(found.results), default=str))
    job = analysed(JOB).job
    state = machine_stated(results, found.draws.flat(), job.points.machine, corrected=True)
    return given_recordings(state, job, (), (), None, 1), results


def against(results: Mapping[str, Any], **changed: Any) -> list[str]:
    found, _ = machine()
    assert found.drawn is not None
    return [str(text) for text in against_certificate(results, replace(found.drawn, **changed), found.causes)]


@pytest.mark.long
def test_a_part_has_the_machine_as_its_certificate_states_it() -> None:
    """Other draws of the same errors, given the same recording: factors over the set-ups and slopes of the lines agree, to a
    tenth of what would contradict them."""
    found, results = machine()
    assert found.drawn is not None
    assert against(results) == []
    for i, one in enumerate(analysed(JOB).model.unknowns[: len(found.drawn.which)]):
        if not (stated := results["regions"]["recorded"].get(one.key[0], {}).get(one.key[1])):
            continue
        draws = found.drawn.factors[:, i]
        assert abs(draws.mean() - stated["value"]) < 0.2 * stated["u"]
        assert draws.std() == pytest.approx(stated["u"], rel=0.25)


@pytest.mark.long
def test_a_factor_that_the_certificate_states_otherwise_is_told_with_both_figures() -> None:
    """u is 0.7 ppm on either side; of 16 figures differences up to 4.0·√2 of it are allowed."""
    _, results = machine()
    one = results["regions"]["recorded"]["scale_y"]["ppm"]
    for times, told in ((4.0, 0), (8.0, 1)):
        changed = deepcopy(results)
        changed["regions"]["recorded"]["scale_y"]["ppm"]["value"] = one["value"] + times * one["u"]
        assert len(texts := against(changed)) == told
    assert texts[0].startswith("By the machine's certificate Scale error of Y is ")
    # of a recording of which a part reckons with some observations only, the factors are others
    changed["regions"]["of"] += 1
    assert against(changed) == []


@pytest.mark.long
def test_errors_that_do_not_make_the_lines_that_were_read_are_told() -> None:
    """A scale of X 20 ppm larger than the recording has it: every line along X is another one."""
    found, results = machine()
    assert found.drawn is not None
    other = found.drawn.own + np.where(np.arange(len(found.drawn.which)) == 0, 20.0, 0.0)
    texts = against({"regions": {**results["regions"], "recorded": {}}}, own=other)
    assert len(texts) == 3
    assert all("the slope of the line of measurement" in text for text in texts)


NAMES = ["scale_x.ppm"]
LINES = {"disagree": [{"figure": "line 3"}, {"figure": "length 3"}, {"figure": "line 3"}]}


@pytest.mark.parametrize(
    ("regions", "told"),
    [
        ({}, ""),
        ({"disagree": [], "agreement": {"disagree": []}}, ""),
        ({"disagree": NAMES}, "scale_x.ppm."),
        ({"disagree": NAMES, "agreement": LINES}, "scale_x.ppm, line 3, length 3."),
    ],
)
def test_a_certificate_that_withdrew_figures_is_said_to_have(regions: dict[str, Any], told: str) -> None:
    texts = [str(text) for text in against_certificate({"regions": regions}, None)]
    assert [text.rpartition(": ")[2] for text in texts] == ([told] if told else [])


@pytest.mark.long
def test_nothing_conforms_by_a_machine_whose_certificate_contradicts_itself() -> None:
    """Values, u and what would be accepted stay; what would pass is undecided, and the reports says why."""
    files = by_results()
    name = next(name for name in files if name.endswith("results.json"))
    data = json.loads(files[name])
    data["regions"]["disagree"] = NAMES
    changed = {**files, name: as_json(data)}
    points = np.zeros((60, 3))
    kept, found = (evaluate_part(plate_of(one, points, **THERE), PartOptions(trials=2000)) for one in (files, changed))
    assert "pass" in kept.outcomes
    assert "pass" not in found.outcomes
    assert "undecided" in found.outcomes
    reason = "Nothing is called conforming, for statements of the machine contradict each other."
    assert (reason in map(str, kept.withheld), reason in map(str, found.withheld)) == (False, True)
    assert any(
        "it gives none that follow from a model of its errors: scale_x.ppm." in str(one) for one in found.warnings
    )
    np.testing.assert_array_equal(kept.simulated.u, found.simulated.u)
    assert len(part_results(found)["machine"]["against"]) == 1
    assert "against" not in part_results(kept)["machine"]
