"""The cases of the second study: independent of the package, and yet of the same equations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.concealed.physics import UNIT, kind_of
from benchmarks.second import noises
from benchmarks.second.artefacts import LENGTH, Placed, real_bars
from benchmarks.second.cases import DESIGNS, KINDS, NOTHING, Case, Seen, baseline, case, job, seal, visible
from benchmarks.second.maps import JUMPS, SQUARENESS, concealed, error, without_expansion
from benchmarks.second.twins import fields
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import CATALOGUE
from cmm_uq.machine.physics.error_map import read_error_map
from cmm_uq.machine.physics.kinematics import first_order
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from tests.conftest import ROOT
from tests.imports import packages_reached


def test_no_code_of_the_package_makes_a_case_or_searches_it() -> None:
    modules = (f"benchmarks.second.{name}" for name in ("cases", "faults", "judging", "maps", "oracle"))
    assert not {"cmm_uq", "pandas"} & packages_reached(*modules)


def on_the_artefact(columns: np.ndarray, placed: Placed) -> np.ndarray:
    """Observations (m, r) as the package has them: those of a plate along its own axes."""
    if placed.kind != "plate":
        return columns
    return np.einsum("nij,njr->nir", placed.axes, columns.reshape(-1, 3, columns.shape[1])).reshape(columns.shape)


def outside(some: np.ndarray, of: np.ndarray, placed: Placed) -> float:
    """What columns leave of others, over the largest of these, the placing taken out of both."""
    free = np.linalg.qr(on_the_artefact(placed.free, placed))[0] if placed.free.size else np.zeros((len(some), 0))
    some, of = (columns - free @ (free.T @ columns) for columns in (some, of))
    basis, s, _ = np.linalg.svd(of / max(float(np.abs(of).max()), 1e-300), full_matrices=False)
    basis = basis[:, s > 1e-9 * s.max(initial=0.0)]
    size = float(np.abs(some).max())
    return float(np.abs(some - basis @ (basis.T @ some)).max() / size) if size > 1e-12 else 0.0


def as_read(placed: Placed, folder: Path) -> RecordingModel:
    """The package's model of an artefact that is where it should be, nothing taken off for being a copy."""
    white = noises.Noise("white", 1e-3)
    one = Case("exact", placed, white, (), placed.size is not None, None, placed.recorded, placed.true,
               np.zeros(len(placed.D)), {}, None, np.arange(len(placed.true)))  # fmt: skip
    job(one, folder, one.order, decimals=12)
    model, _ = recorded_model(read_job(folder))
    return replace(model, used=np.ones(len(model.used), dtype=bool))


@pytest.mark.parametrize("what", ["ballbar", "step gauge", "equal steps", "plate", "sphere", "real bars"])
def test_every_effect_of_the_catalogue_moves_observations_as_in_the_package(what: str, tmp_path: Path) -> None:
    """To 10⁻⁹ of its size, up to what the placing takes; a plate's observations are turned, so their products are compared."""
    placed = DESIGNS[what](np.random.default_rng(5))
    model = as_read(placed, tmp_path / "exact")
    values = model.estimate().about
    context = placed.recorded | placed.extra | {"period": 83.0}
    theirs, ours = [], []
    for name, acts in visible(placed).items():
        shape = (83.0,) if kind_of(name) == "periodic_scale" else ()
        theirs.append(model.seen(model.columns(CATALOGUE[name], shape, values), values) * UNIT.get(kind_of(name), 1.0))
        phases = (0.0, np.pi / 2)[: theirs[-1].shape[1]]
        ours.append(np.stack([-placed.D @ acts(placed.true, context | {"phase": p}).ravel() for p in phases], axis=1))
    A, B = np.hstack(theirs), np.hstack(ours)
    size = np.where(np.any(B, axis=0), np.abs(B).max(axis=0), 1.0)
    if what == "plate":
        here, there = ((C / size).reshape(-1, 3, len(size)) for C in (B, A))
        np.testing.assert_allclose(there.swapaxes(1, 2) @ there, here.swapaxes(1, 2) @ here, atol=2e-9)
        return
    left = (A - B) / size
    free = placed.free @ np.linalg.lstsq(placed.free, left, rcond=None)[0] if placed.free.size else 0.0
    assert np.abs(left - free).max() < 1e-9


@pytest.mark.parametrize("what", ["ballbar", "step gauge", "plate", "plate, two ways", "plate, one way", "sphere"])
def test_every_fault_of_an_artefact_moves_observations_as_in_the_package(what: str, tmp_path: Path) -> None:
    """Each spans the same to 10⁻⁷, up to what the placing takes; of a pattern the package leaves out a scale of all."""
    placed = DESIGNS[what](np.random.default_rng(5))
    model = as_read(placed, tmp_path / "exact")
    values = model.estimate().about
    faults = {fault.name: fault for fault in model.artefact.own_faults()}
    ours = fields(placed)
    assert set(ours) - {"artefact_pattern"} <= set(faults) | {"artefact_lobing", "artefact_form"}
    for name in set(ours) & set(faults):
        theirs = model.seen(model.columns(faults[name], (), values), values)
        moved = np.stack([placed.D @ ours[name][:, :, i].ravel() for i in range(ours[name].shape[2])], axis=1)
        own = on_the_artefact(moved, placed)
        assert outside(theirs, own, placed) < 1e-7, name
        if name != "artefact_pattern":
            assert outside(own, theirs, placed) < 1e-7, name


@pytest.mark.parametrize("number", [0, 1, 2])
def test_errors_of_a_plate_that_are_the_same_leave_nothing_of_one_another_and_all_of_the_others(number: int) -> None:
    """By rank: as many different deformations as there are classes, and each class is one; a sheared plate is a turned one."""
    made = case(20261126, "artefact, geometry", (4, 13, 22)[number])
    white = np.eye(len(made.placed.D))
    B = baseline(Seen(made.placed, made.named, made.certified, white, made.context, made.noise.sigma))
    U, s, _ = np.linalg.svd(
        B / np.where(np.linalg.norm(B, axis=0) > 0, np.linalg.norm(B, axis=0), 1.0), full_matrices=False
    )
    rest = U[:, s > 1e-10 * s[0]]

    def column(name: str) -> np.ndarray:
        seen = made.placed.D @ fields(made.placed)[name][:, :, 0].ravel()
        return np.asarray(seen - rest @ (rest.T @ seen))

    classes = made.truth["same"]
    assert any({"artefact_squareness_xy", "artefact_rotation_y_y"} <= set(each) for each in classes)
    for each in classes:
        columns = np.column_stack([column(name) / np.linalg.norm(column(name)) for name in each])
        assert np.linalg.matrix_rank(columns, tol=1e-6) == 1
    several = np.column_stack([column(each[0]) / np.linalg.norm(column(each[0])) for each in classes])
    assert np.linalg.matrix_rank(several, tol=1e-3) == len(classes) > 1
    assert set(made.truth["is"]) in [set(each) for each in classes]


def test_a_case_is_the_same_whenever_it_is_made_and_its_seal_with_it() -> None:
    first, again, other = case(3, "two", 1), case(3, "two", 1), case(4, "two", 1)
    np.testing.assert_array_equal(first.shown, again.shown)
    assert seal([first.truth]) == seal([again.truth]) != seal([other.truth])


@pytest.mark.long(but="ballbar")
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "maps"])
def test_every_kind_can_be_hidden_in_every_artefact_that_it_is_dealt_to(kind: str) -> None:
    for number in range(5):
        made = case(11, kind, number)
        hides = bool(made.truth["hidden"]) or "fault" in made.truth
        assert hides == (kind not in NOTHING)
        assert np.isfinite(made.y).all()


@pytest.mark.parametrize("kind", [kind for kind in noises.KINDS if kind not in ("real", "display", "tails")])
def test_noise_has_the_covariance_that_is_told_of_it(kind: str) -> None:
    """Its squares over that covariance, in 400 draws of 80 coordinates, are the unit matrix to five standard errors."""
    random = np.random.default_rng(2)
    placed = DESIGNS["ballbar"](random)
    noise = noises.drawn(random, kind, placed)
    covariance = noises.of_observations(noises.of_coordinates(noise, placed), placed)
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    draws = np.column_stack([placed.D @ noises.readings(random, noise, placed).ravel() for _ in range(400)])
    products = (white @ draws) @ (white @ draws).T / 400
    assert np.abs(products - np.eye(len(products))).max() < 5 * np.sqrt(2 / 400)


def test_half_of_what_has_heavy_tails_lies_within_the_quartiles_of_students_t() -> None:
    """Three degrees of freedom: 0.7649 of the scale (table), which is the standard deviation over √3. 24 000 coordinates."""
    random = np.random.default_rng(2)
    placed = DESIGNS["ballbar"](random)
    noise = noises.Noise("tails", 1e-3, dof=3.0)
    inside = [np.abs(noises.readings(random, noise, placed)) < 0.7649 * 1e-3 / np.sqrt(3) for _ in range(100)]
    assert np.mean(inside) == pytest.approx(0.5, abs=5 * 0.5 / np.sqrt(24_000))


def test_the_real_bars_keep_their_residuals_and_nothing_that_six_factors_explain() -> None:
    """The source's residuals are 11 µm once six factors are taken off; each recording deals them anew."""
    bars = [real_bars(np.random.default_rng(seed)) for seed in range(8)]
    spread = {round(1e3 * float(np.sqrt(np.mean(each.residuals**2))), 2) for each in bars}
    assert len(spread) == 2
    assert all(10 < each < 12 for each in spread)
    assert len({tuple(each.residuals) for each in bars}) == 8
    lengths = np.linalg.norm(bars[0].true[1::2] - bars[0].true[::2], axis=1)
    np.testing.assert_allclose(lengths, LENGTH, atol=1e-9)


def test_an_expansion_that_is_concealed_in_the_real_maps_is_the_slope_of_their_differences() -> None:
    """What was there is taken off to nothing, wherever a map starts and whatever jumps; three of four sets have one."""
    away = np.array([-5.0, 0.0, 5.0])
    for i, axis in enumerate("xyz"):
        place = without_expansion(20)[axis][:, 0]
        kept = ~np.isin(place, JUMPS.get(axis, ()))
        values = np.array([without_expansion(t)[axis][kept, 1 + i] for t in SQUARENESS])
        slopes = np.polyfit(place[kept], values.T, 1)[0]
        assert away @ slopes == pytest.approx(0.0, abs=1e-12)
    assert any(concealed(1, number, "m").truth["hidden"] for number in range(3))
    assert not concealed(1, 3, "m").truth["hidden"]


def test_the_machine_of_the_real_maps_errs_as_the_package_has_it() -> None:
    """At 300 places, to 10⁻¹² mm: both interpolate linearly and put a rigid body together, to first order."""
    read = read_error_map(ROOT / "examples" / "iota-1102-maps" / "error_map_20C.csv").with_squareness_arcsec(
        -173, -19, 21
    )
    p = np.array([0.0, 0.0, -500.0]) + np.random.default_rng(0).random((300, 3)) * [900, 550, 500]
    found = ErrorMaps([read]).at(p)
    np.testing.assert_allclose(error(p, 20), first_order(p, found.errors, found.squareness), atol=1e-12)
