"""The page of the study, written from its records."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.ranks.drawn import CASES, STATED
from benchmarks.ranks.ranking import DRAWS
from benchmarks.ranks.uniformity import band, chi_squared, width

LEVEL = 0.05
"""Of each family of tests (Bonferroni), and of the band."""
_FEWEST = 10
"""Recordings from which on a width is told."""

EXPLAINED = f"""\
Simulation-based calibration (Talts et al. 2018, arXiv:1804.06788) of `cmm_uq/maths/inference/posterior.py` (`python
-m benchmarks.ranks.study FOLDER --page`). Parameters are drawn from their priors, sizes of the noise from theirs
([noise.md](noise.md)), the noise of a coordinate from that of a stated {STATED * 1e3:g} µm; the recording follows
from the linear model and the noise of one of the coverage study's, of which every second has the time in it and so
slow noise (for the digitizer, of its example). {DRAWS} draws of the posterior, as far apart as they can be, say the
rank of each true parameter, of each size of the noise, and of the likelihood of these sizes (Modrák et al. 2023).
If the sampler draws what model and priors say, every rank is uniform; whether machines are as the priors say is the
coverage study's question.

*χ²*: of ten bins of ranks, of fewer where a bin would expect fewer than five; p is of one quantity, *adjusted* for
all of its table (Bonferroni). *Band*: how many quantities leave the simultaneous {100 * (1 - LEVEL):g} % band of
the distribution function (Säilynoja et al. 2022), of which one in twenty is expected to, or the smallest level
whose band one leaves, not adjusted. *Width*: standard deviation of the posteriors over the right one, by how far
from the middle the ranks lie, with its 95 % interval. *Not converged*: chains that were stopped before they
converged, as a certificate would say; their ranks count."""


@dataclass
class Ranked:
    """Of one artefact.

    Parameters
    ----------
    recordings : ranks by quantity of each.
    unconverged : how many chains were stopped before they converged; their ranks count.
    faults : what went wrong, in words.
    seconds : of each.
    """

    recordings: list[Mapping[str, int]] = field(default_factory=list)
    unconverged: int = 0
    faults: list[str] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def quantities(self) -> Mapping[str, list[int]]:
        """Ranks by quantity."""
        found: dict[str, list[int]] = defaultdict(list)
        for ranks in self.recordings:
            for name, each in ranks.items():
                found[name].append(each)
        return found


def gathered(records: Sequence[Mapping[str, Any]]) -> dict[str, Ranked]:
    """By artefact; each recording once."""
    found: dict[str, Ranked] = {}
    for record in {(each["cell"], each["number"]): each for each in records}.values():
        one = found.setdefault(record["cell"], Ranked())
        one.seconds.append(record["seconds"])
        if "fault" in record:
            one.faults.append(record["fault"])
        else:
            one.recordings.append(record["ranks"])
            one.unconverged += not record["converged"]
    return {name: found[name] for name in CASES if name in found}


def page(found: Mapping[str, Ranked]) -> str:
    """As Markdown."""
    every = Ranked([ranks for one in found.values() for ranks in one.recordings])
    by_artefact = {(name, quantity): ranks for name, one in found.items() for quantity, ranks in one.quantities.items()}
    pooled = {("all artefacts", quantity): ranks for quantity, ranks in _shared(found).items()}
    lines = ["# Are the ranks of the truth uniform?", "", EXPLAINED, "", *_verdict(by_artefact, pooled, every)]
    lines += ["", "## By artefact", "",
              "| artefact | recordings | quantities | worst χ² | p | adjusted | outside the band | width, parameters "
              "| width, noise | not converged |", "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    lines += [_row(name, one, len(by_artefact)) for name, one in found.items()]
    lines += ["", "## All artefacts together", "", "Quantities that more than one artefact has.", "",
              "| quantity | recordings | χ², p | adjusted | band, level | width |",
              "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for (_, name), ranks in pooled.items():
        p = chi_squared(ranks)
        lines.append(
            f"| {name} | {len(ranks)} | {_p(p)} | {_p(_adjusted(p, len(pooled)))} | {_p(band(ranks))} | "
            f"{_width([[each] for each in ranks])} |"
        )
    seconds = np.concatenate([one.seconds for one in found.values()])
    lines += ["", f"Seconds a recording: median {np.median(seconds):.1f}, longest {seconds.max():.1f}; all together "
              f"{seconds.sum() / 3600:.2f} h of one core."]  # fmt: skip
    faults = [f"- {name}: {fault}" for name, one in found.items() for fault in one.faults]
    return "\n".join([*lines, *(["", "Failed:", "", *faults] if faults else [])]) + "\n"


def _shared(found: Mapping[str, Ranked]) -> dict[str, list[int]]:
    """Ranks of each quantity of more than one artefact."""
    total, artefacts = defaultdict(list), defaultdict(set)
    for name, one in found.items():
        for quantity, ranks in one.quantities.items():
            total[quantity] += ranks
            artefacts[quantity].add(name)
    return {quantity: ranks for quantity, ranks in sorted(total.items()) if len(artefacts[quantity]) > 1}


def _verdict(
    by_artefact: Mapping[tuple[str, str], list[int]], pooled: Mapping[tuple[str, str], list[int]], every: Ranked
) -> list[str]:
    wrong = []
    for family in (by_artefact, pooled):
        for (name, quantity), ranks in family.items():
            p = chi_squared(ranks)
            if _adjusted(p, len(family)) < LEVEL:
                wrong.append(f"- {quantity}, {name}: p = {_p(p)}, {len(ranks)} recordings")
    parameters, noise = (_width(_of(every.recordings, noise=noise)) for noise in (False, True))
    told = f"{len(every.recordings)} recordings. Width of all parameters {parameters}, of the noise {noise}. "
    if not wrong:
        return [told + f"No quantity departs from uniform ranks at {100 * LEVEL:g} % a table."]
    return [told + f"Not uniform at {100 * LEVEL:g} % a table:", "", *wrong]


def _row(name: str, one: Ranked, tests: int) -> str:
    """Of one artefact; its p-values are adjusted for those of all artefacts."""
    each = {quantity: chi_squared(ranks) for quantity, ranks in one.quantities.items()}
    told = {quantity: p for quantity, p in each.items() if not np.isnan(p)}
    worst, p = min(told.items(), key=lambda item: item[1], default=("–", float("nan")))
    outside = sum(band(ranks) <= LEVEL for ranks in one.quantities.values())
    widths = " | ".join(_width(_of(one.recordings, noise=noise)) for noise in (False, True))
    return (
        f"| {name} | {len(one.recordings)} | {len(each)} | {worst} | {_p(p)} | {_p(_adjusted(p, tests))} | {outside} "
        f"| {widths} | {one.unconverged} |"
    )


def _of(recordings: Sequence[Mapping[str, int]], *, noise: bool) -> list[list[int]]:
    """Ranks of the parameters, or of the sizes of the noise, by recording."""
    return [
        [rank for name, rank in ranks.items() if name.startswith("noise.") == noise and name != "noise.likelihood"]
        for ranks in recordings
    ]


def _width(recordings: list[list[int]]) -> str:
    if len(recordings) < _FEWEST:
        return "–"
    return "{:.2f} ({:.2f}–{:.2f})".format(*width(recordings))


def _adjusted(p: float, tests: int) -> float:
    """Bonferroni; not a number where there was no test."""
    return p if np.isnan(p) else min(1.0, p * tests)


def _p(p: float) -> str:
    return "–" if np.isnan(p) else f"{p:.2g}" if p >= 1e-4 else f"{p:.0e}"
