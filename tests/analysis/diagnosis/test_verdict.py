"""The analysis of variance of residuals: that of SciPy where a set-up leaves a constant, by hand on the way there and back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.analysis.diagnosis.held_out import RepeatComparison, against_repeats
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.constructions import model, plate
from tests.recordings import TRAVEL

FACES = np.array([0.0, 60.0, 100.0, 180.0, 220.0, 280.0, 360.0, 400.0, 460.0, 520.0])
OFF = np.random.default_rng(8).standard_normal(len(FACES))


def line(readings: Floats, *, back: bool = False, named: tuple[str, ...] = ()) -> RecordingModel:
    """One line of a gauge along X, from errors of its faces (n, faces), mm; every other one may be on the way back."""
    rows = []
    for repeat, errors in enumerate(readings):
        sense = -1 if back and repeat % 2 else 1
        for i, (face, error) in enumerate(zip(FACES, errors, strict=True), 1):
            number = (i + len(FACES) * repeat, 1) if back else (i, repeat + 1)
            rows.append((150.0 + face + error, *number, face, sense))
    x, point, repeated, reference, sense = np.array(rows).T
    xyz = np.column_stack([x, np.full(len(x), 200.0), np.full(len(x), -200.0)])
    columns = {"reference_mm": reference, "approach_x": sense, "approach_y": 0 * sense, "approach_z": 0 * sense}
    ones = np.ones(len(x), dtype=np.int64)
    points = Points(xyz, ones, point.astype(np.int64), repeated.astype(np.int64), Machine("m", "XYZ", TRAVEL), columns)
    return RecordingModel(StepGauge(artefact_facts(kind="step_gauge", length_mm=520.0), points), effects(named))


def noise(count: int, seed: int) -> Floats:
    return 1e-3 * np.random.default_rng(seed).standard_normal((count, len(FACES)))


@pytest.mark.parametrize("size", [0.0, 1e-3, 6e-3])
def test_the_comparison_is_one_way_analysis_of_variance(size: float) -> None:
    """The line's offset is all that is fitted: what is left of the faces is that of their means (scipy.stats.f_oneway)."""
    errors = size * OFF + noise(5, 3)
    found = against_repeats(line(errors))
    assert found is not None
    expected = stats.f_oneway(*errors.T)
    assert found.p_value == pytest.approx(float(expected.pvalue), rel=1e-6)
    within = np.sqrt(np.mean(errors.var(axis=0, ddof=1)))
    assert found.repeatability_um == pytest.approx(1e3 * float(within), rel=1e-6)
    between = errors.mean(axis=0).var(ddof=1)
    assert found.shared_um == pytest.approx(1e3 * np.sqrt(max(between - within**2 / 5, 0.0)), rel=1e-6)


def there_and_back(errors: Floats) -> tuple[float, float]:
    """Repeatability, µm, and p, by hand: each way has a mean of its own, their differences scatter by √2 of a reading."""
    apart = errors[0] - errors[1]
    one = apart.var(ddof=1) / 2
    middle = errors.mean(axis=0)
    faces = len(FACES)
    # what the two ways differ by on the whole is left between the faces, where it has a degree of freedom of its own
    between = 2 * np.sum((middle - middle.mean()) ** 2) + 0.5 * faces * apart.mean() ** 2
    return 1e3 * float(np.sqrt(one)), float(stats.f.sf(between / faces / one, faces, faces - 1))


@pytest.mark.parametrize("size", [0.0, 5e-3])
def test_a_place_that_is_read_on_the_way_back_repeats_it(size: float) -> None:
    errors = size * OFF + noise(2, 5)
    found = against_repeats(line(errors, back=True))
    assert found is not None
    own, p_value = there_and_back(errors)
    assert found.repeatability_um == pytest.approx(own, rel=1e-6)
    assert found.p_value == pytest.approx(p_value, rel=1e-6)


def test_play_is_no_scatter_of_what_is_read_there_and_back() -> None:
    errors = noise(2, 6)
    plain, played = (
        against_repeats(line(errors, back=True)),
        against_repeats(line(errors + np.array([[0.02], [-0.02]]), back=True)),
    )
    assert plain is not None
    assert played is not None
    assert played.repeatability_um == pytest.approx(plain.repeatability_um, rel=1e-9)


def test_without_repeats_there_is_nothing_to_compare() -> None:
    assert against_repeats(line(noise(1, 7))) is None


def test_coordinates_of_one_point_are_no_repeats_of_each_other() -> None:
    """A plate that is read once: X, Y and Z of a hole are at one place, and are three quantities."""
    points = plate()
    read = points.at(points.xyz + 1e-3 * np.random.default_rng(4).standard_normal(points.xyz.shape))
    assert against_repeats(model(artefact_facts(kind="plate"), read, ())) is None


def test_rows_in_another_order_change_nothing() -> None:
    plain_order = line(3e-3 * OFF + noise(2, 9), back=True)
    points = plain_order.artefact.points
    order = np.random.default_rng(1).permutation(len(points))
    columns = {name: values[order] for name, values in points.columns.items()}
    of_rows = (values[order] for values in (points.xyz, points.measurement, points.point, points.repeat))
    mixed = Points(*of_rows, points.machine, columns)
    other = RecordingModel(StepGauge(artefact_facts(kind="step_gauge", length_mm=520.0), mixed), ())
    plain, found = against_repeats(plain_order), against_repeats(other)
    assert plain is not None
    assert found is not None
    assert found.p_value == pytest.approx(plain.p_value, rel=1e-9)


def test_a_pattern_read_there_and_back_in_one_set_up_is_never_consistent() -> None:
    patterned = line(4e-3 * OFF + noise(2, 11), back=True, named=("scale_x",))
    found = diagnose(patterned, stated_um=None, alpha=0.01, seed=1)
    assert isinstance(found.repeats, RepeatComparison)
    assert found.repeats.p_value < 0.01
    assert found.verdict not in ("consistent", "explained")
