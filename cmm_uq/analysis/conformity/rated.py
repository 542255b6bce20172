"""Rated operating conditions, and measurements that are copies of others."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, say, semicolons
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.circumstances import Circumstances, RatedConditions

SECONDS_PER_HOUR = 3600.0
_ROUNDING, _NAMED = 1e-9, 5  # K; copies that are named one by one


def rated_conditions(circumstances: Circumstances, points: Points) -> tuple[Condition, ...]:
    """Those that the job states; what was not recorded is not shown to be met, and limits hold for stated conditions only."""
    rated, used, found = circumstances.rated, circumstances.probe, []
    if rated.temperature_c is None and rated.declared is None:
        what = say("rated conditions: the temperatures for which the limits hold are not stated")
        remedy = Verbatim('temperature_c in [rated_conditions], or there declared = { by = "…", reason = "…" }')
        found.append(Condition(what, (what,), remedy))
    columns = {k: v for k, v in points.columns.items() if k.startswith("temp_") and k.endswith("_c")}
    if rated.temperature_c is not None:
        found.append(_temperature(columns, *rated.temperature_c))
    if rated.change_k_per_h is not None:
        found.append(_change(columns, points.columns.get("time_s"), rated.change_k_per_h))
    if rated.difference_k is not None:
        found.append(_difference(columns, rated.difference_k))
    for what, wanted, given in ((say("probe"), rated.probe, used.name), (say("stylus"), rated.stylus, used.stylus)):
        if wanted is not None:
            asked = say("rated {what} {wanted}", what=what, wanted=Verbatim(wanted))
            lacks = say("{asked} ({given})", asked=asked, given=Verbatim(given) if given else say("not stated"))
            found.append(Condition(asked, () if wanted == given else (lacks,)))
    return tuple(found)


def rated_in_words(rated: RatedConditions) -> list[Text]:
    """Who answers for rated conditions that are not stated, and why."""
    if rated.declared is None:
        return []
    by, reason = Verbatim(rated.declared.by), Verbatim(rated.declared.reason.rstrip(". "))
    return [say("Rated conditions: declared to be met by {by}: {reason}.", by=by, reason=reason)]


def _temperature(columns: Mapping[str, Floats], low: float, high: float) -> Condition:
    what = say("rated temperature {low:g} to {high:g} °C", low=low, high=high)
    if not columns:
        return Condition(what, (say("{what}: no temperature is recorded (temp_…_c)", what=what),))
    values = np.concatenate(list(columns.values()))
    coldest, warmest = float(values.min()), float(values.max())
    lacks = say("{what} ({coldest:.4g} to {warmest:.4g} °C)", what=what, coldest=coldest, warmest=warmest)
    return Condition(what, () if low <= coldest and warmest <= high else (lacks,))


def _change(columns: Mapping[str, Floats], time_s: Floats | None, most: float) -> Condition:
    what = say("rated change of temperature {most:g} K/h", most=most)
    if not columns or time_s is None:
        key = at_key("temp_…_c, time_s")
        return Condition(what, (say("{what}: no temperature is recorded over time{key}", what=what, key=key),))
    order = np.argsort(time_s, kind="stable")
    time = time_s[order]
    ends = np.searchsorted(time, time + SECONDS_PER_HOUR, side="right")
    largest = max(float(np.ptp(v[order][start:end])) for v in columns.values() for start, end in enumerate(ends))
    lacks = say("{what} ({largest:.3g} K in an hour)", what=what, largest=largest)
    return Condition(what, () if largest <= most + _ROUNDING else (lacks,))


def _difference(columns: Mapping[str, Floats], most: float) -> Condition:
    what = say("rated difference of temperatures {most:g} K", most=most)
    if len(columns) < 2:
        return Condition(what, (say("{what}: one temperature at most is recorded", what=what),))
    largest = float(np.ptp(np.array(list(columns.values())), axis=0).max())
    lacks = say("{what} ({largest:.3g} K)", what=what, largest=largest)
    return Condition(what, () if largest <= most + _ROUNDING else (lacks,))


def copies_in_words(points: Points) -> Text:
    """Which measurements are copies of which; empty when none is."""
    runs = sorted((*points.run_of(original), *points.run_of(later)) for later, original in points.copies.items())
    told = [
        say("measurement {two}, repeat {repeat} of measurement {one}, repeat {first}",
            two=two, repeat=repeat, one=one, first=first)
        for one, first, two, repeat in runs
    ]  # fmt: skip
    if not told:
        return NOTHING
    copies, more = semicolons(told[:_NAMED]), len(told) - _NAMED
    if more <= 0:
        return say("Copies to the last digit, which do not count: {copies}.", copies=copies)
    return say("Copies to the last digit, which do not count: {copies} and {count} more.", copies=copies, count=more)
