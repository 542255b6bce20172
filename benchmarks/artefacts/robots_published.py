"""Robots whose joint angles and tracker positions were published: named model, and points held out of its fit.

Run:  python -m benchmarks.artefacts.robots_published FOLDER [NAME …]

FOLDER holds copies of the repositories, each under owner+name; none is part of this one. Rows are the maker's where the source
names the robot, else (HUST, Fanuc) those of the robot whose lengths a first fit gave; so are reflectors, to a millimetre.
Shares have two standard errors of whole regions of places, sixteen by halving the points four times.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from benchmarks.artefacts.arm_coverage import NAMED
from cmm_uq.app.commands.model import model_of
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import artefact_of
from cmm_uq.artefacts.optical.corrected_poses import corrected_poses
from cmm_uq.artefacts.optical.tracked import TrackedPoints, predicted_poses
from cmm_uq.machine.physics.stated import physics_of

Floats = NDArray[np.float64]
Recorded = tuple[Floats, Floats, Floats, tuple[tuple[float, ...], ...], Floats, tuple[str, ...]]
"""Joints (n, 6) °, seen places and reflectors (n, 3) mm, rows a α d θ, senses of the last motion (n, 6), more effects."""
IRB_120 = ((0, -90, 290, 0), (270, 0, 0, -90), (70, -90, 0, 0), (0, 90, 302, 0), (0, -90, 0, 0), (0, 0, 72, 180))
TX90L = ((50, -90, 0, 0), (500, 0, 50, -90), (0, -90, 0, -90), (0, 90, 550, 0), (0, -90, 0, 0), (0, 0, 100, 0))
MH5 = ((150, -90, 0, 0), (614, 180, 0, -90), (200, -90, 0, 0), (0, 90, -640, 0), (30, 90, 0, -90), (0, 0, 200, 0))
FANUC = ((312, -90, 670, 0), (1075, 0, 0, -90), (225, -90, 0, 0), (0, 90, 1280, 0), (0, -90, 0, 0), (0, 0, 215, 0))


def reflectors(q: Floats, seen: list[Floats], tips: Floats, rows: tuple[tuple[float, ...], ...], *more: str,
               senses: Floats | None = None) -> Recorded:  # fmt: skip
    count = len(seen)
    came = np.zeros_like(q) if senses is None else senses
    return (
        np.vstack([q] * count),
        np.vstack(seen),
        np.repeat(tips, len(q), axis=0),
        rows,
        np.vstack([came] * count),
        more,
    )


def irb_120(folder: Path, count: int, *more: str) -> Recorded:
    """982 poses of an ABB IRB 120 by a FARO tracker; which side each joint came from by the pose before."""
    at = folder / "icelinker+Robot-Calibration-LaserTracker" / "4-DataProcess" / "Output"
    q = np.loadtxt(at / "processed_joints.txt")
    seen = [np.loadtxt(at / f"processed_SMR_{i}.txt") for i in range(1, count + 1)]
    tips = np.array([[0.3, -3.4, 123.0], [75.2, 88.0, 215.9], [150.8, -3.9, 124.2]])[:count]
    senses = np.sign(np.round(np.diff(q, axis=0, prepend=q[:1]), 2))
    return reflectors(q, seen, tips, IRB_120, *more, senses=senses)


def minimal(folder: Path) -> Recorded:
    """36 poses, three points each, of an IRB 120 (Wu, Yang, Chen, Ren, IEEE Trans. Autom. Sci. Eng. 12 (2015) 758)."""
    from scipy.io import loadmat

    at = folder / "drliaowu+Minimal_Robot_Calibration_Using_Position" / "MinimalPositionCalibration"
    q, seen = (loadmat(at / f"Cali{name}.mat")[f"Cali{name}"] for name in ("JointAngles", "Position"))
    return reflectors(q, [seen[i::3] for i in range(3)], np.array([[0.4, -16, 21], [0, -5, 35], [0, 6, 21]]), IRB_120)


def motoman(folder: Path, hand: str, first: int) -> Recorded:
    """Motoman MH5 of a two-armed robot by a Leica tracker (Stepanova et al., Robot. Comput.-Integr. Manuf. 73 (2022))."""
    from scipy.io import loadmat

    at = folder / "ctu-vras+multirobot-calibration/UserData/Robots/Motoman/Dataset/leica_dataset"
    data = loadmat(at / f"leica_{hand}_hand_6x6x6_dataset.mat")["dataset"]
    data = data[~np.isnan(data[:, -1])]
    data = data[np.unique(data[:, 0], return_index=True)[1]]
    return reflectors(np.degrees(data[:, first : first + 6]), [1000 * data[:, 19:22]], np.array([[130.0, 0, 225]]), MH5)


def hust(folder: Path, name: str) -> Recorded:
    """A robot of HUST by a Leica AT960 (Zhang et al., Mendeley Data srxktn4752), whose lengths are those of a TX90L."""
    import pandas as pd

    at = folder / "ZhangTeng-Hust+ASTL" / "Data" / name
    seen = pd.read_csv(at / "Leica.csv", encoding="latin1").iloc[:, :3].to_numpy(dtype=np.float64)
    q = pd.read_excel(at / "theta.xlsx").to_numpy(dtype=np.float64)
    return reflectors(q, [seen], np.array([[33.0, 19, 99]]), TX90L, "offset_q2", "parallelism_q3")


def fanuc(folder: Path) -> Recorded:
    """36 poses, three reflectors (Boby, Klimchik, LaserTrackerPoseData4KinIdent); joint 3 is told from the horizontal."""
    data = np.loadtxt(folder / "RABKKK+LaserTrackerPoseData4KinIdent" / "N1N2N3Jval.csv")
    q = data[:, -6:] * [1, 1, -1, -1, -1, -1]
    q[:, 2] -= data[:, -5]
    tips = np.array([[0.0, 2, 341], [196, -46, 204], [-139, -146, 203]])
    return reflectors(q, [data[:, 3 * i : 3 * i + 3] for i in range(3)], tips, FANUC)


PLAY = ("slack_q1", "slack_q2", "slack_q3")
SAG = ("sag_q2", "sag_q3", "sag_q5", "sag_links_q2", "sag_links_q3", "eccentricity_q1", "eccentricity_q2", "ovality_q2")
ROBOTS: dict[str, Callable[[Path], Recorded]] = {
    "IRB 120, one reflector": lambda at: irb_120(at, 1),
    "IRB 120, one reflector, with play, sag, encoders": lambda at: irb_120(at, 1, *PLAY, *SAG),
    "IRB 120, three reflectors, with play, sag, encoders": lambda at: irb_120(at, 3, *PLAY, *SAG),
    "IRB 120 of Wu 2015": minimal,
    "Motoman, right": lambda at: motoman(at, "right", 7), "Motoman, left": lambda at: motoman(at, "left", 13),
    "Fanuc": fanuc,
    **{f"HUST {name}": lambda at, name=name: hust(at, name) for name in ("Calibration", "POINTS", "LINE", "CURVE", "SURFACE")},
}  # fmt: skip


def job_files(recorded: Recorded) -> dict[str, bytes]:
    q, seen, tips, rows, senses, more = recorded
    names = [f"q{i}_deg" for i in range(1, 7)], [f"approach_q{i}" for i in range(1, 7)]
    places = (f"{what}_{axis}_mm" for what in ("tip", "reference") for axis in "xyz")
    head = ["measurement", "point", *names[0], *names[1], *places]
    cells = np.column_stack([np.ones(len(q)), np.arange(1, len(q) + 1), q, senses, tips, seen])
    lines = [",".join(head), *(",".join(f"{value:.10g}" for value in row) for row in cells)]
    several = len(np.unique(tips, axis=0)) > 1
    effects = [*NAMED, *(["zero_q6"] if several else []), *more]
    keys = "a_mm", "alpha_deg", "d_mm", "theta_deg"
    each = ("\n".join(f"{key} = {value}.0" for key, value in zip(keys, row, strict=True)) for row in rows)
    joints = "\n".join(f"[[machine.joint]]\n{row}" for row in each)
    text = f"""[job]\nid = "robot"\ndate = 2026-01-01\n[machine]\nname = "robot"\n{joints}\n[artefact]\nkind = "tracked_points"
u_um = "15 + 6·L/1000"\n[recording]\nfile = "recording.csv"\n[model]\neffects = {effects}\n""".replace("'", '"')
    return {"job.toml": text.encode(), "recording.csv": ("\n".join(lines) + "\n").encode()}


def regions(xyz: Floats) -> Iterator[NDArray[np.int64]]:
    """Sixteen regions of about as many points: halved four times across where they reach farthest."""
    parts = [np.arange(len(xyz))]
    for _ in range(4):
        parts = [half for part in parts
                 for half in np.array_split(part[np.argsort(xyz[part, np.argmax(np.ptp(xyz[part], axis=0))])], 2)]  # fmt: skip
    yield from parts


def share(held: Floats, xyz: Floats) -> str:
    """Of points (n,) or coordinates (n, 3) that hold, %, with two standard errors of regions."""
    whole = held.reshape(len(held), -1)
    off = [float((whole[part] - whole.mean()).sum()) for part in regions(xyz)]
    return f"{100 * whole.mean():.1f} ± {200 * np.sqrt(np.sum(np.square(off)) * 16 / 15) / whole.size:.1f} %"


def shown(name: str, folder: Path) -> str:
    job = job_of(job_files(ROBOTS[name](folder)))
    with physics_of(job):
        artefact = artefact_of(job.facts.artefact, job.points)
        model = model_of(job, artefact)
        estimate, predicted = model.estimate(), predicted_poses(model)
    assert isinstance(artefact, TrackedPoints)
    assert predicted is not None
    before = np.linalg.norm(artefact.deviations(), axis=1)
    after = np.linalg.norm(model.residuals(estimate.about).reshape(-1, 3), axis=1)
    figures = " / ".join(
        f"{1000 * each.mean():.0f}, {1000 * each.max():.0f}" for each in (before, after, predicted.off)
    )
    xyz = artefact.points.xyz[predicted.rows]
    rank = f"{estimate.least_squares.rank} of {len(model.unknowns)}"
    return f"| {name} | {len(before)} | {rank} | {figures} | {share(predicted.within, xyz)} | {share(predicted.inside, xyz)} |"


def corrected(name: str, folder: Path) -> str:
    """Every second pose fitted, places of the others by ``compensate --poses`` against where they were seen."""
    files = job_files(ROBOTS[name](folder))
    text = files["job.toml"].replace(b'"tracked_points"', b'"tracked_points"\nframe = "base"')
    lines = files["recording.csv"].splitlines(keepends=True)
    job = job_of({"job.toml": text, "recording.csv": b"".join([lines[0], *lines[1::2]])})
    further = job_of({"job.toml": text, "recording.csv": b"".join([lines[0], *lines[2::2]])}).points
    with physics_of(job):
        found = corrected_poses(model_of(job, artefact_of(job.facts.artefact, job.points)), further)
    off = found.xyz - np.column_stack([further.columns[f"reference_{axis}_mm"] for axis in "xyz"])
    squares = np.einsum("ni,ni->n", off, np.linalg.solve(found.covariance, off[:, :, None])[:, :, 0])
    away, within = 1000 * np.linalg.norm(off, axis=1), np.abs(off) <= found.coverage_factor * found.u
    inside = squares <= 3 * fdtri(3, found.degrees, 0.95)
    held = f"{share(within, further.xyz)} | {share(inside, further.xyz)}"
    return f"| {name} | {len(job.points)} | {len(further)} | {away.mean():.0f}, {away.max():.0f} | {held} |"


if __name__ == "__main__":
    study = corrected if sys.argv[2:3] == ["corrected"] else shown
    for robot in sys.argv[3 if study is corrected else 2 :] or ROBOTS:
        print(study(robot, Path(sys.argv[1])), flush=True)
