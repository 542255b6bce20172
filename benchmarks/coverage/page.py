"""The page of a study, written from its counts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.coverage.artefacts import ARTEFACTS
from benchmarks.coverage.cells import STATED, cells
from benchmarks.coverage.noises import NOISES
from benchmarks.coverage.tally import POOLED, Count, Tally, pooled, wider

WANTED, CELL, CRIES = (93.0, 97.0), (92.0, 98.0), 2.0
"""Per cent: of what is pooled by kind of noise, of every cell's interval, and of false alarms at most."""

EXPLAINED = """\
Recordings by equations that share no code with the package (`python -m benchmarks.coverage.study FOLDER --page`); true
errors, sizes and noise are drawn anew for each, and the job names all physics that acts. The reading noise is 0.7 to 2 µm
and not stated, unless a row says so. Every second recording, and all of slow noise, have the time. Of a gauge either the
whole line is measured three times over, or each face three times before the next.

| noise | what |
| --- | --- |
| white | independent and alike in every coordinate |
| set-up 0.5, 1, 2 | beside it an offset of each point of each placing, shared by its repeats, of that size |
| axis × 2, × 3 | one axis, drawn anew, reads that many times worse |
| growing | from one to three times: with the distance along a gauge, else of each coordinate over its travel |
| correlated | an Ornstein–Uhlenbeck process alone, 0.85 from one observation to the next; of a bar, in its length |
| walk | white beside a random walk whose standard deviation ends at four times the reading noise; of a bar, in its length |
| t3 | Student's t with three degrees of freedom |
| resolution | white, displayed in steps of 5 µm |

*Hold*: 95 % intervals that contain the truth: of factors (all parameters of all effects), of sizes, of figures of
performance (of a ballbar the mean over 400 repetitions with the noise drawn anew; of a gauge line its slope without noise).
In brackets the exact binomial interval of 99.9 %, too narrow in that it takes intervals of one recording for independent.
*Noisy axis*: the scale of the axis that reads worse. *Cries*: diagnoses neither consistent nor
undetermined, all of them false."""


def page(found: Mapping[str, Tally], beside: Mapping[str, Tally], power: Path | None) -> str:
    """As Markdown.

    Parameters
    ----------
    found : tallies by cell.
    beside : those of another run on the same recordings, for the ratio of u under white noise.
    power : counts of the power curve, where there are some.
    """
    total = pooled(found, lambda cell: True)
    lines = ["# Do the intervals hold?", "", EXPLAINED, "", *_verdict(found), "", "## By kind of noise", "",
             "| noise | recordings | hold | factors | sizes | figures | worst factor | noisy axis | cries |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for noise in NOISES:
        lines += _row(noise, pooled(found, lambda cell, n=noise: cell.noise == n and cell.stated == "unstated"))
    lines += ["", "## Noise stated", "", "| stated, and noise | recordings | hold | factors | sizes | figures | worst factor "
              "| noisy axis | cries |", "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for level in STATED:
        if level != "unstated":
            lines += _row(f"**{level}**", pooled(found, lambda cell, s=level: cell.stated == s))
    for cell in cells():
        if cell.stated != "unstated" and cell.name in found:
            lines += _row(cell.name, found[cell.name])
    lines += ["", "## By artefact and kind of noise", "", "Hold, and cries."]
    lines += ["", "| noise | " + " | ".join(ARTEFACTS) + " |", "| --- |" + " --- |" * len(ARTEFACTS)]
    for noise in NOISES:
        cell_texts = [_cell(found.get(f"{artefact}, {noise}")) for artefact in ARTEFACTS]
        lines.append(f"| {noise} | " + " | ".join(cell_texts) + " |")
    lines += _beside(found, beside)
    if power is not None and power.exists():
        lines += ["", *_power(json.loads(power.read_text(encoding="utf-8")))]
    seconds = np.array(total.seconds)
    if len(seconds):
        lines += ["", f"Seconds a recording: median {np.median(seconds):.1f}, longest {seconds.max():.1f}; all together "
                  f"{seconds.sum() / 3600:.1f} h of one core."]  # fmt: skip
    if total.faults:
        lines += ["", "Refused or failed:", "", *(f"- {n} × {words}" for words, n in total.faults.items())]
    return "\n".join(lines) + "\n"


def _verdict(found: Mapping[str, Tally]) -> list[str]:
    """What does not keep to what is wanted."""
    wrong = []
    for noise in NOISES:
        one = pooled(found, lambda cell, n=noise: cell.noise == n)
        held = one.group(*POOLED)
        if held.of and not WANTED[0] <= held.share <= WANTED[1]:
            wrong.append(f"pooled over {noise}, {held.share:.1f} % hold")
        if one.noisy.of and not WANTED[0] <= one.noisy.share <= WANTED[1]:
            wrong.append(f"the scale of the noisy axis, {noise}, {one.noisy.share:.1f} %")
        if one.cries.of and one.cries.share > CRIES:
            wrong.append(f"{one.cries.share:.1f} % cry under {noise}")
    for name, tally in found.items():
        held = tally.group(*POOLED)
        if held.of and (held.interval[0] > CELL[1] or held.interval[1] < CELL[0]):
            wrong.append(f"{name}: {held.share:.1f} %, interval {_span(held)}")
    wanted = (
        f"Wanted: {WANTED[0]:g} to {WANTED[1]:g} % pooled by kind of noise, no cell's interval outside {CELL[0]:g} to "
        f"{CELL[1]:g} %, at most {CRIES:g} % of cries by kind. "
    )
    return [
        wanted + ("Kept throughout." if not wrong else "Not kept:"),
        *(["", *(f"- {each}" for each in wrong)] if wrong else []),
    ]


def _row(name: str, tally: Tally) -> list[str]:
    if not tally.recordings:
        return []
    held, (worst, count) = tally.group(*POOLED), tally.worst
    groups = " | ".join(_share(tally.group(group)) for group in POOLED)
    least = f"{worst.split('.')[0]} {count.share:.0f}" if count.of else "–"
    return [f"| {name} | {tally.recordings} | {_share(held)} {_span(held)} | {groups} | {least} | {_share(tally.noisy)} "
            f"| {_share(tally.cries)} {_span(tally.cries)} |"]  # fmt: skip


def _cell(tally: Tally | None) -> str:
    if tally is None:
        return "–"
    held = tally.group(*POOLED)
    return f"{_share(held)} {_span(held)}, {_share(tally.cries)}"


def _share(count: Count) -> str:
    return f"{count.share:.1f}" if count.of else "–"


def _span(count: Count) -> str:
    return "({:.1f}–{:.1f})".format(*count.interval) if count.of else ""


def _beside(found: Mapping[str, Tally], beside: Mapping[str, Tally]) -> list[str]:
    both = {a: wider(found[f"{a}, white"], beside[f"{a}, white"]) for a in ARTEFACTS
            if f"{a}, white" in found and f"{a}, white" in beside}  # fmt: skip
    told = [f"{artefact} {ratio:.2f}" for artefact, ratio in both.items() if ratio is not None]
    return (
        ["", f"Where the noise is white, u of the factors over that of a model of white noise: {', '.join(told)}."]
        if told
        else []
    )


def _power(curve: Mapping[str, Mapping[str, Mapping[str, list[int]]]]) -> list[str]:
    """Rows by recording and √λ, of how many of how many were found."""
    lines = [
        "## What is found of concealed effects", "",
        "One effect of the catalogue that the job does not name, its √λ set; white noise, not stated. *Oracle*: a test at 1 %",
        "that knows effect and noise. *Found*: verdict other than consistent; *named*: the effect itself, or one named as",
        "indistinguishable from it.", "",
        "| recording | √λ | found | named | oracle |", "| --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for design, rows in curve.items():
        for root, counts in rows.items():
            told = " | ".join(_share(Count(*counts[key])) for key in ("found", "named", "oracle"))
            lines.append(f"| {design} | {root} | {told} |")
    return lines
