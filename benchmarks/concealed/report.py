"""What a study of concealed cases found: counts, calibration, coverage, as text and plots."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import norm

from benchmarks.concealed.generator import DESIGNS, NOTHING, SIGNALS
from benchmarks.marked import put

Pairs = list[tuple[dict, dict]]


_LIKE = 3.0
"""√λ below which what a known effect leaves of a function outside the catalogue could not be seen."""

EXPLAINED = """\
![Detected and named by strength; said and right; held-out rms before and after](images/diagnosis-study.png)

`python benchmarks/concealed/study.py FOLDER --summary docs`. √λ is the length of what is hidden over the noise, after
projecting out all that the job names and the other hidden effects: 4.5 to 7 with twenty placings of a ballbar, else 6 to
15. *One*, *two*, *three*: effects of the catalogue. *Roughly*: an effect of another form, or a periodic error with a second
harmonic. *Outside*: functions that no effect has (steps, waves, bumps, cubics, dents, jumps in time, loads, lobes); apart
are those of which a known effect leaves less than √λ = 3. *Inseparable*: an effect with a twin. The rest hides nothing:
noise stated at half or twice its size, set-up offsets of half or one standard deviation, noise correlated in time (0.5,
0.8), t noise of three or four degrees of freedom. A case is right when the verdict is, and all that is hidden and nothing
else is named."""

BEGIN, END = "<!-- written by benchmarks.concealed.study -->", "<!-- end of the first -->"

PEER = """\
The same by a greedy χ² search that knows the true noise and the catalogue's common effects, and takes the noise for white
(`benchmarks/concealed/greedy.py`):"""

MIMICKED = "outside, but as a known effect"


def row_of(truth: dict) -> str:
    """Kind, a function outside the catalogue that a known effect imitates apart."""
    return MIMICKED if truth["kind"] == "outside" and truth["stands_in"][1] < _LIKE else truth["kind"]


def expected_calibration_error(p: np.ndarray, good: np.ndarray, bins: int = 10) -> float:
    """Mean over bins of equal width of |mean probability − fraction right|, weighted by how many are in each."""
    which = np.clip((p * bins).astype(int), 0, bins - 1)
    total = sum(np.sum(which == b) * abs(p[which == b].mean() - good[which == b].mean()) for b in np.unique(which))
    return float(total / len(p))


def write(pairs: Pairs, peers: Pairs, right: Callable, covered: Callable, sealed: str, docs: Path | None) -> None:
    lines = [f"{len(pairs)} cases, truth sealed before the run as `{sealed[:16]}…`.", ""]
    lines += _table(pairs, right, (*SIGNALS, MIMICKED, *NOTHING))
    lines += ["", "In brackets: without counting effects named together as indistinguishable."]
    if peers:
        lines += ["", PEER, "", *_table(peers, right, ("one", "two", "three", "outside", *NOTHING))]
    named = [
        (t, name, item["probability"], item["together"], {name}.union(*(g for g in f["groups"] if g[0] == name)))
        for t, f in pairs
        for name, item in f["effects"].items()
        if t["kind"] != "roughly"
    ]
    p, together = np.array([each[2] for each in named]), np.array([each[3] for each in named])
    good = np.array([name in t["hidden"] for t, name, *_ in named])
    good_together = np.array([bool(group & set(t["hidden"])) for t, *_, group in named])
    hits = defaultdict(list)
    for t, f in pairs:
        for parameter, held in covered(t, f):
            hits[parameter].append(held)
    every = [held for some in hits.values() for held in some]
    nothing = [f["verdict"] != "consistent" for t, f in pairs if t["kind"] in NOTHING]
    seconds = np.array([f["seconds"] for _, f in pairs])
    lines += ["", f"False alarms: {sum(nothing)} of {len(nothing)}."]
    if every:
        lines += ["", f"Intervals at 95 % hold the truth in {sum(every)} of {len(every)} ({100 * np.mean(every):.1f} %):", "",
                  "| " + " | ".join(sorted(hits)) + " |", "|" + " --- |" * len(hits),
                  "| " + " | ".join(f"{sum(v)}/{len(v)}" for _, v in sorted(hits.items())) + " |", ""]  # fmt: skip
    if len(p):
        lines += [
            f"Effects named {len(p)}, mean probability {p.mean():.3f}, right {good.mean():.3f}; expected calibration error "
            f"{expected_calibration_error(p, good):.3f}. Of them or one named as indistinguishable: mean probability "
            f"{together.mean():.3f}, right {good_together.mean():.3f}; expected calibration error "
            f"{expected_calibration_error(together, good_together):.3f}."
        ]
    lines += [f"Seconds a case: median {np.median(seconds):.1f}, longest {seconds.max():.1f}."]
    print("\n".join(lines))
    if docs is not None:
        docs.mkdir(parents=True, exist_ok=True)
        put(docs / "diagnosis-studies.md", BEGIN, END, "\n".join([*lines, "", EXPLAINED]))
        _plots(pairs, right, p, good, docs / "images")


def _table(pairs: Pairs, right: Callable, kinds: Sequence[str]) -> list[str]:
    designs = list(DESIGNS)
    lines = ["| hidden | " + " | ".join(designs) + " |", "| --- |" + " --- |" * len(designs)]
    for kind in kinds:
        cells = []
        for what in designs:
            both = [right(t, f) for t, f in pairs if row_of(t) == kind and t["design"] == what]
            if not both:
                cells.append("–")
                continue
            strict, grouped = (sum(values) for values in zip(*both, strict=True))
            cells.append(f"{grouped} of {len(both)}" + (f" ({strict})" if strict != grouped else ""))
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return lines


def _plots(pairs: Pairs, right: Callable, p: np.ndarray, good: np.ndarray, folder: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    signals = [
        (min(t["root_lambda"].values()), right(t, f)[1], f["p"] < 0.01)
        for t, f in pairs
        if t["kind"] in ("one", "two", "three")
    ]
    root, correct, detected = map(np.array, zip(*signals, strict=True))
    edges = np.array([4.5, 5.5, 7, 9, 11, 13, 15])
    middle = 0.5 * (edges[1:] + edges[:-1])
    for values, label in ((detected, "mismatch detected"), (correct, "all named rightly")):
        rate = [values[(root >= a) & (root < b)].mean() if np.any((root >= a) & (root < b)) else np.nan
                for a, b in itertools.pairwise(edges)]  # fmt: skip
        axes[0].plot(middle, rate, "o-", label=label)
    strength = np.linspace(edges[0], edges[-1], 200)
    axes[0].plot(strength, norm.sf(norm.isf(0.005) - strength), color="0.6", label="oracle that knows effect and noise")
    axes[0].set(xlabel="√λ of the weakest hidden effect", ylabel="part of the cases", ylim=(0, 1.03))
    axes[0].legend(frameon=False)
    if len(p):
        which = np.minimum((p * 10).astype(int), 9)
        used = np.unique(which)
        axes[1].plot([0.4, 1], [0.4, 1], color="0.7")
        axes[1].scatter([p[which == b].mean() for b in used], [good[which == b].mean() for b in used],
                        s=[20 + 2 * np.sum(which == b) for b in used])  # fmt: skip
        axes[1].set(xlabel="said probability", ylabel="part that was right")
    gains = np.array([f["heldout"][:2] for t, f in pairs if f["effects"]])
    if len(gains):
        axes[2].loglog(gains[:, 0], gains[:, 1], ".")
        ends = [gains.min(), gains.max()]
        axes[2].plot(ends, ends, color="0.7")
        axes[2].set(xlabel="held-out rms before / µm", ylabel="after / µm")
    figure.savefig(folder / "diagnosis-study.png", dpi=130)
    plt.close(figure)
