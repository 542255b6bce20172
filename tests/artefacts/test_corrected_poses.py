"""Corrected poses of robots whose recordings come from equations that share no code with the package."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.artefacts.arm_coverage import NAMED, OF_ROW, SECOND, Floats, place, robot
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import with_noise
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts.optical.corrected_poses import CorrectedPoses, corrected_poses
from cmm_uq.base.arm import Arm
from cmm_uq.base.points import Points
from cmm_uq.machine.physics.stated import physics_of
from cmm_uq.maths.geometry.feature import nearest_rotations

MEASURED = 0.7  # of the poses; the others are held out


def corrected(seed: int, frame: str) -> tuple[CorrectedPoses, Points, dict[tuple[str, str], float]]:
    """Of the poses held out of a robot's recording; errors of its rows are tenths of a millimetre and of a degree."""
    files, truth = robot(seed, "")
    text = files["job.toml"].replace(b"u_um = 5.0", f'u_um = 5.0\nframe = "{frame}"'.encode())
    lines = files["recording.csv"].splitlines(keepends=True)
    first = 1 + int(MEASURED * len(lines))
    whole = job_of({"job.toml": text, "recording.csv": files["recording.csv"]})
    job = job_of({"job.toml": text, "recording.csv": b"".join(lines[:first])})
    further = whole.points.select(np.arange(first - 1, len(whole.points)))
    with physics_of(job):
        return corrected_poses(with_noise(screened_model(job)[0])[0], further), further, truth


@pytest.mark.long
def test_places_held_out_lie_within_their_uncertainty() -> None:
    """Of six robots: as many coordinates within U as 95 % of so many, and no more than chance allows beyond the ellipsoids."""
    within, inside = list[bool](), list[bool]()
    for seed in range(6):
        found, further, _ = corrected(seed, "base")
        off = found.xyz - np.column_stack([further.columns[f"reference_{axis}_mm"] for axis in "xyz"])
        within += (np.abs(off) <= found.coverage_factor * found.u).ravel().tolist()
        squares = np.einsum("ni,ni->n", off, np.linalg.solve(found.covariance, off[:, :, None])[:, :, 0])
        inside += (squares <= 3 * 2.7).tolist()  # F of 3 and some fifty degrees, 95 %
        assert np.sqrt(np.mean(found.uncorrected**2)) > 10 * np.sqrt(np.mean(off**2))
    assert len(within) > 300
    assert 0.91 < np.mean(within) < 0.99
    assert np.mean(inside) > 0.88


def true_places(further: Points, readings: Floats, truth: dict[tuple[str, str], float]) -> Floats:
    """(n, 3) where the tool of the true robot is, by products of 4 × 4 matrices."""
    arm = further.machine
    assert isinstance(arm, Arm)
    rows = arm.rows.copy()
    for name in NAMED[:-1]:
        kind, joint = name.split("_q")
        unit = 1e-3 if kind in ("length", "offset") else SECOND
        rows[int(joint) - 1, OF_ROW[kind]] += unit * next(v for (e, _), v in truth.items() if e == name)
    tool = arm.tool_mm + 1e-3 * np.array([truth["tool_offset", f"{axis}_um"] for axis in "xyz"])
    return np.array([place(rows, np.radians(one), tool) for one in readings])


def misfit(places: Floats, wanted: Floats) -> float:
    """Root mean square distance, mm, of places from those wanted, the best placing of the base taken out."""
    about, other = places - places.mean(axis=0), wanted - wanted.mean(axis=0)
    turn = nearest_rotations((other.T @ about)[None])[0]
    return float(np.sqrt(np.mean(np.sum((about @ turn.T - other) ** 2, axis=1))))


@pytest.mark.parametrize("seed", [1, 3])
def test_a_true_robot_with_corrected_readings_is_where_its_rows_have_the_tool(seed: int) -> None:
    """Off by millimetres as commanded; corrected by what the noise of the recording leaves."""
    found, further, truth = corrected(seed, "own")
    arm = further.machine
    assert isinstance(arm, Arm)
    commanded = np.column_stack([further.columns[name] for name in arm.columns_of_joints])
    before = misfit(true_places(further, commanded, truth), further.xyz)
    after = misfit(true_places(further, found.readings, truth), further.xyz)
    assert before > 1.0
    assert after < 0.05 * before
    assert after < 2 * np.sqrt(3 * np.mean(found.u**2))
    assert found.left.max() < 1e-6
    backwards = misfit(true_places(further, 2 * commanded - found.readings, truth), further.xyz)
    assert backwards > 1.5 * before


def test_what_is_left_at_a_pose_is_in_its_uncertainty_and_places_do_not_depend_on_the_tracker() -> None:
    """u is no smaller than the noise; the frame of the base differs from the tracker's by a rigid motion alone."""
    (found, further, _), (own, _, _) = corrected(3, "base"), corrected(3, "own")
    assert found.u.min() > 0.01
    assert misfit(own.xyz, found.xyz) < 1e-3
    sizes, own_sizes = (np.linalg.norm(one.covariance, axis=(1, 2)) for one in (found, own))
    assert sizes == pytest.approx(own_sizes, rel=1e-6)
    assert own.xyz == pytest.approx(further.xyz, abs=20.0)
