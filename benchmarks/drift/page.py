"""The page of the study, from its result alone: ``python -m benchmarks.drift.study --page``."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.marked import put

PAGE = Path(__file__).parents[2] / "docs" / "records" / "drift-study.md"
BEGIN, END = (
    "<!-- written by python -m benchmarks.drift.study --page: edit that instead -->",
    "<!-- end of the fleet -->",
)
ASKED_COVERAGE, ASKED_LESS = (0.87, 0.93), 0.30

HOW = """
    {machines} machines by a generator that shares no code with the package (`benchmarks/drift/generator.py`, SHA-256
    `{seal}…`): four models at five places, heavy-tailed rates (Student's t, four degrees of freedom), a random walk
    of its own size each, Laplace-distributed steps, adjustments where a certificate found more than 0.8 of the limit
    or at random, one to ten calibrations about a year apart, ten artefacts with an error each, 1.5 % wrong
    certificates. Only the walk's distribution is that of the model. Generator, cost function and judging were
    committed with their hashes (`benchmarks/drift/seal.json`) before the run; the seed is the first digits of the
    generator's hash. The first day on which the true error is beyond the limit is known for forty years: median
    {median:.1f} years, never for {never:.1f} %.
"""
COVERAGE = """
    Each machine's prior is what all others say; *alone* is the default prior. A day in a part of the distribution
    without a date (already beyond, later than forty years) is placed in it at random; *both ends are dates* has only
    intervals of two dates. *Earlier* and *later*: the day came before or after the interval, 5 % each for a right
    model. ± is 1.96 standard errors.
"""
AFTER_COVERAGE = """
    Rates are estimated to {rate:.2f} a year (root mean square), alone to {rate_alone:.2f}; the limit is 10. True days
    in every twentieth of the predicted distributions: {histogram}. Sampling: {sampling}.
"""
COST = """
    Stated before the run: a calibration costs 1, a day in use beyond the limit 0.05. {machines} machines (models,
    places, rates and walks of the first of those above) live on for {years} years under each rule, with the same
    futures; intervals are from 30 days to five years; beyond 0.8 of the limit a machine is adjusted and certified as
    left. *Reliability* is the part of the calibrations that find the true error within the limit. The drift model
    calibrates when the probability of having crossed reaches 1 − target. The staircase (ILAC-G24's automatic
    adjustment) lengthens the interval after a value within 0.8 of the limit and shortens it after one beyond; it has
    the best of {settings} settings, interpolated to the drift model's reliability. Costs are per machine and year, in
    calibrations.
"""
BEST = """
    At any reliability, the cheapest staircase costs {staircase[cost]:.2f} (reliability {staircase[reliability]:.3f}), the
    cheapest fixed interval {fixed[cost]:.2f} ({fixed[days]} days, {fixed[reliability]:.3f}), the cheapest target of the
    drift model {drift[cost]:.2f} ({drift[reliability]:.3f}): {less:.0f} % less than that staircase, {less_fixed:.0f} %
    less than that fixed interval.
"""
LIMITS = """
    The run is of version {version}, without settling, season and wear that speeds up, and with a prior without a
    fleet that knew of no machine that hardly drifts. No real fleet with a known future was at hand. Rates do not
    change, errors are taken one by one, every adjustment is recorded. The cost function is one of many; a target of
    the drift model is not its reliability, since an error may come back within its limit. Machines of another seed
    were looked at while the model was made: of 400 and 500, 88 and 89 % were held.
"""


def write(result: dict[str, Any]) -> None:
    put(PAGE, BEGIN, END, "\n\n".join(parts(result)))


def parts(result: dict[str, Any]) -> list[str]:
    return [
        told(HOW, machines=result["fleet"]["all"]["machines"], seal=result["seal"]["generator.py"][:16],
             median=result["median_years"], never=100 * result["never"]),
        _asked(result), "### The day of crossing, with a fleet", told(COVERAGE), _coverage(result), _after_coverage(result),
        "### What too early and too late cost", _cost(result["cost"]), _costs(result["cost"]), _best(result["cost"]),
        "### What this does not show", told(LIMITS, version=result["version"]),
    ]  # fmt: skip


def told(text: str, **figures: Any) -> str:
    """One paragraph."""
    return " ".join(text.format(**figures).split())


def table(*rows: tuple[str, ...]) -> str:
    lines = [rows[0], ("---",) * len(rows[0]), *rows[1:]]
    return "\n".join(f"| {' | '.join(row)} |" for row in lines)


def percent(part: float | None, digits: int = 1) -> str:
    return "–" if part is None else f"{100 * part:.{digits}f} %"


def held(of: dict[str, float]) -> str:
    return f"{100 * of['held']:.1f} ± {196 * of['u']:.1f} %"


def _asked(result: dict[str, Any]) -> str:
    of, (low, high) = result["fleet"]["all"], ASKED_COVERAGE
    less = next(row for row in result["cost"]["drift"] if row["target"] == 0.95)["less"]
    verdicts = [low <= of["held"] <= high, less is not None and less >= ASKED_LESS]
    kept, cheap = ("kept" if good else "**not kept**" for good in verdicts)
    return table(
        ("", "asked", "found", ""),
        ("90 % intervals of the day that hold it", f"{100 * low:.0f}–{100 * high:.0f} %", held(of), kept),
        ("Cost less than the best staircase's at equal reliability, target 0.95", f"≥ {100 * ASKED_LESS:.0f} %",
         "no staircase has this reliability" if less is None else percent(less, 0), cheap),
    )  # fmt: skip


def _coverage(result: dict[str, Any]) -> str:
    rows = (
        (
            name,
            str(of["machines"]),
            held(of),
            percent(of["before"]),
            percent(of["after"]),
            held(alone) if alone else "–",
        )
        for name, of in result["fleet"].items()
        for alone in [result["alone"].get(name) if "year" not in name and "dates" not in name else None]
    )
    return table(("machines", "number", "held", "earlier", "later", "alone"), *rows)


def _after_coverage(result: dict[str, Any]) -> str:
    first, *others = result["histogram"]
    return told(
        AFTER_COVERAGE, rate=result["rate_error"]["fleet"], rate_alone=result["rate_error"]["alone"],
        histogram=f"{first}, then {min(others)} to {max(others)}", sampling=result["sampling"],
    )  # fmt: skip


def _cost(cost: dict[str, Any]) -> str:
    return told(COST, machines=cost["machines"], years=cost["years"], settings=len(cost["staircases"]))


def _costs(cost: dict[str, Any]) -> str:
    rows = [
        (f"{row['target']:.2f}", percent(row["reliability"]), f"{row['calibrations']:.2f}", f"{row['days_beyond']:.1f}",
         f"{row['cost']:.2f}", f"{row['staircase'][0]:.2f}" if row["staircase"] else "–", percent(row["less"], 0),
         f"{fixed:.2f}" if fixed else "–", percent(1 - row["cost"] / fixed if fixed else None, 0))
        for row in cost["drift"] for fixed in [_fixed_at(cost["fixed"], row["reliability"])]
    ]  # fmt: skip
    heads = ("target", "reliability", "calibrations a year", "days beyond a year", "cost", "staircase, equal reliability",
             "less", "fixed interval, equal reliability", "less")  # fmt: skip
    same = [(f"{row['days']}", percent(row["reliability"]), f"{row['calibrations']:.2f}", f"{row['days_beyond']:.1f}",
             f"{row['cost']:.2f}") for row in cost["fixed"]]  # fmt: skip
    return "\n\n".join([
        table(heads, *rows),
        table(("fixed interval, days", "reliability", "calibrations a year", "days beyond a year", "cost"), *same),
    ])  # fmt: skip


def _fixed_at(rows: list[dict[str, Any]], wanted: float) -> float | None:
    """Cost of a fixed interval at a reliability, by straight lines between neighbours."""
    for one, other in pairwise(rows):
        if other["reliability"] <= wanted <= one["reliability"]:
            part = (wanted - one["reliability"]) / (other["reliability"] - one["reliability"])
            return float(one["cost"] + part * (other["cost"] - one["cost"]))
    return None


def _best(cost: dict[str, Any]) -> str:
    staircase, fixed, drift = (
        min(cost[name], key=lambda row: row["cost"]) for name in ("staircases", "fixed", "drift")
    )
    return told(BEST, staircase=staircase, fixed=fixed, drift=drift, less=100 * (1 - drift["cost"] / staircase["cost"]),
                less_fixed=100 * (1 - drift["cost"] / fixed["cost"]))  # fmt: skip
