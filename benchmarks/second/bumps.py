"""What of dents in ballbars an oracle sees that is told only that they are bumps: ``python -m benchmarks.second.bumps``.

Of the second study's cases outside the catalogue. It is told the family, an error along one axis that falls off as a normal
density about one place, and neither which axis nor where nor how wide; it looks for nothing else, and estimates the noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from benchmarks.concealed.physics import TRAVEL
from benchmarks.second.artefacts import Placed
from benchmarks.second.cases import Case, case
from benchmarks.second.oracle import Forms, known_forms, searched_among

WIDTHS = (80.0, 130.0, 210.0)
"""Standard deviations that are tried, mm; a dent of the study has 130."""
HIDDEN = "dent at one place"
_SEEN = 0.05
"""Length of a column, of a bump of 1 mm, from which on the recording could show it at all."""


def bumps(placed: Placed) -> Forms:
    """Bumps of every width in steps of it throughout the travel, along each axis; all one explanation."""
    columns = []
    for width in WIDTHS:
        for place in product(*(_places(low, high, width) for low, high in TRAVEL)):
            factor = np.exp(-0.5 * np.sum(((placed.true - np.array(place)) / width) ** 2, axis=1))
            columns += [-placed.D @ np.outer(factor, axis).ravel() for axis in np.eye(3)]
    kept = [column for column in columns if np.linalg.norm(column) > _SEEN]
    return Forms(np.stack(kept, axis=1)[:, :, None], np.zeros(len(kept), dtype=int))


def _places(low: float, high: float, width: float) -> np.ndarray:
    return np.linspace(low + 0.5 * width, high - 0.5 * width, max(1, int((high - low) / width)))


def p_values(made: Case, seed: int) -> tuple[float, float]:
    """Of a dent, told its place, width and axis, and told none of them."""
    family = searched_among(made, ["a bump"], [bumps(made.placed)], knows_noise=False, seed=seed)
    return known_forms(made, seed)[0], family.p_value


def dents(seeds: Sequence[int], cases: int) -> Iterator[tuple[int, int, Case]]:
    """Cases with a dent that ballbars recorded."""
    for seed, number in product(seeds, range(cases)):
        made = case(seed, "outside", number)
        if made.truth["design"] == "ballbar" and HIDDEN in made.truth["hidden"]:
            yield seed, number, made


def main() -> None:
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, action="append", help="of the cases; by default 20261122 and 20261124")
    parser.add_argument("--cases", type=int, default=60, help="of each seed that are outside the catalogue")
    chosen = parser.parse_args()
    print("seed      case  noise    told all  told that it is a bump")
    for seed, number, made in dents(chosen.seed or (20261122, 20261124), chosen.cases):
        told, family = p_values(made, number)
        print(f"{seed}  {made.name:5s} {made.noise.kind:8s} {told:8.3f}  {family:8.3f}", flush=True)


if __name__ == "__main__":
    main()
