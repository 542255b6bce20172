"""What the second study found, as a page: counts with exact binomial intervals, beside what was asked."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.marked import put
from benchmarks.second import judging
from benchmarks.second.cases import EFFECTS, FAULTS, NOTHING
from benchmarks.second.judging import proportion
from benchmarks.second.missed import why
from benchmarks.second.oracle import DRAWS, EXCEED

Records = dict[str, dict[str, Any]]
Pairs = list[tuple[dict[str, Any], dict[str, Any]]]
MISSED = "**not kept**"
BEGIN, END = "<!-- written by benchmarks.second.study -->", "<!-- end of the second -->"
ORACLES = ("estimates", "knows")
LEAST_P = (1 + EXCEED) / (1 + DRAWS)
"""Of an oracle's alarm, by the rank of a recording among draws of noise alone."""

SAID = """\
![False alarms by kind of noise; found by strength; said and right](images/diagnosis-second-study.png)

### What was done

`python -m benchmarks.second.study FOLDER --cases {cases} --nulls {nulls} --seed {seed} --workers N --page docs` makes,
seals and diagnoses the cases, and searches them by two oracles ({hours} of one core; it can be resumed). Generator and
oracles (`benchmarks/second/`) share no code with the package; a test holds their equations to those of the package.

- **Recordings**: 20 × 2 ballbars, a step gauge in seven lines there and back, a plate of sixteen balls in one to three
  ways, a sphere in three places, and the twenty bars of the DEA Iota 1102 where they really stood. Columns (time, sides
  of approach, temperatures, load) are there or not; the noise is stated in half (of these a third wrong by a factor of
  two); rows stand in any order in every second one. In every seventh, and in all of *simulation*, the model is the
  prediction of another program: six factors, or the machine's real error maps at 20, 25 or 30 °C.
- **Noise**, in units of the reading noise:

| noise | what |
| --- | --- |
| white | independent and alike in every coordinate |
| axis | one reads 1.5 to 3.5 times worse |
| set-up | an offset of each point of each set-up of 0.5 to 2 |
| growing | one to three times at the longest distance |
| slow | an Ornstein–Uhlenbeck process of one to four that forgets over a fiftieth to a half of the recording |
| walk | a random walk that ends at one to four |
| tails | t of 3 or 4 degrees of freedom |
| display | steps of 0.8 to 2.5 |
| real | residuals of the real bars (two recordings, 11 µm), dealt to other positions with other signs |

- **Hidden**; √λ is the length of the signal over its noise once all else is projected out:

| hidden | √λ | what |
| --- | --- | --- |
| one, two | 4.5 to 10 | effects |
| real one | 4.5 to 10 | one in the real bars |
| simulation | 4.5 to 10 | an effect beyond a prediction |
| shuffled | 4.5 to 10 | the same rows in two orders |
| unresolved period | | a gauge of twelve equal steps |
| artefact | 6 to 15 | a pattern of its nodes, its own geometry (out of square, stretched, bowed, bent, twisted), its \
temperature, the same or another in every set-up |
| outside | 9 to 15 | functions outside the catalogue; every known effect leaves at least √λ = 4 |
| maps | | the real ones at three temperatures, their own expansion taken off and their differences dealt anew |

- **The oracles** search by likelihood ratios among all effects of the catalogue. One estimates the noise within the same
  kinds (white and one kind besides, of a few sizes, and t); the other knows it exactly (of real noise its size). Each
  draws 199 recordings of noise alone; an alarm is what at most one of them exceeds. Outside the catalogue a third knows
  the form of what is hidden, not its size: what it does not see cannot be seen.
- **Found**: all that is hidden is named, alone or among effects said to be indistinguishable, or a rival that leaves less
  than √λ = 2 of it. **Innocent** is what is named and is neither. **Blamed** for an artefact's fault is an effect of the
  machine with no word of the artefact in its group.
- **Right**: the effect is there; *with its group*, one of its group is. Of an artefact's fault that is the effect of its
  own equation, or one that leaves less than √λ = 2 of it. A pattern, and temperatures that differ between set-ups, are
  two effects where the scale common to all can be seen by itself. Errors of a plate that are the same without noise (out
  of square, or turned row by row) are one statement, with the probability of all explanations that remain with any of
  them."""


def write(truths: list[dict], found: Records, oracles: Records, mark: str, asked: tuple[int, int, int],
          docs: Path | None, note: str = "") -> None:  # fmt: skip
    """Print the page, with what is to be said of the run, and write it with its picture into ``docs`` where that is given."""
    faults = [(t["name"], found[t["name"]]["fault"]) for t in truths if "fault" in found.get(t["name"], {})]
    pairs = [(t, found[t["name"]]) for t in truths if t["name"] in found and "fault" not in found[t["name"]]]
    both = [(t, f, oracles[t["name"]]) for t, f in pairs if "estimates" in oracles.get(t["name"], {})]
    page = [*_state(truths, pairs, faults, mark, asked), *filter(None, [note]), ""]
    for part in (_wanted(pairs, both), _nothing(pairs, oracles), _found(both), _artefact(pairs), _others(pairs, oracles),
                 _said(pairs), _coverage(pairs)):  # fmt: skip
        page += [*part, ""]
    page += [*_times([f["seconds"] for _, f in pairs], [o["seconds"] for *_, o in both], len(truths), asked), ""]
    print("\n".join(page))
    if docs is not None and pairs:
        (docs / "images").mkdir(parents=True, exist_ok=True)
        put(docs / "diagnosis-studies.md", BEGIN, END, "\n".join(page).strip())
        from benchmarks.second.picture import draw

        draw(pairs, both, docs / "images" / "diagnosis-second-study.png")


def _times(ours: list[float], oracles: list[float], count: int, asked: tuple[int, int, int]) -> list[str]:
    """How long it took, and what was done."""
    if not ours:
        return []
    hours = count * (np.mean(ours) + (np.mean(oracles) if oracles else 0)) / 3600
    return [f"A diagnosis took {np.median(ours):.1f} s of processor time (median; mean {np.mean(ours):.1f} s, longest "
            f"{max(ours):.0f} s), both oracles {np.median(oracles) if oracles else 0:.1f} s.",
            "", SAID.format(hours=f"about {hours:.1f} hours", cases=asked[0], nulls=asked[1], seed=asked[2])]  # fmt: skip


def _state(truths: list[dict], pairs: Pairs, faults: list, mark: str, asked: tuple[int, int, int]) -> list[str]:
    hiding = sum(t["kind"] not in NOTHING for t, _ in pairs)
    by = [sum(t["kind"] == kind for t, _ in pairs) for kind in NOTHING]
    lines = [
        f"{len(pairs)} cases were diagnosed of {len(truths)} made with seed {asked[2]}, whose truth was sealed before as "
        f"`{mark[:16]}…`: {hiding} with something hidden (600 are asked for), and of each kind of noise "
        f"{min(by) if min(by) == max(by) else f'{min(by)} to {max(by)}'} without a cause (300 are asked for)."
    ]
    again = sum(bool(f.get("again")) for _, f in pairs)
    if again:
        lines.append(f"Diagnosed again after a refusal had been mended: {again} of them.")
    return lines + ([f"{len(faults)} ended in a refusal or a fault: " + "; ".join(f"{n}: {w}" for n, w in faults[:8]) + "."]
                    if faults else [])  # fmt: skip


def _share(hits: int, count: int) -> str:
    if not count:
        return "–"
    low, high = proportion(hits, count)
    return f"{hits} of {count}: {100 * hits / count:.1f} % ({100 * low:.1f}–{100 * high:.1f})"


def _of(pairs: Sequence[Any], kinds: Sequence[str]) -> list[Any]:
    return [pair for pair in pairs if pair[0]["kind"] in kinds]


def _wanted(pairs: Pairs, both: list) -> list[str]:
    """What was asked, and whether this run shows it."""
    nothing, faults, out = _of(pairs, NOTHING), _of(pairs, FAULTS), _of(pairs, ("outside",))
    alarms = sum(_alarm(f) for _, f in nothing)
    kinds = {kind: (sum(_alarm(f) for _, f in own), len(own)) for kind in NOTHING if (own := _of(pairs, (kind,)))}
    worst = max(kinds, key=lambda kind: proportion(*kinds[kind])[1], default="")
    upper, few = (proportion(*kinds[worst])[1], kinds[worst][1]) if worst else (1.0, 0)
    effects = _of(both, EFFECTS)
    ours, oracle = (sum(judging.hit(t, each(f, o)) for t, f, o in effects) for each in (_ours, _oracle("estimates")))
    said, off = _assertions(pairs)[0], _apart(pairs)
    held = [h for t, f in pairs for _, h in judging.covered(t, f) if t["kind"] != "unresolved period"]
    known, blamed = sum(judging.recognised(f) for _, f in out), sum(bool(judging.machine_blamed(f)) for _, f in faults)
    full = len(nothing) >= 300 * len(NOTHING) and len(pairs) - len(nothing) >= 600
    least = proportion(0, few)[1] if few else 1.0
    rows = [
        ("False alarms, pooled", "≤ 2 %", _share(alarms, len(nothing)), _kept(alarms <= 0.02 * len(nothing), full)),
        ("the same by kind of noise, the worst upper bound", "≤ 4 %",
         f"{100 * upper:.1f} % ({worst.removeprefix('nothing, ')})",
         f"too few: none of {few} has the bound {100 * least:.1f} %" if least > 0.04 else _kept(upper <= 0.04, full)),
        ("Machine physics asserted for an artefact's fault", "≤ 1 %", _share(blamed, len(faults)),
         _kept(blamed <= 0.01 * len(faults), full)),
        ("Found, of what the oracle finds that estimates the noise", "≥ 95 %",
         f"{ours} : {oracle}, {100 * ours / max(oracle, 1):.0f} %", _kept(ours >= 0.95 * oracle, full)),
        ("Said and found probability, every tenth", "in each other's 95 %, of ≥ 500",
         f"{len(off)} tenths apart, of {len(said)} assertions", _kept(not off, len(said) >= 500)),
        ("Intervals that hold the truth", "93–97 %", _share(sum(held), len(held)),
         _kept(_between(sum(held), len(held), full), full)),
        ("Outside the catalogue, recognised", "≥ 95 %", _share(known, len(out)), _kept(known >= 0.95 * len(out), full)),
    ]  # fmt: skip
    missed = [
        f"- {row[0]}: {where}."
        for row, where in zip(rows, why(pairs, both, kinds, off), strict=True)
        if row[3] == MISSED and not row[0].startswith("Said")  # the tenths have a table
    ]
    return ["| | asked | this run (95 % interval) | |", "| --- | --- | --- | --- |",
            *(f"| {a} | {b} | {c} | {d} |" for a, b, c, d in rows),
            *(["", "What is not kept:", "", *missed] if missed else [])]  # fmt: skip


def _alarm(found: dict) -> bool:
    return bool(found["verdict"] != "consistent")


def _agree(row: tuple) -> bool:
    """Whether what was said lies in the interval of what was right, and what was right in that of what was said."""
    count, mean, right, found, expected = row
    return bool(found[0] <= mean <= found[1] and expected[0] <= right / count <= expected[1])


def _between(hits: int, count: int, full: bool) -> bool:
    """Whether 93 to 97 % of intervals hold; of a short run, whether its own interval leaves that open."""
    if not count:
        return False
    low, high = (hits / count, hits / count) if full else proportion(hits, count)
    return low <= 0.97 and high >= 0.93


def _kept(good: object, full: bool) -> str:
    return ("kept" if full else "so far") if good else MISSED


def _ours(found: dict, oracle: dict) -> dict:
    return found


def _oracle(which: str) -> Callable[[dict, dict], dict]:
    return lambda found, oracle: judging.of_oracle(oracle[which])


def _nothing(pairs: Pairs, oracles: Records) -> list[str]:
    lines = ["### Without a cause", "", "| noise | false alarms | an effect named | oracle | oracle that knows the noise |",
             "| --- | --- | --- | --- | --- |"]  # fmt: skip
    for kinds, name in [*(((kind,), kind.removeprefix("nothing, ")) for kind in NOTHING), (NOTHING, "**all**")]:
        own = _of(pairs, kinds)
        alarms, named = sum(_alarm(f) for _, f in own), sum(bool(f["effects"]) for _, f in own)
        searched = [o for t, _ in own if "estimates" in (o := oracles.get(t["name"], {}))]
        cells = [_share(sum(bool(o[which]["effects"]) for o in searched), len(searched)) for which in ORACLES]
        lines.append(f"| {name} | {_share(alarms, len(own))} | {named} | {cells[0]} | {cells[1]} |")
    return lines


def _found(both: list) -> list[str]:
    lines = ["### Effects found", "",
             "| hidden | found | oracle | oracle that knows the noise | only here | only by the oracle | innocent named |",
             "| --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for kinds, name in [
        *(((kind,), kind) for kind in (*EFFECTS, "unresolved period")),
        (EFFECTS, "**all but the last**"),
    ]:
        own = _of(both, kinds)
        hits = [[judging.hit(t, each(f, o)) for t, f, o in own] for each in (_ours, *map(_oracle, ORACLES))]
        only, missed = (sum(x[a] and not x[1 - a] for x in zip(*hits, strict=True)) for a in (0, 1))
        blamed = sum(bool(judging.innocent(t, f)) for t, f, _ in own)
        cells = " | ".join(_share(sum(h), len(own)) for h in hits)
        lines.append(f"| {name} | {cells} | {only} | {missed} | {blamed} |")
    return lines


def _artefact(pairs: Pairs) -> list[str]:
    lines = ["### Faults of the artefact", "",
             "| fault | recording | machine blamed | artefact named | unexplained | not seen |",
             "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    rows: dict[tuple[str, str], list] = defaultdict(list)
    for t, f in _of(pairs, FAULTS):
        rows[t["kind"].removeprefix("artefact, "), t["design"]].append(f)
        rows["**all**", ""].append(f)
    for (kind, what), own in sorted(rows.items(), key=lambda row: (row[0][0] == "**all**", row[0])):
        counts = [sum(map(bool, map(each, own))) for each in
                  (judging.machine_blamed, judging.artefact_named, lambda f: f["verdict"] == "unexplained",
                   lambda f: f["verdict"] == "consistent")]  # fmt: skip
        lines.append(f"| {kind} | {what} | {_share(counts[0], len(own))} | {counts[1]} | {counts[2]} | {counts[3]} |")
    return lines


def _others(pairs: Pairs, oracles: Records) -> list[str]:
    out, shuffled, periods, sets = (
        _of(pairs, (kind,)) for kind in ("outside", "shuffled", "unresolved period", "maps")
    )
    explained = [f for _, f in out if f["verdict"] == "explained"]
    moved = [t["name"] for t, f in shuffled if not judging.same(f)]
    said = [(t, f) for t, f in periods if set(f["effects"]) & set(t["hidden"])]
    held = sum(judging.period_told(t, f) for t, f in said)
    kept_back = sum(bool(set(f.get("withheld", ())) & set(t["hidden"])) for t, f in periods)
    grown = [(t, f) for t, f in sets if t["hidden"]]
    expansions = [h for t, f in grown for _, h in judging.covered(t, f)]
    wrong = sum(bool(judging.innocent(t, f)) for t, f in sets)
    shown = sum(judging.hit(t, f) for t, f in grown)
    return [
        "### Beside these", "",
        f"- Outside the catalogue: {_share(sum(judging.recognised(f) for _, f in out), len(out))} recognised, "
        f"{sum(f['verdict'] == 'consistent' for _, f in out)} not seen, {len(explained)} explained by an innocent effect."
        + _told_the_form(out, oracles),
        f"- The same rows in another order: {len(shuffled) - len(moved)} of {len(shuffled)} times the same verdict, effects, "
        "groups and values" + (f"; not in {', '.join(moved[:12])}." if moved else "."),
        f"- Periods with aliases: named in {len(said)} of {len(periods)}, and withheld as probable but not resolved in "
        f"{kept_back}. Where one is named, its interval or another period that is said to fit is right in "
        f"{_share(held, len(said))}.",
        f"- Real error maps, an expansion of 3 to 15 µm/(m K) concealed: {_share(shown, len(grown))} "
        f"named, intervals hold {_share(sum(expansions), len(expansions))}; in {wrong} of {len(sets)} another one is named.",
    ]  # fmt: skip


def _told_the_form(out: Pairs, oracles: Records) -> str:
    """What an oracle sees of what is outside the catalogue that is told its form; nothing of runs before there was one."""
    told = [(f, form) for t, f in out if (form := oracles.get(t["name"], {}).get("knows_form"))]
    if not told:
        return ""
    seen = [f for f, form in told if form["p"] <= LEAST_P]
    return (
        f" An oracle that is told the form of what is hidden, and estimates its size and the noise, sees {len(seen)} of "
        f"{len(told)}, and names it among the whole catalogue in {sum(form['named'] for _, form in told)}; of those that it "
        f"sees {sum(map(judging.recognised, seen))} are recognised."
    )


def _assertions(pairs: Pairs) -> tuple[list[float], list[float], list[bool], list[bool]]:
    """Every effect that is named: its probability, alone and with its group, and whether it is there, alone and so."""
    rows = [
        (*judging.told(name, t, f), each["together"], judging.there(name, t, judging.group_of(name, f))[1])
        for t, f in pairs for name, each in f["effects"].items()
    ]  # fmt: skip
    alone, right, together, right_together = ([row[i] for row in rows] for i in range(4))
    return alone, together, right, right_together


def _said(pairs: Pairs) -> list[str]:
    count, faulty = len(_assertions(pairs)[0]), len(_assertions(_of(pairs, FAULTS))[0])
    return [f"### Said and right: {count} assertions, {faulty} of them of a faulty artefact", "", *_tenths(pairs)]


def _apart(pairs: Pairs) -> list[tuple]:
    """Tenths in which what was said and what was right do not agree."""
    said, _, right, _ = _assertions(pairs)
    return [row for row in judging.tenths(said, right) if not _agree(row)]


def _tenths(pairs: Pairs) -> list[str]:
    """What was said and what was right, by tenths of said probability."""
    alone, together, right, right_together = _assertions(pairs)
    lines = ["| probability | of the effect: said | right (95 %) | with its group: said | right (95 %) |",
             "| --- | --- | --- | --- | --- |"]  # fmt: skip
    rows = [
        {int(min(row[1] * 10, 9.999)): f"{row[1]:.3f} | {row[2]} of {row[0]} ({row[3][0]:.2f}–{row[3][1]:.2f})"
         for row in judging.tenths(*each)}
        for each in ((alone, right), (together, right_together))
    ]  # fmt: skip
    for tenth in range(10):
        if any(tenth in each for each in rows):
            cells = [each.get(tenth, "– | –") for each in rows]
            lines.append(f"| {tenth / 10:.1f}–{(tenth + 1) / 10:.1f} | " + " | ".join(cells) + " |")
    return lines


def _coverage(pairs: Pairs) -> list[str]:
    hits: dict[str, list[bool]] = defaultdict(list)
    for t, f in pairs:
        for parameter, held in judging.covered(t, f):
            if t["kind"] != "unresolved period":
                hits[parameter].append(held)
    lines = ["### Intervals", "", "| parameter | hold the truth |", "| --- | --- |"]
    return lines + [f"| `{name}` | {_share(sum(held), len(held))} |" for name, held in sorted(hits.items())]
