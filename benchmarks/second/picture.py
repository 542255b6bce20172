"""The second study as one picture: false alarms, what was found by strength, said and right."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from benchmarks.second import judging
from benchmarks.second.cases import EFFECTS, NOTHING
from benchmarks.second.judging import proportion

mpl.use("Agg")
import matplotlib.pyplot as plt

EDGES = (4.5, 5.5, 6.5, 7.5, 8.5, 10.0)


def draw(pairs: list, both: list, file: Path) -> None:
    """The picture into a file."""
    figure, (alarms, found, said) = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    _alarms(alarms, pairs)
    _found(found, [each for each in both if each[0]["kind"] in EFFECTS])
    _said(said, pairs)
    figure.savefig(file, dpi=130, metadata={"Software": None})
    plt.close(figure)


def _bars(axes: Any, x: Sequence[float], hits: Sequence[int], counts: Sequence[int], **look: Any) -> None:
    some = [(a, h, n) for a, h, n in zip(x, hits, counts, strict=True) if n]
    if not some:
        return
    place, k, n = (np.array(values) for values in zip(*some, strict=True))
    ends = np.array([proportion(int(a), int(b)) for a, b in zip(k, n, strict=True)]).T
    axes.errorbar(place, k / n, np.abs(ends - k / n), fmt="o", capsize=2, **look)


def _alarms(axes: Any, pairs: list) -> None:
    own = [[f["verdict"] != "consistent" for t, f in pairs if t["kind"] == kind] for kind in NOTHING]
    _bars(axes, range(len(NOTHING)), list(map(sum, own)), list(map(len, own)))
    axes.axhline(0.02, color="0.7")
    axes.set_xticks(range(len(NOTHING)), [kind.removeprefix("nothing, ") for kind in NOTHING], rotation=40, ha="right")
    axes.set(ylabel="false alarms", ylim=(0, None))


def _found(axes: Any, both: list) -> None:
    weakest = np.array([min(t["wanted"].values()) for t, *_ in both])
    ways = {
        "found": lambda f, o: f,
        "oracle": lambda f, o: judging.of_oracle(o["estimates"]),
        "oracle, noise known": lambda f, o: judging.of_oracle(o["knows"]),
    }
    for i, (name, way) in enumerate(ways.items()):
        hits = np.array([judging.hit(t, way(f, o)) for t, f, o in both], dtype=bool)
        inside = [(weakest >= a) & (weakest < b) for a, b in pairwise(EDGES)]
        middle = [0.5 * (a + b) + 0.12 * (i - 1) for a, b in pairwise(EDGES)]
        _bars(axes, middle, [int(hits[w].sum()) for w in inside], [int(w.sum()) for w in inside], label=name)
    axes.set(xlabel="√λ of the weakest hidden effect", ylabel="part in which all was found", ylim=(0, 1.03))
    axes.legend(frameon=False, loc="lower right")


def _said(axes: Any, pairs: list) -> None:
    rows = [judging.told(name, t, f) for t, f in pairs for name in f["effects"]]
    axes.plot([0, 1], [0, 1], color="0.7")
    if rows:
        tenths = judging.tenths([said for said, _ in rows], [right for _, right in rows])
        _bars(axes, [row[1] for row in tenths], [row[2] for row in tenths], [row[0] for row in tenths])
    axes.set(xlabel="said probability", ylabel="part that was right", ylim=(0, 1.03))
