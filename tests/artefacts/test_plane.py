"""Plane: points probed on a flat surface whose place and tilt nobody knows."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.plane import PlaneSurface
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.certificate.document import Facts
from cmm_uq.maths.geometry import fit_plane
from cmm_uq.maths.inference.posterior import gain
from tests.artefacts.constructions import MIDDLE, estimated, free, indicated, recording
from tests.artefacts.simulated import analysed, blocks, recovered, table
from tests.conftest import ROOT, without_diagnosis
from tests.recordings import with_columns

SURFACE = artefact_facts(kind="plane")
PROBED = artefact_facts(kind="plane", probe_offset_mm=2.0, u_probe_offset_um=0.5)


def surface(normal: tuple[float, float, float] = (0.02, -0.01, 1.0), *, direction: bool = True) -> Points:
    """A grid of 6 × 5 points on a plane through the middle of the volume; before it, 8 mm off, the direction point."""
    n = np.array(normal) / np.linalg.norm(normal)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-300, 300, 6), np.linspace(-200, 200, 5)))
    across = np.linalg.svd(n[None, :])[2][1:]
    touched = MIDDLE + x[:, None] * across[0] + y[:, None] * across[1]
    xyz = np.vstack([touched[:1] + 8 * n, touched]) if direction else touched
    first = 0 if direction else 1
    return recording(xyz, np.ones(len(xyz), dtype=np.int64), np.arange(first, len(xyz) + first))


@pytest.mark.parametrize("direction", [True, False])
def test_large_errors_are_recovered_exactly(direction: bool) -> None:
    names, truth = ["straightness_x_z", "straightness_y_z", "rotation_x_x", "scale_x"], [180.0, -90.0, 300.0, 400.0]
    points = indicated(SURFACE, surface(direction=direction), names, truth)
    found = estimated(SURFACE, points, names[:3])
    np.testing.assert_allclose(found.value, truth[:3], rtol=2e-3)  # 400 ppm, unnamed, stretches the bows by so much
    exact = indicated(SURFACE, surface(direction=direction), names[:3], truth[:3])
    found = estimated(SURFACE, exact, names[:3])
    np.testing.assert_allclose(found.value, truth[:3], atol=1e-8)
    assert np.abs(found.residuals).max() < 1e-11


def test_a_level_plane_tells_nothing_of_scale_and_squareness() -> None:
    """They move a flat level surface into itself, or tilt it."""
    names = ["straightness_x_z", "scale_x", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
    found = estimated(SURFACE, surface((0, 0, 1.0)), names)
    assert sorted(next(iter(c)) for c in free(found)) == sorted(names[1:])


def test_an_error_of_the_stylus_radius_is_lost_in_the_height() -> None:
    points = with_columns(surface(), **{f"n{a}": np.full(31, v) for a, v in zip("xyz", (0.0, 0.0, 1.0), strict=True)})
    found = estimated(SURFACE, points, ["straightness_x_z", "probe_radius"])
    assert free(found) == [{"probe_radius": 1.0}]


def test_flatness_and_residuals_are_those_of_an_orthogonal_distance_fit() -> None:
    """Second method: the geometry room's plane, direction point left out."""
    points = indicated(SURFACE, surface(), [], [], sigma=2e-3, seed=6)
    plane = fit_plane(points.xyz[1:])
    found = estimated(SURFACE, points, [], sigma=None)
    np.testing.assert_allclose(np.abs(found.residuals), np.abs(plane.residuals), atol=1e-12)
    (probed,) = PlaneSurface(SURFACE, points).probed(1e-3)
    assert probed.flatness == pytest.approx(plane.form_deviation, abs=1e-12)
    assert probed.count == 30
    assert probed.surface is None


@pytest.mark.parametrize("normal", [(0.02, -0.01, 1.0), (0.0, 0.0, -1.0), (1.0, 0.1, 0.0), (-1.0, 0.0, 0.2)])
def test_the_surface_lies_one_offset_beneath_the_probe(normal: tuple[float, float, float]) -> None:
    """From whichever side: the direction point decides, and the middle moves by 2 mm against the outward normal."""
    (probed,) = PlaneSurface(PROBED, surface(normal)).probed(1e-3)
    n = np.array(normal) / np.linalg.norm(normal)
    assert probed.surface is not None
    np.testing.assert_allclose(probed.surface.normal, n, atol=1e-12)
    np.testing.assert_allclose(probed.surface.point, MIDDLE - 2 * n, atol=1e-9)
    assert n @ probed.surface.covariance[:3, :3] @ n == pytest.approx(0.5e-3**2, rel=1e-6)


def test_a_slanting_direction_point_is_rejected_with_what_to_do() -> None:
    points = surface((0, 0, 1.0))
    points.xyz[0] = points.xyz[1] + [30.0, 0, 1.0]
    with pytest.raises(CmmUqError, match="Measure the direction point again"):
        PlaneSurface(PROBED, points)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.select(p.point <= 2), "2 points of contact are too few"),
        (lambda p: p.select(p.point <= 6), "all points of contact lie on one line"),
        (lambda p: p.select(p.point == 0), "has no points of contact"),
    ],
)
def test_a_recording_that_is_none_of_a_plane_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        PlaneSurface(SURFACE, spoil(surface()))


def slanted(degrees: float, side: float = 1.0) -> Points:
    """A level plane whose only direction point was approached at an angle to the normal, from above or from below."""
    points = surface((0, 0, 1.0))
    angle = np.radians(degrees)
    points.xyz[0] = points.xyz[1] + 8 * np.array([np.sin(angle), 0.0, side * np.cos(angle)])
    return points


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("limit", [60.0, 20.0])
def test_the_range_of_acceptance_is_a_key_of_the_artefact(limit: float, side: float) -> None:
    """By construction: 0.01° within it is believed and moved to its side, 0.01° beyond is rejected; 60° without the key."""
    keys = {} if limit == 60.0 else {"acceptance_deg": limit}
    facts = artefact_facts(kind="plane", probe_offset_mm=2.0, **keys)
    (probed,) = PlaneSurface(facts, slanted(limit - 0.01, side)).probed(1e-3)
    assert probed.surface is not None
    assert probed.surface.point[2] == pytest.approx(MIDDLE[2] - 2 * side, abs=1e-9)
    assert probed.surface.reversed == (side < 0)
    assert np.degrees(probed.surface.angle) == pytest.approx(limit - 0.01, abs=1e-6)
    with pytest.raises(CmmUqError, match=rf"measurement 1: the direction point is rejected.*accepted are {limit:.1f}°"):
        PlaneSurface(facts, slanted(limit + 0.01, side))


def test_a_rejection_names_measurement_and_line() -> None:
    points = slanted(70.0)
    two = replace(
        surface(), xyz=np.vstack([surface().xyz, points.xyz]), measurement=np.repeat([3, 8], 31),
        point=np.tile(points.point, 2), repeat=np.ones(62, dtype=np.int64), lines=np.arange(2, 64),
    )  # fmt: skip
    with pytest.raises(CmmUqError, match=r"^plane\.csv line 33: measurement 8: the direction point is rejected"):
        PlaneSurface(PROBED, two, where="plane.csv")


def test_an_offset_without_a_direction_point_is_refused() -> None:
    points = replace(surface(direction=False), lines=np.arange(2, 32))
    with pytest.raises(CmmUqError, match=r"^plane\.csv line 2: measurement 1 has no direction point"):
        PlaneSurface(PROBED, points, where="plane.csv")
    assert PlaneSurface(SURFACE, points).probed(1e-3)[0].surface is None


def twice(second: tuple[float, float, float]) -> Points:
    """A level plane probed twice; the second direction point lies by so much beside the second first contact."""
    once = surface((0, 0, 1.0))
    again = once.xyz.copy()
    again[0] = again[1] + np.array(second)
    both = recording(np.vstack([once.xyz, again]), np.ones(62, dtype=np.int64), np.tile(once.point, 2))
    return replace(both, repeat=np.repeat([1, 2], 31))


def test_every_direction_point_of_a_measurement_is_checked() -> None:
    """The steepest is stated; one that slants, or comes from the other side, is rejected though the first is believed."""
    (probed,) = PlaneSurface(PROBED, twice((8.0, 0.0, 8.0))).probed(1e-3)
    assert probed.surface is not None
    assert np.degrees(probed.surface.angle) == pytest.approx(45.0)
    with pytest.raises(CmmUqError, match=r"approached at 75\.0°"):
        PlaneSurface(PROBED, twice((8.0, 0.0, 8.0 * np.tan(np.radians(15)))))
    with pytest.raises(CmmUqError, match="on the other side of the plane than the first one"):
        PlaneSurface(PROBED, twice((0.0, 0.0, -8.0)))


def test_the_order_of_the_rows_does_not_matter() -> None:
    """The first contact is point 1, wherever it stands in the file: 8 mm above it, and far from all others."""
    points = surface((0, 0, 1.0))
    (probed,) = PlaneSurface(PROBED, points.select(np.arange(31)[::-1])).probed(1e-3)
    assert probed.surface is not None
    assert probed.surface.angle == pytest.approx(0.0, abs=1e-7)
    assert probed.surface.point[2] == pytest.approx(MIDDLE[2] - 2.0)


def test_three_points_of_contact_suffice() -> None:
    """Claim 1 b. Their middle is uncertain by u/√3 along the normal, beside the offset's own 0.5 µm."""
    points = surface((0, 0, 1.0))
    (probed,) = PlaneSurface(PROBED, points.select(np.isin(points.point, (0, 1, 6, 30)))).probed(3e-3)
    assert (probed.count, probed.flatness) == (3, None)
    assert probed.surface is not None
    assert probed.surface.point[2] == pytest.approx(MIDDLE[2] - 2.0)
    assert probed.surface.covariance[2, 2] == pytest.approx(3e-3**2 / 3 + 0.5e-3**2)


JOB = "plane-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {"straightness_x_z": 4.0, "straightness_y_z": -2.5})


def test_a_bow_of_an_axis_is_as_uncertain_as_the_surface_may_be_bowed(tmp_path: Path) -> None:
    """A surface whose 2 µm of form are all a bow moves that of the axis by it; U of 0.36 µm had nothing of the form."""
    text = (
        (ROOT / "examples" / JOB / "job.toml").read_text(encoding="utf-8").replace("kind = ", "form_um = 2.0\nkind = ")
    )
    (tmp_path / "job.toml").write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "examples" / JOB / "recording.csv", tmp_path)
    alone = analysed(JOB)
    with without_diagnosis():
        found = analyse(tmp_path)
    model, x = found.model, found.artefact.points.xyz[found.artefact.rows[:, 0], 0]
    bow = np.zeros(x.shape)
    bow[:] = 2e-3 * (2 * (x - x.mean()) / np.ptp(x)) ** 2
    moved = gain(found.estimate.linear, float(found.posterior.sigma.mean()))[0] @ bow[model.used]
    one, other = (each.parameters["straightness_x_z"]["bow_um"] for each in (found, alone))
    assert abs(moved) > 4 * other.expanded
    assert abs(moved) <= one.expanded <= 1.5 * abs(moved)


def test_flatness_is_that_of_numpys_least_squares() -> None:
    """The plate is level to 20 µm/m, so heights over a fitted plane are its orthogonal distances to a nanometre."""
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[(rows["measurement"] == 1) & (rows["point"] > 0)]
    design = np.column_stack([np.ones(len(first)), first["x_mm"], first["y_mm"]])
    rest = first["z_mm"] - design @ np.linalg.lstsq(design, first["z_mm"], rcond=None)[0]
    assert float(table(JOB, "Flatness as recorded").rows[0][2]) == pytest.approx(np.ptp(rest) * 1e3, abs=0.006)


def test_the_surface_lies_one_offset_lower_than_the_probe() -> None:
    """Probe centre at −560 mm + 20 µm/m · 450 mm, offset 1.9986 mm: −561.9896 mm; 0.3 µm of offset dominate U."""
    number, place, normal, U, approach = table(JOB, "Surface, compensated for the probe's offset").rows[0]
    assert number == "1"
    assert float(place.split(", ")[2].replace("−", "-")) == pytest.approx(-560 + 2e-5 * 450 - 1.9986, abs=2e-3)
    assert float(normal.split(", ")[2]) == pytest.approx(1.0)
    assert 0.6 < float(U) < 1.0
    assert approach == "0"


def test_a_plane_has_no_length_to_be_certified() -> None:
    labels = [label for block in blocks(JOB) if isinstance(block, Facts) for label, _ in block.rows]
    assert "Artefact" in labels
    assert "Certified length" not in labels


THREE = """measurement,point,repeat,x_mm,y_mm,z_mm
1,0,1,59.99942,100.00027,-551.99925
1,1,1,60.00026,99.99956,-559.99882
1,2,1,709.99957,599.99977,-559.98465
1,3,1,839.99993,1100.00031,-559.98186
"""


def three_contacts(folder: Path, *, effects: str = "", u_coordinate_um: float | None = 0.5) -> Path:
    text = (ROOT / "examples" / JOB / "job.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^effects = .*$", f"effects = [{effects}]", text)
    if u_coordinate_um is not None:
        text = text.replace('"recording.csv"\n', f'"recording.csv"\nu_coordinate_um = {u_coordinate_um}\n')
    (folder / "job.toml").write_text(text, encoding="utf-8")
    (folder / "recording.csv").write_text(THREE, encoding="utf-8")
    return folder


def test_three_contacts_make_a_plane_whose_points_are_as_uncertain_as_is_stated(tmp_path: Path) -> None:
    """At least three (US 4,866,643, claim 1 b): in their middle u is √(0.5²/3 + 0.3²) µm of points and offset."""
    folder = three_contacts(tmp_path)
    assert not check_job(folder).problems
    (plane,) = cmm_uq.report(folder).results["planes"]
    matrix = np.array(plane["surface"]["covariance"]["matrix"])
    assert np.sqrt(matrix[2, 2]) * 1e3 == pytest.approx(np.hypot(0.5 / np.sqrt(3), 0.3), rel=0.1)


@pytest.mark.parametrize(("how", "told"), [
    ({"u_coordinate_um": None}, "leave nothing to estimate the noise from"),
    ({"effects": '"straightness_x_z"'}, "0 observations cannot determine 1 parameters"),
])  # fmt: skip
def test_what_three_contacts_cannot_tell_is_refused_by_the_check_and_by_the_report(
    tmp_path: Path, how: dict[str, Any], told: str
) -> None:
    folder = three_contacts(tmp_path, **how)
    (problem,) = check_job(folder).problems
    assert told in problem.problem
    with pytest.raises(CmmUqError, match=told):
        cmm_uq.report(folder)
