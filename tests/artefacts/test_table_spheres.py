"""Spheres on a turning table: four-axis errors against polar coordinates, and what a whole test by ISO 10360-3 is."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cmm_uq
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from tests.analysis.conformity.by_hand.deciding import data_of_job, decided
from tests.conftest import ROOT
from tests.jobs.test_reading import edit

EXAMPLE = ROOT / "examples" / "table-spheres-simulated"
AXIS = np.array([450.0, 600.0, -400.0])
OUT = np.linspace(0.0, 720.0, 8)
SPHERES = np.array([[180.0, 60.0, 40.0], [-180.0, -60.0, 240.0]])


@pytest.fixture
def job(tmp_path: Path) -> Path:
    return Path(shutil.copytree(EXAMPLE, tmp_path / "job"))


def recorded(job: Path, angles: Floats, *, machine: bool = False, spheres: Floats = SPHERES, seed: int = 2) -> Floats:
    """Centres (n, spheres, 3) on the table with errors of some µm, written as the job's recording; exact turns."""
    random, rows, found = np.random.default_rng(seed), [], []
    for visit, degrees in enumerate(angles, 1):
        on_table = spheres + 1e-3 * random.normal(0, [1.0, 2.0, 0.5], spheres.shape)
        found.append(on_table)
        xyz = Rotation.from_euler("z", degrees, degrees=True).apply(on_table) if machine else on_table
        rows += [f"1,{i},{visit},{','.join(f'{v:.7f}' for v in p)},{degrees:.12g}" for i, p in enumerate(xyz, 1)]
    text = "\n".join(["measurement,point,repeat,x_mm,y_mm,z_mm,c_deg", *rows]) + "\n"
    (job / "recording.csv").write_text("# simulated\n" + text, encoding="utf-8")
    edit(job, r"^effects = .*", 'effects = ["rotary_location_c_x", "rotary_location_c_y"]')
    return np.array(found)


THERE_AND_BACK = np.concatenate([OUT, OUT[-2::-1]])
BESIDE = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 720.0])  # seven positions that are all but one
TURNS = np.array([0.0, 180.0, 181.0, 360.0, 361.0, 540.0, 541.0, 720.0])


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize("machine", [False, True])
def test_four_axis_errors_are_ranges_of_polar_coordinates_on_the_table(job: Path, *, machine: bool) -> None:
    found = recorded(job, THERE_AND_BACK, machine=machine)
    if machine:
        edit(job, r"^table = .*", f'table = {{ coordinates = "machine", axis_mm = {AXIS.tolist()} }}')
    spheres = cmm_uq.report(job, seed=1).results["spheres"]
    radius, turn = np.hypot(found[..., 0], found[..., 1]), np.unwrap(np.arctan2(found[..., 1], found[..., 0]), axis=0)
    for i, one in enumerate(spheres):
        assert one["radius_mm"] == pytest.approx(np.hypot(180, 60), abs=2e-3)
        assert one["height_mm"] == pytest.approx([40, 240][i], abs=2e-3)
        assert one["FR_um"] == pytest.approx(1e3 * np.ptp(radius[:, i]), abs=1e-3)
        assert one["FT_um"] == pytest.approx(1e3 * radius[:, i].mean() * np.ptp(turn[:, i]), abs=1e-3)
        assert one["FA_um"] == pytest.approx(1e3 * np.ptp(found[:, i, 2]), abs=1e-3)
    assert spheres[0]["FR_um"] > 2.0


def outcome(job: Path, figure: str = "FR") -> tuple[str, str]:
    """What the report states, without estimating the machine for it."""
    found = decided({path.name: path.read_bytes() for path in job.iterdir()}, figure)
    return found.outcome, " ".join(map(str, found.missing))


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_the_larger_of_both_spheres_is_decided_against_each_limit(job: Path) -> None:
    recorded(job, THERE_AND_BACK)
    spheres = cmm_uq.report(job, seed=1).results["spheres"]
    for figure in ("FR", "FT", "FA"):
        worst = max(one[f"{figure}_um"] for one in spheres)
        for limit, expected in ((worst + 0.01, "pass"), (worst - 0.01, "fail")):
            edit(job, rf'(?<=characteristic = "{figure}"\n)limit_um = .*', f"limit_um = {limit:.4f}")
            assert outcome(job, figure) == (expected, "")


def test_a_test_uncertainty_is_what_changed_between_the_positions(job: Path) -> None:
    """u_repeat_um as it is stated; the machine's own scatter is what is tested."""
    edit(job, r"^\[test_uncertainty.negligible\]\nrepeat = .*", "[test_uncertainty]\nu_repeat_um = 0.2")
    edit(job, r"^limit_um = .*", 'limit_um = 8.0\nrule = "ISO 14253-1"')
    errors = data_of_job(job)["errors"]
    assert {one["u_um"] for one in errors} == {0.2}


@pytest.mark.parametrize(("angles", "spheres", "lacks"), [
    (THERE_AND_BACK, SPHERES, ""),
    (OUT, SPHERES, "sphere A: 7 positions out and 0 back over 720°"),
    (np.concatenate([OUT[:7], OUT[5::-1]]), SPHERES, "6 positions out and 6 back over 617"),
    (0.5 * THERE_AND_BACK, SPHERES, "7 positions out and 7 back over 360°"),
    (np.concatenate([BESIDE, BESIDE[-2::-1]]), SPHERES, "7 positions out and 7 back over 720°, 354° without"),
    (np.concatenate([TURNS, TURNS[-2::-1]]), SPHERES, "7 positions out and 7 back over 720°, 179° without"),
    (THERE_AND_BACK, SPHERES[:1], "spheres A and B"),
    (THERE_AND_BACK, SPHERES * [[1, 1, 1], [-1, 1, 1]], "on opposite sides of the axis"),
    (THERE_AND_BACK, SPHERES * [[1, 1, 1], [0.7, 0.7, 1]], "at the same radius on opposite sides"),
    (THERE_AND_BACK, SPHERES * [[1, 1, 1], [1, 1, 0.2]], "spheres at different heights"),
])  # fmt: skip
def test_what_a_whole_test_lacks_is_named(job: Path, angles: Floats, spheres: Floats, lacks: str) -> None:
    recorded(job, angles, spheres=spheres)
    found, missing = outcome(job, "FA")
    assert (found, missing) == ("pass", "") if not lacks else found == "incomplete"
    assert lacks in missing


def test_a_table_that_turns_less_is_tested_over_its_travel(job: Path) -> None:
    edit(job, r"^table = .*", "table = { travel_deg = [0.0, 360.0] }")
    recorded(job, 0.5 * THERE_AND_BACK)
    assert outcome(job, "FA") == ("pass", "")


@pytest.mark.parametrize("travel", ["[-10.0, 730.0]", "[-360.0, 360.0]", "[0.0, 300.0]"])
def test_the_plan_is_a_whole_test_within_the_travel_of_the_table(job: Path, travel: str) -> None:
    edit(job, r"^table = .*", f"table = {{ travel_deg = {travel} }}")
    edit(job, r"^kind = .*", 'kind = "table_spheres"\nradius_mm = 150.0\nheight_mm = 120.0\nlow_mm = 30.0')
    (job / "recording.csv").unlink()
    written = write_plan(job, job.parent / "plan", power=False)
    (job / "recording.csv").write_bytes(b"# simulated\n" + written.files["plan.csv"].read_bytes())
    edit(job, r"^table = .*", f"table = {{ travel_deg = {travel} }}")
    artefact = artefact_of(read_job(job).facts.artefact, read_job(job).points)
    from cmm_uq.analysis.conformity.four_axis import conditions

    assert [one.missing for one in conditions(artefact, recorded=False)] == [()]


@pytest.mark.parametrize(("pattern", "replacement", "message"), [
    (r"^chain = .*", 'chain = "XYZ"', "no rotary table in its chain"),
    (r"^table = .*", f'table = {{ coordinates = "machine", axis_mm = {AXIS.tolist()} }}', 'give coordinates = "table"'),
    (r"^origin_mm = .*", "origin_mm = [450.0, 600.0, -400.0]\n", None),
])  # fmt: skip
def test_a_wrong_reading_of_the_table_is_said(job: Path, pattern: str, replacement: str, message: str | None) -> None:
    edit(job, pattern, replacement)
    if pattern.startswith("^chain"):
        edit(job, r"^table = .*", "")
    if message is None:
        assert len(read_job(job).points) == 30
        return
    with pytest.raises(CmmUqError, match=message):
        cmm_uq.report(job, seed=1)


def test_machine_coordinates_read_as_those_of_the_table_are_refused_with_the_fix(job: Path) -> None:
    recorded(job, THERE_AND_BACK, machine=True)
    with pytest.raises(CmmUqError, match=r"sphere 2 does not stay where it is on the table.*coordinates = \"machine\""):
        cmm_uq.report(job, seed=1)


def test_a_sphere_on_the_axis_has_no_radius(job: Path) -> None:
    recorded(job, THERE_AND_BACK, spheres=SPHERES * [[1, 1, 1], [0, 0, 1]])
    with pytest.raises(CmmUqError, match="sphere 2 lies on the axis of the table"):
        cmm_uq.report(job, seed=1)
