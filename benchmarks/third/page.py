"""What the third study found, as a page: counts with exact binomial intervals, beside what was asked and a run before."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.marked import put
from benchmarks.second import judging as second, noises
from benchmarks.second.judging import proportion
from benchmarks.third.cases import EFFECTS, KINDS, OUTSIDE, case
from benchmarks.third.judging import Judged, Name, calibration
from benchmarks.third.running import Generator

BEGIN, END = "<!-- written by benchmarks.third.study -->", "<!-- end of the third -->"
FEW = 20
"""Cases below which a share is told and not judged."""
VERDICTS = ("consistent", "undetermined", "unexplained", "empirical", "partial", "explained")

SAID = """\
### What was done

`python -m benchmarks.third.study FOLDER --count {count} --seed {seed} --page docs` makes, seals and diagnoses the cases,
and asks an oracle (`--resume` goes on). Generator and oracle (`benchmarks/third/`, and what they take of
`benchmarks/second/`) share no code with the package.

- **Recordings**: 20 to 40 ballbars twice, a step gauge on 7 to 12 lines there and back twice, a plate of sixteen balls in
  one to three ways twice, and the twenty bars of the DEA Iota 1102, whose residuals, dealt anew, are the noise (*real*).
  Columns are there or not; the noise is stated in half, of these one in five wrong by a factor of two; rows stand in any
  order in three of ten; of one in seven the model is the prediction of another program.
- **Noise** as in the second study.
- Chains are a tenth as long as those of a diagnosis, and the next measurement is left out.

√λ is the length of what shows over the noise.

| hidden | √λ | what |
| --- | --- | --- |
| dictionary, other: two of five | 3.5 to 25, evenly in its logarithm | a step, dent, ramp, cubic, saturating curve \
(tanh), sawtooth, exponential in time, sine with a harmonic, product of two positions, bowl, sign of motion or dead \
zone; a chirp, absolute sine, cusp, ripple, random field of two positions, stick–slip or random walk of position or \
time; every effect of the second study's catalogue leaves half of it |
| catalogue | 4.5 to 12 | one or two effects |
| squareness, ratio | | the three squarenesses; two scales or squarenesses as 1 : 2; both with a job that names nothing |

| of the oracle, which outside the catalogue knows covariate, axis and noise | meaning |
| --- | --- |
| sees | "nothing" is rejected at 1 %, by the most surprising member of the dictionary or sum of cosines among 199 \
draws of noise |
| knows the noise alone | the same of every covariate that varies, every pair of positions and every axis at once, at 1 %, \
and the most surprising is of the true covariate: what a search can find at best |
| removes | held-out rms, of set-ups or of the points of few, with the true form and a fitted size |
| decides | the true form has odds of 20 : 1 against every other form of the dictionary, a smooth function and \
nothing, under equal priors |
| catalogue | the second study's, which estimates the noise |

| of the diagnosis | meaning |
| --- | --- |
| located | the covariate is named in `where` or in the empirical model, or effects that leave less than √λ = 2 |
| named | the true form, or effects that leave less than that |
| wrong | a name that is neither true, nor said to be one with the truth, nor equal to it as far as is seen (√λ below \
2), nor a form against which the oracle has less than 20 : 1. Of *squareness* and *ratio* an effect is right only \
where the truth is named with it; against a prediction also a scale or squareness worth 20 : 1 of what is hidden |"""

THIRD = Generator(case, 200, whole=False, marks=(BEGIN, END), said=SAID)


@dataclass(frozen=True)
class Row:
    """What was asked, what a run shows, and whether it is kept (of enough cases)."""

    asked: str
    target: str
    shown: str
    kept: bool | None


def write(
    every: Sequence[Judged], before: Sequence[Judged], state: str, asked: dict[str, Any], docs: Path | None,
    further: Sequence[str] = (), said: str = SAID, marks: tuple[str, str] = (BEGIN, END),
) -> None:  # fmt: skip
    """Print the page, with ``further`` tables and what is ``said`` of how it was done, and write it between ``marks`` into
    ``docs`` where that is given."""
    page = [state, ""]
    for part in (_rows(every, before), _missed(every), _outside(every), _others(every), _verdicts(every), _nothing(every),
                 _inside(every), _said(every), further):  # fmt: skip
        page += [*part, ""] if part else []
    page.append(said.format(**asked))
    text = "\n".join(page) + "\n"
    print(text)
    if docs is not None:
        put(docs / "diagnosis-studies.md", *marks, text.strip())


def share(hits: Iterable[Any]) -> str:
    """So many of so many, with an exact interval."""
    each = [bool(hit) for hit in hits]
    if not each:
        return "–"
    low, high = proportion(sum(each), len(each))
    return f"{sum(each)} of {len(each)}: {100 * np.mean(each):.1f} % ({100 * low:.1f}–{100 * high:.1f})"


def _kept(hits: Sequence[Any], least: float | None = None, most: float | None = None) -> bool | None:
    if len(hits) < FEW:
        return None
    part = float(np.mean([bool(hit) for hit in hits]))
    return (least is None or part >= least) and (most is None or part <= most)


def figures(every: Sequence[Judged]) -> list[Row]:
    """Rows of what was asked."""
    out = [one for one in every if one.kind in OUTSIDE]
    real = [one for one in every if one.kind == "real"]
    found = [one for one in out if one.oracle_finds]
    seen = [one for one in out if one.oracle_sees]
    ours, oracle = _taken(seen)
    decided = [one for one in out if one.decided]
    undecided = [one for one in out if one.kind == "dictionary" and not one.decided]
    others = [one for one in out if one.kind == "other"]
    names = [name for one in every for name in one.names]
    # a form that no dictionary has is named as another, or not at all: that is counted apart
    known = [name for one in every for name in one.names if not (one.kind == "other" and name.form)]
    nothing = [one for one in every if one.kind == "nothing"]
    by_noise = {kind: [one.alarm for one in nothing if one.noise == kind] for kind in noises.KINDS}
    worst = max(
        (kind for kind in noises.KINDS if by_noise[kind]), key=lambda k: float(np.mean(by_noise[k])), default=""
    )
    powers = [one.found for one in every if one.kind == "catalogue" and one.found]
    mine, theirs = sum(a for a, _ in powers), sum(b for _, b in powers)
    parted = [(members, apart) for one in every for members, apart in one.classes]
    p = calibration(names) if names else 1.0
    off = [row for row in _tenths(names) if abs(row[1] - row[2] / row[0]) > 0.1] if names else []
    part = (
        f"{100 * ours / oracle:.0f} %, of {len(seen)} ({100 * ours:.0f} % of the rms by {100 * oracle:.0f} %)"
        if oracle
        else "–"
    )
    return [
        Row("Outside, located where the oracle sees it", "≥ 95 %", share(o.located for o in seen),
            _kept([o.located for o in seen], least=0.95)),
        Row("the same where an oracle locates it that knows the noise alone", "apart", share(o.located for o in found), None),
        Row("the same in real residuals", "≥ 95 %", share(o.located for o in real if o.oracle_sees), None),
        Row("Held-out rms that goes, of what the oracle removes", "≥ 60 %", part,
            None if len(seen) < FEW else ours >= 0.6 * oracle),
        Row("Form named where the oracle decides", "≥ 80 %", share(o.form_named for o in decided),
            _kept([o.form_named for o in decided], least=0.8)),
        Row("Form withheld where it does not", "≥ 95 %", share(o.form_said is None for o in undecided),
            _kept([o.form_said is None for o in undecided], least=0.95)),
        Row("Form withheld where no dictionary has it", "apart", share(o.form_said is None for o in others), None),
        Row("A wrong name outside a class, of all names", "≤ 2 %", share(n.wrong for n in known),
            _kept([n.wrong for n in known], most=0.02)),
        Row("Members of classes that the oracle parts by 20 : 1", "none",
            f"{sum(a for _, a in parted)} of {sum(m for m, _ in parted)} in {len(parted)} classes",
            not sum(a for _, a in parted) if parted else None),
        Row("Said and right, pooled", "p > 0.01", f"p = {p:.2g}, of {len(names)}", p > 0.01 if len(names) >= FEW else None),
        Row("Said and right, by tenth", "within 0.1", f"{len(off)} off" if names else "–",
            not off if len(names) >= FEW else None),
        Row("False alarms, pooled", "≤ 2 %", share(o.alarm for o in nothing), _kept([o.alarm for o in nothing], most=0.02)),
        Row("the same in the worst kind of noise", "≤ 5 %",
            f"{worst}: {share(by_noise[worst])}" if worst else "–", _kept(by_noise.get(worst, []), most=0.05)),
        Row("Catalogue, found of what the oracle finds", "≥ 95 %", f"{mine} : {theirs} of {len(powers)}",
            None if len(powers) < FEW else mine >= 0.95 * theirs),
    ]  # fmt: skip


def _taken(seen: Sequence[Judged]) -> tuple[float, float]:
    """Mean part of the held-out rms that goes, here and by the oracle."""
    each = [one.taken for one in seen if one.taken is not None]
    return (float(np.mean([a for a, _ in each])), float(np.mean([b for _, b in each]))) if each else (0.0, 0.0)


def _rows(every: Sequence[Judged], before: Sequence[Judged]) -> list[str]:
    words = {True: "kept", False: "**not kept**", None: "too few"}
    rows, old = figures(every), figures(before)
    lines = ["| | asked | before | this run (95 % interval) | |", "| --- | --- | --- | --- | --- |"]
    for row, was in zip(rows, old, strict=True):
        said = "" if row.target == "apart" else words[row.kept]
        lines.append(f"| {row.asked} | {row.target} | {was.shown if before else '–'} | {row.shown} | {said} |")
    return lines


def _missed(every: Sequence[Judged]) -> list[str]:
    """What falls short, by cause."""
    listed: dict[str, list[str]] = {
        "Seen by the oracle and not located": [
            f"{_of(one)}, {one.verdict}" for one in every if one.oracle_sees and not one.located
        ],
        "Form decided and not named": [
            f"{_of(one)}, {one.form_said or one.verdict}" for one in every if one.decided and not one.form_named
        ],
        "Wrong names": [
            f"{name.name} ({name.probability:.2f}) for {_of(one)}" for one in every for name in one.names if name.wrong
        ],
        "False alarms": [f"{one.name}: {one.design}, {one.noise}, {one.verdict}" for one in every if one.alarm],
        "Found by the oracle alone": [
            _of(one) for one in every if one.kind == "catalogue" and one.found == (False, True)
        ],
    }
    return ["### What falls short", "", "| what | cases |", "| --- | --- |", *(
        f"| {title} | {'; '.join(cases) if cases else 'none'} |" for title, cases in listed.items()
    )]  # fmt: skip


def _of(one: Judged) -> str:
    return f"{one.cause} ({one.name}, {one.design}, {one.noise}, √λ {one.root_lambda:.0f})"


def _outside(every: Sequence[Judged]) -> list[str]:
    lines = ["### Outside the catalogue, by form", "",
             "| form | cases | the oracle sees | of these located | held-out rms, by the oracle | decided | of these named | "
             "else withheld | wrong names |", "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    rows: dict[tuple[str, str], list[Judged]] = defaultdict(list)
    for one in every:
        if one.oracle_sees is not None:
            rows[one.kind, one.cause].append(one)
            rows[one.kind, f"**all {one.kind}**"].append(one)
    for (_, cause), own in sorted(rows.items(), key=lambda row: (row[0][0], "**" in row[0][1], row[0][1])):
        seen, decided = [o for o in own if o.oracle_sees], [o for o in own if o.decided]
        left = [o for o in own if not o.decided]
        a, b = _taken(seen)
        lines.append(
            f"| {cause} | {len(own)} | {len(seen)} | {sum(bool(o.located) for o in seen)} | "
            f"{-100 * a:+.0f} %, {-100 * b:+.0f} % | {len(decided)} | {sum(bool(o.form_named) for o in decided)} | "
            f"{sum(o.form_said is None for o in left)} of {len(left)} | {sum(n.wrong for o in own for n in o.names)} |"
        )
    return lines


def _others(every: Sequence[Judged]) -> list[str]:
    """Located by how strong it is."""
    out = [one for one in every if one.kind in OUTSIDE and one.oracle_sees]
    edges = (0.0, 5.0, 7.0, 10.0, 15.0, np.inf)
    lines = ["| √λ | the oracle sees | of these located | by one that knows the noise alone | held-out rms, by the oracle |",
             "| --- | --- | --- | --- | --- |"]  # fmt: skip
    for low, high in pairwise(edges):
        own = [one for one in out if low <= one.root_lambda < high]
        a, b = _taken(own)
        lines.append(
            f"| {low:.0f} – {high:.0f} | {len(own)} | {share(o.located for o in own)} | "
            f"{share(o.oracle_finds for o in own if o.oracle_finds is not None)} | {-100 * a:+.0f} %, {-100 * b:+.0f} % |"
        )
    return lines


def _verdicts(every: Sequence[Judged]) -> list[str]:
    said = [*VERDICTS, *sorted({one.verdict for one in every} - set(VERDICTS))]
    lines = ["### Verdicts by cause", "", f"| cause | {' | '.join(said)} |", "| --- |" + " --- |" * len(said)]
    for kind in KINDS:
        own = [one for one in every if one.kind == kind]
        causes = sorted({one.cause for one in own})
        by: list[tuple[str, Callable[[Judged], bool]]] = [(f"**{kind}**", lambda o: True)]
        by += [(cause, lambda o, cause=cause: o.cause == cause) for cause in causes if len(causes) > 1]  # type: ignore[misc]
        for name, chosen in by:
            count = Counter(one.verdict for one in own if chosen(one))
            lines.append(f"| {name} | {' | '.join(str(count[verdict]) for verdict in said)} |")
    return lines


def _nothing(every: Sequence[Judged]) -> list[str]:
    nothing = [one for one in every if one.kind == "nothing"]
    lines = ["### Without a cause", "", "| noise | false alarms | undetermined | a name |", "| --- | --- | --- | --- |"]
    for kind in (*(kind for kind in noises.KINDS if any(one.noise == kind for one in nothing)), None):
        own = [one for one in nothing if kind in (one.noise, None)]
        lines.append(f"| {kind or '**all**'} | {share(o.alarm for o in own)} | "
                     f"{sum(o.verdict == 'undetermined' for o in own)} | {sum(bool(o.names) for o in own)} |")  # fmt: skip
    return lines


def _inside(every: Sequence[Judged]) -> list[str]:
    lines = ["### Effects of the catalogue", "",
             "| hidden | found | the oracle, which estimates the noise | names | of these wrong | members of a class |",
             "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for kind in EFFECTS:
        own = [one for one in every if one.kind == kind and one.found is not None]
        names, sizes = [n for o in own for n in o.names], [m for o in own for m, _ in o.classes]
        lines.append(f"| {kind} | {share(o.found[0] for o in own if o.found)} | {share(o.found[1] for o in own if o.found)} | "
                     f"{len(names)} | {sum(n.wrong for n in names)} | "
                     f"{', '.join(f'{n} × {size}' for size, n in sorted(Counter(sizes).items())) or '–'} |")  # fmt: skip
    return lines


def _tenths(names: Sequence[Name]) -> list[tuple[int, float, int, tuple[float, float], tuple[float, float]]]:
    return second.tenths([name.probability for name in names], [name.right for name in names])


def _said(every: Sequence[Judged]) -> list[str]:
    names = [name for one in every for name in one.names]
    lines = [f"### Said and right: {len(names)} assertions", "", "| | said | right (95 %) | of forms | right |",
             "| --- | --- | --- | --- | --- |"]  # fmt: skip
    forms = {int(row[1] * 10): row for row in _tenths([n for n in names if n.form])}
    for count, mean, right, (low, high), _ in _tenths(names):
        tenth = min(int(mean * 10), 9)
        form = f"{forms[tenth][1]:.2f} | {forms[tenth][2]} of {forms[tenth][0]}" if tenth in forms else "– | –"
        lines.append(
            f"| {tenth / 10:.1f}–{tenth / 10 + 0.1:.1f} | {mean:.3f} | {right} of {count} ({low:.2f}–{high:.2f}) | {form} |"
        )
    return lines
