"""Do intervals hold where a report states values alone? The machines of :mod:`.coverage`, and parts that are not nominal.

Each part's points lie off their nominals by a rigid motion of every feature and by form, of the size given in µm. A program
finds values of measured points; those are all that is known. Of a size, distance or angle the interval is the value less the
errors about the nominal part; of a zone, value ± the quantile of the zones that errors give a perfect part.

Run: ``python -m benchmarks.parts.values [MACHINES]``
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.parts.coverage import DRAWS, calibrated
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.points import Floats

SIZES_UM = (0.0, 5.0, 30.0)


def part_of(plan: Plan, size_um: float, random: np.random.Generator) -> Floats:
    """(n, 3) deviations of a part's points, mm."""
    found = 0.2 * random.standard_normal((len(plan.points), 1)) * plan.normals
    for rows in plan.rows.values():
        about = plan.points[rows] - plan.points[rows].mean(axis=0)
        reach = max(1.0, float(np.abs(about).max()))
        found[rows] += random.standard_normal(3) + np.cross(random.standard_normal(3), about / reach)
    return 1e-3 * size_um * found


def main(machines: int) -> None:
    random = np.random.default_rng(1)
    inside, half = {size: [] for size in SIZES_UM}, list[Floats]()
    for one in calibrated(machines, random):
        plan, zones = one.plan, never_negative(one.plan)
        seen = AtPose(plan, MeasurementConditions(one.real), one.pose)
        at = AtPose(plan, MeasurementConditions(one.states["c"]), one.pose)
        drawn = at.errors(at.drawn(random, DRAWS))
        low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
        most = np.quantile(np.abs(drawn), 0.95, axis=0)
        low, high = np.where(zones, -most, low), np.where(zones, most, high)
        half.append(0.5 * (high - low))
        for size in SIZES_UM:
            part = part_of(plan, size, random)
            error = seen.base + seen.moved(seen.drawn(random, 1))[0]
            true, stated = (characteristics_of(plan, plan.points + each) for each in (part, part + error))
            inside[size].append((low <= stated - true) & (stated - true <= high))
    print(f"{machines} machines; a coverage of 95 % scatters by {np.sqrt(0.95 * 0.05 / machines) * 100:.1f} %")
    print("part off by, µm:", *SIZES_UM, " median U")
    for i, one_of in enumerate(plan.characteristics):
        unit, name = (1e3, "µm") if one_of.what != "angle" else (1e6, "µrad")
        held = (f"{100 * float(np.mean([row[i] for row in inside[size]])):6.1f} %" for size in SIZES_UM)
        print(f"{one_of.name:14s}", *held, f"{unit * float(np.median([row[i] for row in half])):8.2f} {name}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
