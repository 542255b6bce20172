"""Every calibrated length has the uncertainty that its certificate states: by a formula, a number, a column, a covariance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import GaugeBlocks, StepGauge
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects as effects_of
from cmm_uq.maths.inference.posterior import Doubt, gain

FACES = np.array([0.0, 20.0, 120.0, 420.0, 720.0, 1020.0])


def line(faces: Floats, **columns: Floats) -> Points:
    xyz = np.column_stack([faces, np.zeros((len(faces), 2))])
    one = np.ones(len(faces), dtype=np.int64)
    return Points(xyz, one, np.arange(1, len(faces) + 1), one, Machine(), {"reference_mm": faces, **columns})


def facts(kind: str = "step_gauge", **stated: Any) -> ReferencedFacts:
    found = artefact_facts(kind=kind, **stated)
    assert isinstance(found, ReferencedFacts)
    return found


def u_um(artefact: StepGauge | Plate) -> Floats:
    found = artefact.indications()
    assert found is not None
    return 1e3 * found.u


@pytest.mark.parametrize("text", ["0.2 + 0.5·L/1000", "0,2 µm + 0,5·10⁻⁶·L"])
def test_a_20_mm_length_of_a_1020_mm_gauge_has_the_u_of_its_certificate(text: str) -> None:
    """U = 0.2 + 0.5 · 0.02 = 0.21 µm, and not the 0.7·20/1020 = 0.014 of the longest in proportion; 0.71 at 1020 mm."""
    gauge = StepGauge(facts(U_um=text, k=2.0), line(FACES))
    assert 2 * u_um(gauge) == pytest.approx(0.2 + 0.5 * FACES[1:] / 1000, rel=1e-12)
    assert 2e3 * gauge.sizes[0].sd == pytest.approx(0.71, rel=1e-12)


def test_a_number_holds_for_every_length() -> None:
    assert u_um(StepGauge(facts(u_um=0.35), line(FACES))) == pytest.approx(np.full(5, 0.35), rel=1e-12)


def test_a_length_that_does_not_begin_at_the_first_face_has_u_of_its_own_length() -> None:
    """From 120 to 420 mm: 300 mm, U = 0.2 + 0.15."""
    gauge = StepGauge(facts(U_um="0.2 + 0.5·L/1000", k=2.0), line(FACES).select(np.isin(np.arange(6), (2, 3))))
    assert 2 * u_um(gauge) == pytest.approx([0.35], rel=1e-12)


def test_a_column_gives_every_length_its_own_and_the_first_face_none() -> None:
    """Distances count from the first face: what a certificate prints beside its 0 mm is in all the others."""
    own = np.array([0.1, 0.11, 0.4, 0.2, 0.3, 0.36])
    assert u_um(StepGauge(facts(), line(FACES, reference_u_um=own))) == pytest.approx(own[1:], rel=1e-12)


def test_a_column_beside_a_number_holds_where_it_is_larger() -> None:
    own = np.array([0.0, 0.1, 0.1, 0.2, 0.3, 0.36])
    found = u_um(StepGauge(facts(u_um=0.25), line(FACES, reference_u_um=own)))
    assert found == pytest.approx([0.25, 0.25, 0.25, 0.3, 0.36], rel=1e-12)


def test_two_faces_with_a_column_alone_are_independent() -> None:
    own = np.array([0.0, 0.1, 0.3, 0.4, 0.3, 0.36])
    points = line(FACES, reference_u_um=own).select(np.arange(6) >= 2)
    assert u_um(StepGauge(facts(), points)) == pytest.approx(np.hypot(0.3, own[3:]), rel=1e-12)


def test_with_a_covariance_every_length_is_gum_propagation_of_the_difference() -> None:
    """Dense: u² = cᵀ V c with c of −1 and +1."""
    root = np.random.default_rng(5).normal(0, 0.2, (6, 9))
    covariance = root @ root.T
    gauge = StepGauge(facts().with_covariances((1, 2, 3, 4, 5, 6), (covariance,)), line(FACES))
    for i, u in enumerate(u_um(gauge), start=1):
        c = np.zeros(6)
        c[0], c[i] = -1, 1
        assert u == pytest.approx(np.sqrt(c @ covariance @ c), rel=1e-12)


def test_every_block_has_its_own() -> None:
    """Three blocks in one recording, each with a row of its own."""
    lengths, own = np.array([20.0, 100.0, 400.0]), np.array([0.05, 0.2, 0.12])
    ends = np.column_stack([np.zeros(3), lengths]).ravel()
    xyz = np.column_stack([ends, np.repeat([0.0, 50.0, 100.0], 2), np.zeros(6)])
    number = np.repeat([1, 2, 3], 2)
    points = Points(xyz, number, np.tile([1, 2], 3), np.ones(6, dtype=np.int64), Machine(),
                    {"reference_mm": ends, "reference_u_um": np.column_stack([np.zeros(3), own]).ravel()})  # fmt: skip
    assert u_um(GaugeBlocks(facts("gauge_blocks"), points)) == pytest.approx(own, rel=1e-12)


def plate_of(**columns: Floats) -> Points:
    x, y = (axis.ravel() for axis in np.meshgrid([0.0, 100.0, 300.0], [0.0, 200.0]))
    xyz, one = np.column_stack([x, y, 0 * x]), np.ones(6, dtype=np.int64)
    reference = {f"reference_{axis}_mm": xyz[:, i] for i, axis in enumerate("xyz")}
    return Points(xyz, one, np.arange(1, 7), one, Machine(), {**reference, **columns})


def test_distances_of_balls_are_propagated_along_their_direction() -> None:
    """Dense by finite differences of every distance: 18 coordinates, each with its own u."""
    random = np.random.default_rng(3)
    own = {f"reference_u_{axis}_um": random.uniform(0.1, 0.5, 6) for axis in "xyz"}
    points = plate_of(**own)
    u = np.column_stack(list(own.values())).ravel()
    pairs = np.array(np.triu_indices(6, 1))

    def distances(places: Floats) -> Floats:
        xyz = places.reshape(6, 3)
        return np.asarray(np.linalg.norm(xyz[pairs[1]] - xyz[pairs[0]], axis=1))

    step, at = 1e-4, points.xyz.ravel()
    jacobian = np.column_stack([(distances(at + step * e) - distances(at - step * e)) / (2 * step) for e in np.eye(18)])
    expected = np.sqrt(np.diag(jacobian @ np.diag(u**2) @ jacobian.T))
    assert u_um(Plate(facts("plate"), points)) == pytest.approx(expected, rel=1e-8)
    same = u_um(Plate(facts("plate"), plate_of(reference_u_um=np.full(6, 0.3))))
    assert same == pytest.approx(np.full(15, 0.3 * np.sqrt(2)), rel=1e-12)


@given(st.floats(0.05, 2), st.floats(0, 3), st.floats(1.01, 3))
def test_a_less_certain_certificate_never_makes_a_length_more_certain(a: float, b: float, more: float) -> None:
    for form in ("{a} + {b}·L/1000", "Q[{a}; {b}·L/1000]"):
        text, larger = (
            form.format(a=f"{x:.6f}", b=f"{y:.6f}") for x, y in ((a, b + 0.01), (a * more, (b + 0.01) * more))
        )
        less, greater = (u_um(StepGauge(facts(U_um=one, k=2.0), line(FACES))) for one in (text, larger))
        assert np.all(greater > less)


@pytest.mark.parametrize("kind", ["ballbar", "sphere"])
def test_one_length_has_the_u_of_the_formula_at_it(kind: str) -> None:
    found = artefact_facts(kind=kind, length_mm=25.0 if kind == "sphere" else 400.0, U_um="0.2 + 0.5·L/1000", k=2.0)
    assert float(found.u_of(found.length_mm or 0.0)) == pytest.approx(0.10625 if kind == "sphere" else 0.2, rel=1e-12)
    assert (found.U_um, found.k) != (None, None)


def test_with_few_degrees_of_freedom_u_is_that_of_the_normal_distribution_with_the_same_interval() -> None:
    """U = t·u with Student's t for 95 % and 10, 2.228 (JCGM 100:2008, table G.2: 2.23); 1.960 of a normal one."""
    assert facts(U_um=0.4, degrees_of_freedom=10.0).u_of(100.0) == pytest.approx(0.4 / 1.960, rel=1e-4)
    assert facts(U_um=0.4, k=2.0, degrees_of_freedom=10.0).u_of(100.0) == pytest.approx(0.2 * 2.228 / 1.960, rel=1e-4)


@pytest.mark.parametrize(
    "stated",
    [{"U_um": 0.4}, {"U_um": 0.4, "u_um": 0.2, "k": 2.0}, {"U_um": "0.2 + 0.5·L", "k": 2.0}, {"U_um": 0.4, "k": 0.5},
     {"u_um": "0.2 + 0.5·L"}, {"u_um": -0.1}],
)  # fmt: skip
def test_half_a_statement_is_refused(stated: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"U_um|in which unit|greater than"):
        facts(**stated)


def several(artefact: StepGauge | Plate, effects: list[str]) -> tuple[Floats, Floats, Floats]:
    """Of every estimate: its variance, that of dense propagation of one common error, of errors of each place.

    The estimator is written down here by numpy: least squares with an observation of the certified size, and dummy columns for
    what each set-up is free in.
    """
    sigma = 1e-3
    model = RecordingModel(artefact, effects_of(effects), sigma)
    linear, size = model.estimate().linear, artefact.sizes[0]
    free = linear.freedoms.dense()
    rows = np.hstack([linear.design, free])
    priors = [(i, u.prior_sd) for i, u in enumerate(linear.unknowns) if np.isfinite(u.prior_sd)]
    known = np.array([np.eye(rows.shape[1])[i] * sigma / sd for i, sd in priors])
    inverse = np.linalg.pinv(np.vstack([rows, known]), rcond=1e-12)
    G = inverse[: linear.design.shape[1], : len(rows)]
    base = sigma**2 * np.diag(np.linalg.pinv(rows.T @ rows + known.T @ known, rcond=1e-14))[: len(G)]
    cause = artefact.calibration()
    assert cause is not None
    doubt = Doubt.of([cause], gain(linear, sigma))
    found = base + np.array([doubt.variance(np.eye(len(G))[i]) for i in range(len(G))])
    h = artefact.size_change()[:, 0] * size.sd
    own = np.zeros_like(base) if cause.apart is None else np.sum((G @ cause.apart.dense()) ** 2, axis=1)
    return found, base, base - (G @ h) ** 2 + own


def lines_along(directions: list[list[float]]) -> Points:
    faces = np.array([0.0, 30.0, 100.0, 200.0, 300.0, 400.0])
    xyz = [np.outer(faces, np.array(d) / np.linalg.norm(d)) + 10.0 * i for i, d in enumerate(directions)]
    count = len(directions)
    number = np.repeat(np.arange(1, count + 1), 6)
    return Points(np.vstack(xyz), number, np.tile(np.arange(1, 7), count), np.ones(6 * count, dtype=np.int64), Machine(),
                  {"reference_mm": np.tile(faces, count)})  # fmt: skip


SIX_LINES = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [1.0, 1.0, 0], [1.0, -1.0, 0], [0, 1.0, 1.0]]


@pytest.mark.parametrize("stated", [{"U_um": "0.2 + 0.5·L/1000", "k": 2.0}, {"u_um": 0.5}, {"u_um": "Q[0.3; L/1000]"}])
@pytest.mark.parametrize("effects", [["scale_x", "scale_y", "scale_z"], ["scale_x", "squareness_xy", "squareness_yz"]])
def test_of_every_estimate_the_larger_of_common_and_independent_errors_stands(
    stated: dict[str, Any], effects: list[str]
) -> None:
    gauge = StepGauge(facts(**stated), lines_along(SIX_LINES))
    found, common, independent = several(gauge, effects)
    chosen = slice(0, len(effects))
    assert found[chosen] == pytest.approx(np.maximum(common, independent)[chosen], rel=1e-4)


def test_the_scale_of_one_line_has_the_slope_of_u_of_its_faces() -> None:
    """By hand: slope of errors e_i = u(L_i) over L_i by least squares, all together and each by itself, in ppm."""
    gauge = StepGauge(facts(U_um="0.2 + 0.5·L/1000", k=2.0), lines_along([[1.0, 0, 0]]))
    L = gauge.reference - gauge.reference.mean()
    weights = L / (L @ L)
    u = np.where(gauge.reference > 0, 0.1 + 0.25 * gauge.reference / 1000, 0.0)
    together, each = abs(weights @ u) * 1e3, float(np.sqrt(weights**2 @ u**2)) * 1e3
    found, _, _ = several(gauge, ["scale_x"])
    noise = 1e3 * 1.0 / np.sqrt(L @ L)
    assert np.sqrt(found[0]) == pytest.approx(np.hypot(max(together, each), noise), rel=1e-3)


def test_with_a_covariance_every_estimate_is_dense_gum_propagation() -> None:
    """G V Gᵀ with V of the six faces, each met in every line; noise beside it."""
    root = np.random.default_rng(8).normal(0, 0.2, (6, 9))
    covariance = root @ root.T
    gauge = StepGauge(facts().with_covariances((1, 2, 3, 4, 5, 6), (covariance,)), lines_along(SIX_LINES))
    sigma, effects = 1e-3, ["scale_x", "scale_y", "scale_z", "squareness_xy"]
    model = RecordingModel(gauge, effects_of(effects), sigma)
    linear = model.estimate().linear
    known = np.zeros((1, linear.design.shape[1] + 6))
    known[0, len(effects)] = sigma / gauge.sizes[0].sd
    rows = np.hstack([linear.design, linear.freedoms.dense()])
    priors = [[*(np.eye(4)[i] * sigma / linear.unknowns[i].prior_sd), *np.zeros(7)] for i in range(4)]
    G = np.linalg.pinv(np.vstack([rows, known, priors]), rcond=1e-12)[:4, : len(rows)]
    met = np.tile(np.eye(6), (6, 1)) * 1e-3
    cause = gauge.calibration()
    assert cause is not None
    h = gauge.size_change()[:, 0] * gauge.sizes[0].sd
    doubt = Doubt.of([cause], gain(linear, sigma))
    for i in range(4):
        dense = G[i] @ met @ covariance @ met.T @ G[i]
        assert (G[i] @ h) ** 2 + doubt.variance(np.eye(5)[i]) == pytest.approx(dense, rel=1e-3)


def test_balls_of_a_plate_err_together_or_each_by_itself() -> None:
    own = {f"reference_u_{axis}_um": np.array([0.1, 0.3, 0.2, 0.4, 0.1, 0.2]) for axis in "xyz"}
    effects = ["scale_x", "scale_y", "squareness_xy"]
    found, common, independent = several(Plate(facts("plate"), plate_of(**own)), effects)
    assert found[:3] == pytest.approx(np.maximum(common, independent)[:3], rel=1e-4)
    assert np.all(independent[:3] > 0)
