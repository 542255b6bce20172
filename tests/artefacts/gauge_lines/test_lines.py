"""What each line of a step gauge tells by itself."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.gauge_lines_page import lines_of, periodic_part
from tests.artefacts.constructions import indicated, step_gauge

GAUGE = artefact_facts(kind="step_gauge")


def test_a_periodic_error_is_found_with_its_period_and_amplitude() -> None:
    """2 µm with a period of 70 mm on faces every 20 mm, beside a slope and scatter of 0.3 µm."""
    x = np.arange(0.0, 821.0, 20.0)
    wave = 2e-3 * np.sin(2 * np.pi * x / 70 + 1) + 5e-6 * x + 3e-4 * np.random.default_rng(2).standard_normal(len(x))
    found = periodic_part(x, wave)
    assert found is not None
    assert found.period == pytest.approx(70, rel=0.02)
    assert found.amplitude == pytest.approx(2e-3, rel=0.15)
    assert found.p_value < 1e-6


def test_scatter_alone_is_called_periodic_as_rarely_as_stated() -> None:
    """1000 lines of pure scatter: one in a hundred is called periodic; 23 or more would be, with probability 0.02 %."""
    random, x = np.random.default_rng(11), np.arange(0.0, 421.0, 20.0)
    assert sum(periodic_part(x, random.standard_normal(len(x))) is not None for _ in range(1000)) < 23


def test_few_faces_and_perfect_lines_have_no_period() -> None:
    x = np.arange(0.0, 421.0, 20.0)
    assert periodic_part(x[:7], np.sin(x[:7])) is None
    assert periodic_part(x, np.zeros(len(x))) is None


def test_each_line_has_slope_linearity_and_backlash() -> None:
    points = indicated(GAUGE, step_gauge(both_sides=True), ["scale_x", "hysteresis_y"], [100.0, 6.0])
    lines = {line.measurement: line for line in lines_of(StepGauge(GAUGE, points))}
    assert lines[1].scale_ppm == pytest.approx(-100, abs=0.02)
    assert lines[1].gap == pytest.approx(0.0, abs=1e-12)
    assert lines[2].scale_ppm == pytest.approx(0, abs=1e-6)
    assert lines[2].gap == pytest.approx(-6e-3)
    assert np.linalg.norm(lines[2].gap_weights) == pytest.approx(np.sqrt(2 / 22))
    assert lines[1].linearity < 1e-9
    assert (lines[4].length, lines[4].faces) == (420.0, 22)
