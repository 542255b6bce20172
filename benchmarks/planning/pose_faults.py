"""The power that a plan of poses predicts, against concealed faults of robots and robots without any.

Run:  python -m benchmarks.planning.pose_faults named|detected COUNT [FIRST]

Each robot has rows, travels, a table and a tracker of its own (``benchmarks/planning/poses.py``), and a plan of fifty even
poses that says from which size on a fault of one joint is detected, and named, with 80 %. One fault, an eccentric encoder,
play of a gear, sag, a row or a zero that is not named, is as large as that; the recording of the plan is drawn by equations
that share no code with the package, with a tenth of what is possible in all named rows, and diagnosed; so is one of the
same robot without the fault. Printed are counts with exact 95 % intervals (Clopper, Pearson, Biometrika 26 (1934) 404).
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy import stats

from benchmarks.artefacts.arm_coverage import NAMED, OF_ROW, POSSIBLE, SECOND, Floats, place
from benchmarks.planning.poses import NOISE_MM, job_text
from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.planning import make_plan
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import kind_of
from cmm_uq.base.arm import Arm
from cmm_uq.base.points import Points
from cmm_uq.machine.physics.stated import physics_of

FALSE_ALARMS = 0.01
FAULTS = {
    "eccentric encoder": ("eccentricity_q1", "eccentricity_q2", "eccentricity_q3", "eccentricity_q4"),
    "play of a gear": ("slack_q1", "slack_q2", "slack_q3", "slack_q4"),
    "sagging link": ("sag_q2", "sag_q3", "sag_q5"),
    "wrong row": ("length_q2", "twist_q1", "offset_q4", "length_q3", "twist_q4", "twist_q3"),
    "joint offset": ("zero_q2", "zero_q3", "zero_q4", "zero_q5"),
}


def fault_of(seed: int) -> tuple[str, str]:
    kind = list(FAULTS)[seed % len(FAULTS)]
    return kind, FAULTS[kind][seed // len(FAULTS) % len(FAULTS[kind])]


def job_files(seed: int, fault: str) -> str:
    """Plan of fifty even poses; a row or a zero that is the fault is not named."""
    text = job_text(seed, 50).replace('criterion = "D"\nnumber = 50\n', "")
    return text.replace(f'"{fault}", ', "").replace("[plan]", f"[plan]\nrivals = {[fault]}".replace("'", '"'), 1)


def attained(points: Points, fault: str, size: float, random: np.random.Generator) -> Floats:
    """(n, 3) where the tool of a robot with errors in all named rows, and the fault, is seen; size in the fault's unit."""
    arm = points.machine
    assert isinstance(arm, Arm)
    rows = arm.rows.copy()
    for name in NAMED[:-1]:
        kind, joint = name.split("_q")
        if name != fault:
            rows[int(joint) - 1, OF_ROW[kind]] += 0.1 * POSSIBLE[kind] * random.standard_normal()
    kind, joint = fault.split("_q")
    i = int(joint) - 1
    if kind in OF_ROW:
        rows[i, OF_ROW[kind]] += size * (1e-3 if kind in ("length", "offset") else SECOND)
    tool, found = arm.tool_mm + random.normal(0, 0.5, 3), []
    q = np.radians(np.column_stack([points.columns[name] for name in arm.columns_of_joints]))
    for row, reading in enumerate(q):
        moved = reading.copy()
        if kind == "eccentricity":
            moved[i] += size * SECOND * np.sin(reading[i])
        elif kind == "slack":
            moved[i] += 0.5 * size * SECOND * points.columns[f"approach_{fault[-2:]}"][row]
        elif kind == "sag":
            # by how much the height of the tool changes per radian of the joint is the lever of its weight
            up, down = (place(arm.rows, reading + step * np.eye(6)[i], arm.tool_mm)[2] for step in (1e-5, -1e-5))
            moved[i] -= size * SECOND * (up - down) / 2e-5 / 1000
        found.append(place(rows, moved, tool))
    turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    return np.asarray(
        np.array(found) @ turn.T + random.uniform(-3000, 3000, 3) + random.normal(0, NOISE_MM, (len(q), 3))
    )


def recording(points: Points, seen: Floats) -> bytes:
    arm = points.machine
    assert isinstance(arm, Arm)
    names = [*arm.columns_of_joints, *(name for name in points.columns if name.startswith("approach_"))]
    table = np.column_stack([*(points.columns[name] for name in names), seen])
    head = ["measurement", "point", *names, *(f"reference_{axis}_mm" for axis in "xyz")]
    lines = [",".join(head)]
    lines += [",".join([f"1,{i + 1}", *(f"{value:.5f}" for value in row)]) for i, row in enumerate(table)]
    return ("\n".join(lines) + "\n").encode()


def tried(seed: int, *, named: bool) -> tuple[Counter[str], str]:
    """One robot with its fault as large as is ``named``, or else detected, with 80 %, and without it."""
    kind, fault = fault_of(seed)
    text, found = job_files(seed, fault), Counter[str]()
    planned = job_of({"job.toml": text.encode()}, recorded=False)
    with physics_of(planned):
        plan = make_plan(planned, seed=seed)
        points = plan.start.points
    (power,) = plan.start.powers
    size = power.identifiable if named else power.detectable
    if size is None:
        return Counter({"no size that physics allows": 1}), f"{seed} {fault}: no size"
    words = f"{seed} {fault} {size:.3g} {power.unit}"
    random = np.random.default_rng([seed, 45])
    without = text.replace(f'rivals = ["{fault}"]\n', "")
    for case, of in (("fault", size), ("nothing", 0.0)):
        seen = attained(points, fault, of, random)
        job = job_of({"job.toml": without.encode(), "recording.csv": recording(points, seen)})
        with physics_of(job):
            model, _ = screened_model(job)
            observe = partial(kind_of(job).observing("diagnosed"), job.facts.artefact, where=None)
            stated = job.facts.recording.u_coordinate_um
            diagnosis = diagnose(model, stated_um=stated, alpha=FALSE_ALARMS, seed=seed, observe=observe)
        names = [one.effect for one in diagnosis.effects]
        found[f"{case}: robots"] += 1
        found[f"{case}: something found"] += not diagnosis.agrees
        words += f"; {case}: {diagnosis.verdict} {names}"
        if case == "fault":
            found[f"{kind}: robots"] += 1
            found[f"{kind}: found"] += not diagnosis.agrees
            found[f"{kind}: named"] += fault in names
            found["fault: named"] += fault in names
            found["fault: named alone"] += names == [fault]
            found["fault: another named alone"] += bool(names) and fault not in names
    return found, words


def shown(total: Mapping[str, int]) -> str:
    lines = []
    for name, count in sorted(total.items()):
        of = total.get(f"{name.partition(':')[0]}: robots", 0)
        if name.endswith(": robots") or not of:
            lines.append(f"{name}: {count}")
            continue
        low, high = stats.binomtest(count, of).proportion_ci(0.95, method="exact")
        lines.append(f"{name}: {count} of {of}, {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})")
    return "\n".join(lines)


if __name__ == "__main__":
    total, first = Counter[str](), int(sys.argv[3]) if len(sys.argv) > 3 else 0
    for number in range(first, first + int(sys.argv[2])):
        counts, words = tried(number, named=sys.argv[1] == "named")
        total += counts
        print(words, flush=True)
    print(shown(total))
