"""Damaged jobs of parts, read, planned and evaluated or refused: ``python -m benchmarks.hostile.parts --count 3000``.

Started from are the example with its points and a shaft on a common datum; each case mutates job.toml, the points or both, as
the cases of other kinds are mutated. Told is whatever ends in anything but an error of the package's own, or in a figure that
is none.
"""

from __future__ import annotations

import argparse
import random
import traceback
import warnings
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.hostile.mutators import mutate
from benchmarks.hostile.toml_text import dumps

EXAMPLE = Path(__file__).parents[2] / "examples" / "part-plate-simulated"
JOB, POINTS = "job.toml", "points.csv"
EXTENT_MM = 1e5
"""What is larger than this was mutated to be: nothing is evaluated to full precision there."""


@cache
def seeds() -> tuple[Mapping[str, bytes], ...]:
    """Files of jobs that are sound: the plate with measured points, and a shaft that is aligned by its two seats."""
    plate = {name: (EXAMPLE / name).read_bytes() for name in (JOB, POINTS)}
    seat = {"kind": "cylinder", "direction": [1.0, 0.0, 0.0], "diameter_mm": 30.0, "inner": False, "length_mm": 20.0}
    around = {"strategy": {"pattern": "sections", "sections": 2, "points": 8}}
    ring = {"kind": "plane", "diameter_mm": 20.0, "strategy": {"pattern": "circles", "circles": 2, "points": 6}}
    features = [
        {"name": name, "point_mm": [x, 0.0, 0.0], **seat, **around}
        for name, x in (("A", 0.0), ("B", 200.0), ("gear", 100.0))
    ]
    features += [{"name": "end", "point_mm": [-10.0, 0.0, 0.0], "direction": [-1.0, 0.0, 0.0], **ring},
                 {"name": "key", "point_mm": [150.0, 0.0, 15.0], "direction": [0.0, 0.0, 1.0], **ring}]  # fmt: skip
    asked = [{"name": str(i), "what": what, "features": ["gear"], "datums": ["A-B"], "tolerance_mm": 0.02}
             for i, what in enumerate(("total_runout", "coaxiality", "parallelism"))]  # fmt: skip
    shaft = {
        "job": {"id": "shaft", "date": "2026-05-31"}, "part": {"name": "Shaft"}, "machine_state": {"certificate": "machine"},
        "stylus": [{"name": "down", "diameter_mm": 4.0}], "feature": features, "alignment": {"datums": ["A-B", "end", "key"]},
        "characteristic": asked,
    }  # fmt: skip
    return plate, {JOB: dumps(shaft).replace('date = "2026-05-31"', "date = 2026-05-31").encode()}


def case(seed: int, number: int) -> tuple[str, dict[str, bytes]]:
    """How a job was damaged, and its files."""
    random_ = random.Random(f"{seed} {number}")
    start = random_.choice(seeds())
    files, ways = dict(start), []
    for name in random_.sample(sorted(files), random_.randint(1, len(files))):
        other = random_.choice(seeds())[JOB]
        way, files[name] = mutate(name, files[name], other, random_)
        ways.append(f"{name}: {way}")
    return "; ".join(ways), files


def outcome(files: Mapping[str, bytes]) -> str:
    """``evaluated`` or ``refused``; else what went wrong."""
    from cmm_uq.analysis.parts.evaluation import Evaluator
    from cmm_uq.analysis.parts.setup import plan_of, refuse_unfit
    from cmm_uq.base.errors import CmmUqError
    from cmm_uq.jobs.part.job import part_of

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            job = part_of(files, machine=False)
            refuse_unfit(job)
            plan = plan_of(job)
            points = plan.points if job.measured is None else job.measured
            values = Evaluator(plan, points - plan.points, [])([], exact=True)
    except CmmUqError as error:
        return "refused" if error.problem.strip() else "refused without a word"
    except Exception:
        return traceback.format_exc(limit=-4)
    if not np.isfinite(values).all() and np.abs(plan.points).max() < EXTENT_MM:
        return f"figures that are none: {values}"
    return "evaluated"


def main() -> int:
    """Run the cases and tell what came of them; 1 where something went wrong."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=3000)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    ended: Counter[str] = Counter()
    for number in range(given.count):
        way, files = case(given.seed, number)
        found = outcome(files)
        ended[found if found in ("evaluated", "refused") else "wrong"] += 1
        if found not in ("evaluated", "refused"):
            print(f"case {number} ({way}):\n{found}\n")
    print(f"{given.count} damaged jobs of parts: {dict(ended)}")
    return int(ended["wrong"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
