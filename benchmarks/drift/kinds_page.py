"""The page of the study of five kinds of machines, from its result: ``python -m benchmarks.drift.kinds_study --page``."""

from __future__ import annotations

from typing import Any

from benchmarks.drift.page import ASKED_COVERAGE, PAGE, held, percent, table, told
from benchmarks.marked import put

BEGIN, END = (
    "<!-- written by python -m benchmarks.drift.kinds_study --page: edit that instead -->",
    "<!-- end of kinds -->",
)

HOW = """
    {machines} machines of each of five kinds by a generator that shares no code with the package
    (`benchmarks/drift/kinds.py`, SHA-256 `{seal}…`), with two to ten calibrations, a year or half a year apart, three
    in ten of them always in the same month; otherwise, and sealed (`kinds_seal.json`), as the fleet below. All have a
    rate (Student's t, four degrees of freedom), a random walk, and a step in thirty years; *plain* machines no more.
    *Settling* ones settle by 0.2 to 0.8 of the limit after the first certificate, with decay times from 0.15 to 2
    years; an adjustment does not begin that anew. *Season*: amplitudes from 0.1 to 0.4 of the limit, 15 % more or
    less each year, with a second harmonic. *Wear*: a power from 1.3 to 2.5 of the time since an installation up to
    four years before the first certificate, across the limit in 4 to 15 years. *Step*: one of 0.2 to 0.8 of the limit
    between the first certificate and the last. Season, wear and rates have other forms than in the model.
"""
READ = """
    *With* is the model as `due` and `history` have it without a fleet; *without*, the same without settling, season
    and wear that speeds up. *Earlier* and *later*: the day came before or after the interval, 5 % each for a right
    model. *Never*: not in forty years. *Width*: median width of the 90 % interval, which ends at forty years.
"""
STEPS = """
    Of the first {dated} machines of each kind, the steps named (probability of 50 % and more): their number, the
    number expected by their probabilities, in how many the true size is within ± (k = 2), and how many of the true
    steps of at least 0.4 of the limit, before the last certificate, were named. No second certificate confirms a step
    before the last one; one across an adjustment is not seen.
"""
FLEET = """
    The first {of_fleet} machines of all five kinds as one fleet, each with the prior of all others, without settling,
    season or wear ([a fleet](fleet.md)). Machines at rest after they settled or stepped are predicted to move too
    early, since the fleet's walk, steps and rates include that.
"""
WHY = """
    90 % is what a right prior gives over machines of all kinds, not of one: a kind whose days are much alike (wear
    crosses in 4 to 15 years) is held more often, one that the prior takes for rare less often. Misses are late nearly
    everywhere: many settled machines never cross, and the model, which does not know a rate to better than a fiftieth
    of the limit a year, seldom says never. Priors were chosen on other machines of the same generator ([what else was
    looked at](drift.md#what-is-assumed-where-there-is-no-fleet)).
"""
GROUPS = ("2 or 3 certificates", "4 to 6", "7 and more", "both ends are dates")


def write(result: dict[str, Any]) -> None:
    put(PAGE, BEGIN, END, "\n\n".join(parts(result)))


def parts(result: dict[str, Any]) -> list[str]:
    return [
        told(HOW, machines=result["machines"], seal=result["seal"]["kinds.py"][:16]), _asked(result),
        "### The day of crossing", told(READ), _coverage(result["kinds"]), _by_group(result["kinds"]),
        "### Steps", told(STEPS, dated=result["dated"]), _steps(result["kinds"]),
        "### With a fleet", *_fleet(result), "### Why not 90 % everywhere", told(WHY),
    ]  # fmt: skip


def _asked(result: dict[str, Any]) -> str:
    low, high = ASKED_COVERAGE
    rows = []
    for kind, of in result["kinds"].items():
        found = of["alone"]["groups"]["all"]
        verdict = (
            "kept" if low <= found["held"] <= high else "**not kept**: " + ("more" if found["held"] > high else "fewer")
        )
        rows.append((kind, held(found), held(of["plain"]["groups"]["all"]), verdict))
    asked = f"{100 * low:.0f}–{100 * high:.0f} % asked"
    return table(("90 % intervals of the day that hold it", "with", "without", asked), *rows)


def _coverage(kinds: dict[str, Any]) -> str:
    rows = []
    for kind, of in kinds.items():
        for name, key in (("with", "alone"), ("without", "plain")):
            found = of[key]["groups"]["all"]
            rows.append((kind, name, percent(found["held"]), percent(found["before"]), percent(found["after"]),
                         f"{of[key]['width_years']:.0f}", f"{of['median_years']:.1f}", percent(of["never"], 0)))  # fmt: skip
    heads = ("machines", "", "held", "earlier", "later", "width, years", "median true day, years", "never")
    return table(heads, *rows)


def _by_group(kinds: dict[str, Any]) -> str:
    rows = [(kind, *(held(of["alone"]["groups"][name]) for name in GROUPS)) for kind, of in kinds.items()]
    return table(("with", *GROUPS), *rows)


def _steps(kinds: dict[str, Any]) -> str:
    rows = []
    for kind, of in kinds.items():
        s = of["steps"]
        rows.append((kind, str(s["named"]), str(s["right"]), f"{s['expected']:.0f}", str(s["size_held"]),
                     f"{s['large_found']} of {s['large']}"))  # fmt: skip
    heads = ("machines", "named", "of them true", "expected", "size within ±", "large ones named")
    return table(heads, *rows)


def _fleet(result: dict[str, Any]) -> list[str]:
    if "fleet" not in result:
        return ["Not run."]
    rows = []
    for kind, of in result["fleet"].items():
        found = of["groups"]["all"]
        rows.append((kind, held(found), percent(found["before"]), percent(found["after"])))
    return [told(FLEET, of_fleet=result["of_fleet"]), table(("machines", "held", "earlier", "later"), *rows)]
