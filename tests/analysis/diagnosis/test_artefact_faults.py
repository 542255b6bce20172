"""What turns with the artefact is the artefact's: exact constructions of plates whose holes, or whose machine, are wrong."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.recording.compared import against_earlier
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.constructions import MIDDLE, plate
from tests.recordings import suggested

DRILLED = artefact_facts(kind="plate", nominal=True)
IN_PLANE = ("scale_x", "scale_y", "squareness_xy")
AS_IT_LIES, TURNED = (0.0, 0.0, 0.0), (0.0, 0.0, 90.0)
SECOND = np.pi / 648000


def recorded(
    attitudes: Sequence[Sequence[float]], holes_um: Floats | None = None, yaw: float = 0.0, side: int = 3
) -> Points:
    """A plate of nine holes, twice in each attitude, 1 µm of noise: holes off their places, and a carriage X that yaws.

    The yaw, in ″/m, is written out: e_x = −y·ε, ε = yaw·x; readings count from zero, where X begins.
    """
    once = plate(attitudes, pitch=480.0 / side, side=side)
    true = once.xyz.copy()
    if holes_um is not None:
        for number, angles in enumerate(attitudes, 1):
            rows = once.measurement == number
            true[rows] += Rotation.from_euler("xyz", angles, degrees=True).apply(1e-3 * holes_um)
    error = np.zeros_like(true)
    error[:, 0] = -true[:, 1] * yaw * SECOND * true[:, 0] / 1000
    noise = np.random.default_rng(5).normal(0, 1e-3, (2, *true.shape))
    n = len(true)
    return Points(
        np.vstack([true - error, true - error]) + noise.reshape(-1, 3), np.tile(once.measurement, 2), np.tile(once.point, 2),
        np.repeat([1, 2], n), once.machine, {name: np.tile(v, 2) for name, v in once.columns.items()},
        np.arange(2, 2 * n + 2),
    )  # fmt: skip


def own_pattern(sd_um: float = 6.0, count: int = 9) -> Floats:
    """Holes off their places, (count, 3) µm."""
    return np.asarray(np.random.default_rng(11).normal(0, sd_um, (count, 3)))


def like_a_yaw(yaw: float) -> Floats:
    """Holes where a drilling machine puts them whose carriage X yaws, (9, 3) µm: what the first attitude above would show."""
    xyz = plate([AS_IT_LIES], pitch=160.0, side=3).xyz
    found = np.zeros_like(xyz)
    found[:, 0] = -1e3 * xyz[:, 1] * yaw * SECOND * xyz[:, 0] / 1000
    return found


def diagnosed(points: Points, named: Sequence[str] = IN_PLANE, facts: ArtefactFacts = DRILLED) -> Diagnosis:
    model = RecordingModel(artefact_of(facts, points), effects(named))
    return diagnose(model, stated_um=1.0, alpha=0.01, seed=0, observe=lambda some: artefact_of(facts, some))


@cache
def one_attitude() -> Diagnosis:
    return diagnosed(recorded([AS_IT_LIES], like_a_yaw(40.0)))


def deformation_rms(holes_um: Floats) -> float:
    """Of deviations less the shift, turn and scale that fit them best: a second way, by least squares on seven columns."""
    places = plate([AS_IT_LIES], pitch=160.0, side=3).xyz - MIDDLE
    turns = [np.cross(axis, places).ravel() for axis in np.eye(3)]
    shifts = [np.tile(axis, len(places)) for axis in np.eye(3)]
    A = np.column_stack([*turns, *shifts, places.ravel()])
    left = holes_um.ravel() - A @ np.linalg.lstsq(A, holes_um.ravel(), rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


@pytest.mark.long
def test_in_two_attitudes_a_pattern_of_holes_is_the_plates_own() -> None:
    found = diagnosed(recorded([AS_IT_LIES, TURNED], own_pattern()))
    assert [item.effect for item in found.effects] == ["artefact_pattern"]
    assert not found.indistinguishable
    rms = found.effects[0].parameters["rms_um"]
    assert abs(rms.value - deformation_rms(own_pattern())) < 4 * rms.u
    assert rms.u < 0.3
    assert found.improvement.elpd_gain > 5 * found.improvement.elpd_gain_se, "one set-up predicts the other"


@pytest.mark.long
def test_in_two_attitudes_a_machine_that_yaws_is_the_machine() -> None:
    found = diagnosed(recorded([AS_IT_LIES, TURNED], yaw=40.0))
    assert [item.effect for item in found.effects] == ["rotation_x_z"]
    assert not found.indistinguishable
    size = found.effects[0].parameters["arcsec_per_m"]
    assert abs(size.value - 40.0) < 4 * size.u


@pytest.mark.long
def test_in_two_attitudes_holes_drilled_by_a_machine_that_yaws_are_the_plates_own() -> None:
    found = diagnosed(recorded([AS_IT_LIES, TURNED], like_a_yaw(40.0)))
    assert [item.effect for item in found.effects] == ["artefact_rotation_x_z"]
    size = found.effects[0].parameters["arcsec_per_m"]
    assert abs(size.value - 40.0) < 4 * size.u


@pytest.mark.long
def test_in_two_attitudes_a_plate_out_of_square_is_neither_a_sagging_bar_nor_a_guideway_across_it() -> None:
    """Along its diagonal it is as a bar of another length; a straightness of Z is the same all over a level plate."""
    sheared = np.zeros((9, 3))
    sheared[:, 0] = -1e3 * 6.0 * SECOND * plate([AS_IT_LIES], pitch=160.0, side=3).xyz[:, 1]
    found = diagnosed(recorded([AS_IT_LIES, TURNED], sheared))
    assert [item.effect for item in found.effects][:1] == ["artefact_squareness_xy"]
    size = found.effects[0].parameters["angle_arcsec"]
    assert abs(size.value - 6.0) < 4 * size.u
    named = {name for group in found.indistinguishable for name in group}
    assert not named & {"artefact_sag", "straightness_z_x", "straightness_z_y"}
    assert "artefact_sag" not in {str(name) for name, _ in found.rivals}


@pytest.mark.long
def test_both_are_found_beside_each_other_with_their_sizes() -> None:
    found = diagnosed(recorded([AS_IT_LIES, TURNED], like_a_yaw(40.0), yaw=-25.0))
    sizes = {item.effect: item.parameters["arcsec_per_m"] for item in found.effects}
    assert set(sizes) == {"rotation_x_z", "artefact_rotation_x_z"}
    assert abs(sizes["rotation_x_z"].value + 25.0) < 4 * sizes["rotation_x_z"].u
    assert abs(sizes["artefact_rotation_x_z"].value - 40.0) < 4 * sizes["artefact_rotation_x_z"].u


@pytest.mark.long
def test_in_one_attitude_nothing_tells_the_plate_from_the_machine() -> None:
    (group,) = one_attitude().indistinguishable
    assert set(group[:2]) == {"rotation_x_z", "artefact_rotation_x_z"}
    (item,) = one_attitude().effects
    assert item.effect == "artefact_rotation_x_z", "of an uncalibrated plate its holes are the likelier cause"
    assert 0.5 < item.probability < 0.8, "twice as likely beforehand, and no better beside the recording"
    assert item.together > 0.98


@pytest.mark.long
def test_in_one_attitude_a_certificate_speaks_for_the_plate_as_far_as_its_uncertainty() -> None:
    """Nothing else tells the two apart: holes 5 µm off, by a certificate of 0.5 µm, may be the machine's or the plate's."""
    certified = artefact_facts(kind="plate", u_um=0.5)
    found = diagnosed(recorded([AS_IT_LIES], like_a_yaw(40.0)), facts=certified)
    (item,) = found.effects
    assert item.effect == "rotation_x_z"
    assert 0.85 < item.probability < 0.95, "ten to one beforehand"
    assert ("rotation_x_z", "artefact_rotation_x_z") in [group[:2] for group in found.indistinguishable]


def test_turning_the_plate_is_what_is_suggested() -> None:
    (suggestion, *_) = suggested(one_attitude(), DRILLED)
    assert set(suggestion.separates) == {"rotation_x_z", "artefact_rotation_x_z"}
    assert suggestion.odds >= 20


@pytest.mark.long
def test_in_one_attitude_a_pattern_is_an_offset_of_each_hole_and_no_machines_error() -> None:
    found = diagnosed(recorded([AS_IT_LIES], own_pattern()))
    assert found.verdict == "undetermined"
    assert found.noise.placing.value == pytest.approx(deformation_rms(own_pattern()), rel=0.2)


@pytest.mark.long
def test_a_plate_half_a_kelvin_cooler_on_the_later_date_is_not_a_scale_of_the_machine() -> None:
    """A plate that nobody certified, compared with itself: all distances shrink by 11.5 ppm/K."""
    facts = artefact_facts(kind="plate", cte_per_k=11.5e-6)
    then = recorded([AS_IT_LIES], own_pattern(20.0, 25), side=5)
    now, again = then, np.random.default_rng(8).normal(0, 1e-3, then.xyz.shape)
    middle = now.xyz.mean(axis=0)
    now = now.at(middle + (now.xyz - middle) * (1 - 0.5 * 11.5e-6) + again)
    plain = [Points(p.xyz, p.measurement, p.point, p.repeat, p.machine, {}, p.lines) for p in (now, then)]
    points = against_earlier(*plain, 11.5e-6, "now.csv")
    model = RecordingModel(artefact_of(facts, points), ())
    found = diagnose(model, stated_um=None, alpha=0.01, seed=0, observe=lambda some: artefact_of(facts, some))
    assert found.effects[0].effect == "artefact_temperature"
    kelvin = found.effects[0].parameters["k"]
    assert abs(kelvin.value + 0.5) < 4 * kelvin.u
    assert not [item.effect for item in found.effects if item.effect.startswith("scale")]
