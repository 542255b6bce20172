"""Spheres on two tables and under a head: errors of every axis found, ranges against polar coordinates, runs planned."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cmm_uq
from benchmarks.artefacts.five_axes_coverage import NAMED, drawn, names_of, positions, recorded
from cmm_uq.app.api.outcomes import Report
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.planning import make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.conftest import without_diagnosis
from tests.jobs.test_reading import edit

CHAINS = ["XYZ|AC", "XYZ-CA"]


@cache
def reported(chain: str) -> tuple[dict[str, Any], Points, Report]:
    """The errors of a machine of 4 × 4 matrices, its recording, and the report of that."""
    random, names = np.random.default_rng(8), names_of(chain, NAMED)
    machine = drawn(random, names)
    with TemporaryDirectory() as folder:
        job = recorded(chain, machine, names, random, Path(folder) / "job")
        with without_diagnosis():
            return machine, read_job(job).points, cmm_uq.report(job, seed=1)


@pytest.mark.long(but="XYZ|AC")
@pytest.mark.parametrize("chain", CHAINS)
def test_location_tilt_positioning_and_play_of_both_axes_are_estimated(tmp_path: Path, chain: str) -> None:
    """Twenty-two numbers within 3 u, and the location of each axis named with its U."""
    machine, _, report = reported(chain)
    for name in machine:
        found = report.estimates[report.estimates.index.str.startswith(f"{name}.")]
        if len(machine[name]) == 2:
            true = np.array([np.hypot(*machine[name]), np.arctan2(*machine[name][::-1])])
            off = found["value"].to_numpy() - true
            assert np.all(np.abs(off) < 4 * found["u"].to_numpy()), name
        else:
            assert abs(found["value"].iloc[0] - machine[name][0]) < 3.5 * found["u"].iloc[0], name
            assert found["u"].iloc[0] < 2.0, name
    report.write(tmp_path / "out")
    page = (tmp_path / "out" / "certificate-simulated.html").read_text("utf-8")
    for error in ("EY0A", "EZ0A", "EB0A", "EC0A", "EX0C", "EY0C", "EA0C", "EB0C"):
        assert page.count(f">{error}<") == 1


def test_ranges_are_those_of_polar_coordinates_about_the_axis_that_turned() -> None:
    """C on A at 35°: seen in the frame of C; A alone: about A, from where C has turned the spheres; both: along X, Y, Z."""
    _, points, report = reported("XYZ|AC")
    pivot = {"a": np.array([0.0, 5.0, 60.0]), "c": np.array([2.0, -3.0, 0.0])}
    spheres = report.results["spheres"]
    assert [one["turning"] for one in spheres] == [["A"]] * 4 + [["C"]] * 4 + [["A", "C"]] * 2
    means = {point: points.xyz[points.point == point].mean(axis=0) for point in (1, 2)}
    for one in spheres:
        own = points.select((points.measurement == one["measurement"]) & (points.point == one["point"]))
        if len(one["turning"]) == 2:
            for k, axis in enumerate("XYZ"):
                assert one[f"F{axis}_um"] == pytest.approx(1e3 * np.ptp(own.xyz[:, k]), abs=1e-6)
            continue
        letter = one["turning"][0].lower()
        along = "xyz".index({"a": "x", "c": "z"}[letter])
        # in the frame that turns with this axis: A carries C, which stood still meanwhile
        c = own.columns["c_deg"][0] if letter == "a" else 0.0
        turn = Rotation.from_euler("z", c, degrees=True)
        about = pivot["c"] * (letter == "a")
        xyz = turn.apply(own.xyz - about) + about - pivot[letter]
        middle = turn.apply(means[one["point"]] - about) + about - pivot[letter]
        radial = middle.copy()
        radial[along] = 0.0
        assert one["radius_mm"] == pytest.approx(np.linalg.norm(radial), abs=1e-9)
        assert one["height_mm"] == pytest.approx(middle[along], abs=1e-9)
        radial /= np.linalg.norm(radial)
        for name, unit in (("FR", radial), ("FT", np.cross(np.eye(3)[along], radial)), ("FA", np.eye(3)[along])):
            assert one[f"{name}_um"] == pytest.approx(1e3 * np.ptp((xyz - middle) @ unit), abs=1e-6)


@pytest.mark.long(but="XYZ|AC")
@pytest.mark.parametrize("chain", CHAINS)
def test_by_angle_is_the_mean_and_the_scatter_of_what_was_seen_there(chain: str) -> None:
    _, points, report = reported(chain)
    found = report.results["by_angle"]
    assert sum(one["count"] for one in found) == len(points)
    one = next(each for each in found if each["count"] == 2 and each["point"] == 1)
    same = (points.point == 1) & (points.columns["a_deg"] == one["a_deg"]) & (points.columns["c_deg"] == one["c_deg"])
    about = 1e3 * (points.xyz - points.xyz[points.point == 1].mean(axis=0))[same]
    np.testing.assert_allclose(one["mean_um"], about.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(one["s_um"], about.std(axis=0, ddof=1), atol=1e-9)


@pytest.mark.parametrize(("chain", "runs", "spheres"), [("XYZ|AC", 5, 2), ("XYZ-CA", 5, 1), ("XYZ-B|AC", 7, 2)])
def test_runs_are_planned_for_each_axis_while_the_others_stand(
    tmp_path: Path, chain: str, runs: int, spheres: int
) -> None:
    base = "XYZ|AC" if "|" in chain else "XYZ-CA"
    job = recorded(base, {}, names_of(base, ("location", "tilt")), np.random.default_rng(1), tmp_path / "job")
    edit(
        job,
        r"^chain = .*",
        f'chain = "{chain}"' + ("\nhead = { stylus_mm = [0, 0, -150] }" if chain.endswith("B|AC") else ""),
    )
    edit(job, r"^\[recording\]", '[plan]\nready = "runs"\n[recording]')
    (job / "recording.csv").unlink()
    written = write_plan(job, tmp_path / "plan", power=False)
    (job / "recording.csv").write_bytes(b"# simulated\n" + written.files["plan.csv"].read_bytes())
    points = read_job(job).points
    assert len(np.unique(points.measurement)) == runs
    assert set(points.point.tolist()) == set(range(1, spheres + 1))
    letters = [letter for letter in "abc" if letter.upper() in chain.strip("XYZ")]
    turned = []
    for run in np.unique(points.measurement):
        own = points.select(points.measurement == run)
        turned.append("".join(letter for letter in letters if np.ptp(own.columns[f"{letter}_deg"]) > 0))
        assert np.ptp(own.xyz[own.point == 1], axis=0).max() < 1e-6
    assert turned.count("".join(letters)) == 1
    assert all(turned.count(letter) == (2 if len(letters) > 1 else 1) for letter in letters)


def test_one_table_s_test_is_no_test_of_two(tmp_path: Path) -> None:
    job = recorded("XYZ|AC", {}, ["rotary_location_c_x"], np.random.default_rng(1), tmp_path / "job")
    (job / "recording.csv").unlink()
    with pytest.raises(CmmUqError, match=r'one rotary table alone.*ready = "runs"'):
        write_plan(job, tmp_path / "plan", power=False)


def test_a_sphere_that_strays_says_which_keys_may_be_wrong(tmp_path: Path) -> None:
    job = recorded("XYZ|AC", {}, ["rotary_location_c_x"], np.random.default_rng(1), tmp_path / "job")
    text = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(text.replace("[artefact]", '[machine.table]\ncoordinates = "machine"\n[artefact]'))
    with pytest.raises(
        CmmUqError, match=r"does not stay where it is.*mend coordinates, turns and axis_mm of the axes in"
    ):
        cmm_uq.report(job, seed=1)


def test_positions_are_those_of_five_runs() -> None:
    assert len(positions("XYZ|AC")) == 5 * 26


def test_a_better_plan_of_five_axes_has_other_axes_at_further_angles(tmp_path: Path) -> None:
    """Of spheres that stay where they are, runs alone are changed; together they tell more than five usual ones."""
    write_new("five_axes", tmp_path / "job", {})
    toml = tmp_path / "job" / "job.toml"
    plan = '\n[plan]\nready = "runs"\nrepeats = 1\ncriterion = "D"\nmore = 1\n'
    toml.write_text(toml.read_text(encoding="utf-8") + plan, encoding="utf-8")
    found = make_plan(read_job(tmp_path / "job"), power=False)
    assert found.better is not None
    (added,) = found.to_measure
    first, last = (points.xyz[points.point == 1][0] for points in (found.start.points, added.points))
    np.testing.assert_allclose(first, last, atol=0.01)
    before, after = (np.array([row.u for row in one.identifiability.parameters]) for one in (found.start, found.better))
    assert np.all(after < before)
    assert np.prod(after / before) < 0.5
