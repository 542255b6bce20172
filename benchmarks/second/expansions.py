"""How often intervals hold an expansion that is concealed in the real error maps: ``python -m benchmarks.second.expansions``.

Sets of maps are those of the second study; of each the scale in which something is concealed is estimated, whether the
diagnosis would name it or not, so that none is left out for having turned out small.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.coverage.measuring import run
from benchmarks.second.judging import proportion
from benchmarks.second.maps import SQUARENESS, concealed

Found = tuple[str, bool, bool, float]
"""Scale, whether it is named, whether the interval holds, and (value − truth)/u."""


def estimated(task: tuple[int, int]) -> Found | None:
    """One set of maps; nothing where none is concealed, or where no explanation with an expansion is probable."""
    from cmm_uq.artefacts.error_maps.columns import columns_of
    from cmm_uq.artefacts.error_maps.comparison import column_comparison, expansion
    from cmm_uq.artefacts.error_maps.diagnosis import expansion_shown
    from cmm_uq.machine.physics.error_map import read_error_map

    made = concealed(*task, "set")
    if not made.truth["hidden"]:
        return None
    ((name, truth),) = made.truth["hidden"].items()
    with TemporaryDirectory() as folder:
        maps = []
        for t in SQUARENESS:
            file = Path(folder) / f"map_{t}.csv"
            file.write_text(made.files[file.name], encoding="utf-8")
            maps.append(replace(read_error_map(file), temperature=float(t)))
    column = next(each for each in columns_of(maps)[0] if each.is_scale and each.axis == name[-1])
    compared = column_comparison(column, (), task[1])
    index = next(i for i, rival in enumerate(compared.rivals) if rival.effect)
    draws = 1e6 * expansion(compared, index)
    if not len(draws):
        return None
    low, high = np.quantile(draws, (0.025, 0.975))
    named = expansion_shown(compared) is not None
    return name, named, bool(low <= truth <= high), float((draws.mean() - truth) / draws.std())


def main() -> None:
    """Estimate and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    counted: dict[str, list[Found]] = defaultdict(list)
    for found in run([(chosen.seed, number) for number in range(chosen.sets)], chosen.workers, estimated):
        for key in (found[0], "named" if found[1] else "not named", "all") if found else ():
            counted[key].append(found)
    for key, own in sorted(counted.items()):
        hits, pulls = sum(held for *_, held, _ in own), np.array([pull for *_, pull in own])
        low, high = proportion(hits, len(own))
        print(f"{key}: {hits} of {len(own)}, {100 * hits / len(own):.1f} % ({100 * low:.1f}–{100 * high:.1f}); "
              f"mean square of (value − truth)/u {np.mean(pulls**2):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
