"""Corrections whose outcome is known: a squareness put into exact bars and lines, and taken away again."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.accuracy import Consequences, consequences
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.noise import Sizes
from tests.analysis.conformity.recorded import STATED, bars, gauge
from tests.recordings import bar_facts

SCALES = ("scale_x", "scale_y", "scale_z")


def told(
    *asserted: str, size: float = 150.0, wishes: tuple[ConformityFacts, ...] = (), lines: bool = False
) -> Consequences | None:
    """Twenty bars, or seven lines, with a squareness; the model is known, and 1 µm of noise is said to be in each reading."""
    ideal = gauge() if lines else with_bars()
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000") if lines else bar_facts(300.0, 0.01)
    kind = StepGauge if lines else Ballbar
    acting = RecordingModel(ideal, effects(("squareness_xy",)))
    nominal = np.array([size.nominal for size in ideal.sizes])
    xyz = acting.simulate(np.array([size]), nominal, Noise(1e-9), np.random.default_rng(0))
    after = RecordingModel(kind(facts, ideal.points.at(xyz)), effects((*SCALES, "squareness_xy")), 1e-3)
    estimate = after.estimate().least_squares
    draws = np.tile(estimate.value, (1000, 1))
    reading, nothing = np.full((1000, 3), 1e-3), np.zeros(1000)
    sizes = Sizes(reading, nothing, nothing, nothing, nothing)
    diagnosis: Any = SimpleNamespace(
        effects=[SimpleNamespace(effect=name) for name in asserted], after=after,
        posterior=SimpleNamespace(draws=draws, sizes=sizes),
    )  # fmt: skip
    described = kind_named(after.artefact.kind)
    assert described is not None
    job: Any = SimpleNamespace(facts=SimpleNamespace(conformity=wishes), circumstances=STATED)
    return consequences(job, diagnosis, partial(kind, facts), described.tested, 0)


def with_bars() -> Ballbar:
    return Ballbar(bar_facts(300.0, 0.01), bars(lengths=[300.0] * 20).points)


def test_a_recording_without_its_squareness_has_bars_of_one_length_and_the_scatter_of_the_noise() -> None:
    """Two ends of 1 µm: 1.41 µm for a length, over √20 for the mean. The range of lengths that differ by far is one of two of
    them, 2 µm; that of twenty equal ones scatters by d3 = 0.7287 of 1.41 µm (ISO 7870-2).
    """
    found = told("squareness_xy")
    assert found is not None
    for name, (_, after) in found.figures.items():
        mean = name == "mean_length_mm"
        assert after.value == pytest.approx(300.0 if mean else 0.0, abs=1e-4 if mean else 0.05), name
    (before, after) = found.figures["mean_length_mm"]
    assert before.u == pytest.approx(after.u, rel=0.02)
    assert after.u == pytest.approx(1e-3 * np.sqrt(2 / 20), rel=0.02)
    (before, after) = found.figures["b89_range_um"]
    assert before.u == pytest.approx(2.0, rel=0.03)
    assert after.u == pytest.approx(0.7287 * np.sqrt(2), rel=0.03)


def test_statements_are_made_before_and_after_and_name_their_place_in_the_job() -> None:
    wishes = tuple(ConformityFacts(standard="ASME B89.4.1-1997", limit_um=limit) for limit in (60.0, 1e4))
    found = told("squareness_xy", wishes=wishes)
    assert found is not None
    assert [(before.outcome, after.outcome) for before, after in found.statements] == [
        ("fail", "pass"),
        ("pass", "pass"),
    ]
    assert [before.limit_um for before, _ in found.statements] == [60.0, 1e4]


def test_lines_have_no_figures_and_their_statements_are_corrected_too() -> None:
    wish = ConformityFacts(standard="ISO 10360-2:2009", limit_um=20.0)
    found = told("squareness_xy", wishes=(wish,), lines=True)
    assert found is not None
    assert found.figures == {}
    ((before, after),) = found.statements
    assert (before.outcome, after.outcome) == ("fail", "pass")
    assert before.value_um > 20.0 > after.value_um
    assert told("squareness_xy", lines=True) is None


def test_without_an_effect_there_is_nothing_to_correct() -> None:
    assert told(wishes=(ConformityFacts(standard="ASME B89.4.1-1997", limit_um=60.0),)) is None


def test_of_two_effects_that_were_fitted_only_the_one_found_is_corrected() -> None:
    """The squareness stays where a scale alone is asserted."""
    found = told("scale_x")
    assert found is not None
    before, after = found.figures["b89_range_um"]
    assert after.value == pytest.approx(before.value, rel=0.01)


def test_a_statement_that_cannot_be_made_is_named_by_its_place_in_the_job() -> None:
    wishes = (
        ConformityFacts(standard="ASME B89.4.1-1997", limit_um=60.0),
        ConformityFacts(standard="ISO 10360-5:2010", limit_um=60.0),
    )
    with pytest.raises(CmmUqError, match=r"\[\[conformity\]\] 2 standard"):
        told("squareness_xy", wishes=wishes)
