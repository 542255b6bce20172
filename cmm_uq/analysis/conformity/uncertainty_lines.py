"""Whether each line of the test uncertainty (ISO/TS 23165:2006) and each rated condition is stated, met, or answered for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, say, semicolons
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.circumstances import LINE_KEYS, Circumstances, RatedConditions, TestUncertainty
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.budget import Budget

LENGTH_LINES = ("calibration", "expansion", "temperature", "alignment", "fixturing")  # in the order of their budget
SIZE_LINES, FORM_LINES, REPEAT_LINES = LENGTH_LINES[:3], ("form",), ("repeat",)
WARM = 0.5  # K from 20 °C from which on an unknown expansion matters
# what a line that is not stated may well be: of the temperature, of the coefficient (1/K), of all others
UNSTATED_K, UNSTATED_EXPANSION, UNSTATED_UM = 0.3, 1e-6, 1.0
STEEL, LARGEST_EXPANSION = 11.5e-6, 25e-6  # 1/K; of what gauges are made of, aluminium expands most

_NAMES = {
    "calibration": say("calibration of the artefact"),
    "expansion": say("expansion coefficient of the artefact"),
    "temperature": say("temperature of the artefact"),
    "alignment": say("alignment of the artefact"),
    "fixturing": say("fixturing of the artefact"),
    "form": say("calibration of the form"),
    "repeat": say("what of the artefact changes between the readings"),
}


def uncertainty_conditions(lines: Collection[str], artefact: Artefact, under: Circumstances) -> tuple[Condition, ...]:
    """That each of some lines is stated or declared, and what it is computed from recorded and stated."""
    found = []
    for line in lines:
        if not _met(line, artefact, under):
            key = "u_um in [artefact]" if line == "calibration" else f"{LINE_KEYS[line]} in [test_uncertainty]"
            what = say("uncertainty: {line} is neither stated nor declared negligible", line=_NAMES[line])
            found.append(
                _lacks(what, f'{key}, or {line} = {{ by = "…", reason = "…" }} in [test_uncertainty.negligible]')
            )
    probed = artefact.forms()
    if "form" in lines and (probed is None or probed.certified <= 0):
        what = say("uncertainty: the form deviation of the test sphere is not stated")
        found.append(_lacks(what, "form_um in [artefact]"))
    if "expansion" in lines:
        found += _thermal(artefact, under)
    return tuple(found)


def u_of_unstated(lines: Collection[str], artefact: Artefact, under: Circumstances, length_mm: float) -> float:
    """Standard uncertainty, µm, that lines of a length which are neither stated nor declared may well have.

    It counts before a value is called nonconforming, and for nothing else. The figures are this project's, larger than a
    laboratory that controls its temperature has; an expansion of which no coefficient is stated was not corrected at all.
    """
    away = away_from_20(artefact)
    per_length = {
        "temperature": abs(under.cte_per_k or STEEL) * UNSTATED_K,
        "expansion": away * (UNSTATED_EXPANSION if under.cte_per_k else LARGEST_EXPANSION),
    }
    missing = {line for line in lines if not _met(line, artefact, under)}
    if "expansion" in lines and not under.cte_per_k and not under.uncertainty.declared("expansion"):
        missing.add("expansion")
    each = [per_length[line] * length_mm / MICROMETRE if line in per_length else UNSTATED_UM for line in missing]
    return float(np.linalg.norm(each)) if each else 0.0


def _met(line: str, artefact: Artefact, under: Circumstances) -> bool:
    """Whether a line is stated above zero or declared; of a calibration that of each length, or of the size."""
    stated = under.uncertainty
    if line == "calibration":
        found = artefact.indications()
        u = np.array([artefact.sizes[0].sd]) if found is None else found.u
        return stated.declared(line) is not None or bool(np.all(u > 0))
    if line == "repeat" and _both_lines(under) and _two_readings(1.0, under) > 0:
        return True
    return bool(getattr(stated, LINE_KEYS[line]) or stated.declared(line))


def u_of_repeats(length_mm: float, under: Circumstances) -> float:
    """Of a difference of two readings of one length, µm: ``u_repeat_um`` or temperature and fixturing, the lesser if both."""
    by_lines, direct = _two_readings(length_mm, under), under.uncertainty.u_repeat_um
    if not direct:
        return 0.0 if under.uncertainty.declared("repeat") else by_lines
    return min(direct, by_lines) if by_lines and _both_lines(under) else direct


def _two_readings(length_mm: float, under: Circumstances) -> float:
    stated = under.uncertainty
    warm = length_mm / MICROMETRE * abs(under.cte_per_k or 0.0) * stated.u_temperature_k
    return float(np.sqrt(2.0) * np.hypot(warm, stated.u_fixturing_um))


def _both_lines(under: Circumstances) -> bool:
    """Whether temperature and fixturing say all that changes between readings."""
    stated = under.uncertainty
    known = bool(under.cte_per_k or stated.declared("expansion"))
    warm = bool(stated.declared("temperature")) or (known and stated.u_temperature_k > 0)
    return warm and bool(stated.declared("fixturing") or stated.u_fixturing_um)


def _thermal(artefact: Artefact, under: Circumstances) -> Iterator[Condition]:
    stated = under.uncertainty
    if not under.cte_per_k and not stated.declared("expansion"):
        what = say("uncertainty: the expansion coefficient of the artefact is not stated")
        yield _lacks(what, "cte_per_k in [artefact], or expansion in [test_uncertainty.negligible]")
    elif under.cte_per_k is None and stated.machine.expansion is None and away_from_20(artefact) >= WARM:
        what = say(
            "uncertainty: lengths are not brought to 20 °C, for the expansion coefficient of the artefact is not stated"
        )
        corrected = "expansion in [test_uncertainty.machine] of a machine that corrects it"
        yield _lacks(what, f"cte_per_k in [artefact], or {corrected}")
    if "temp_artefact_c" in artefact.points.columns:
        return
    if stated.machine.temperature is None:
        what = say("uncertainty: the temperature of the artefact during the test was not recorded")
        measured = "temperature in [test_uncertainty.machine] of a machine that measures and corrects it"
        yield _lacks(what, f"column temp_artefact_c, or {measured}")
    elif not stated.declared("expansion"):
        what = say(
            "uncertainty: how far the artefact was from 20 °C, on which that of its expansion coefficient depends"
        )
        declared = "expansion in [test_uncertainty.machine] or [test_uncertainty.negligible]"
        yield _lacks(what, f"column temp_artefact_c, or {declared}")


def away_from_20(artefact: Artefact) -> float:
    """How far the artefact was from 20 °C at most, K; 0 where its temperature was not recorded."""
    recorded = artefact.points.columns.get("temp_artefact_c")
    return 0.0 if recorded is None else float(np.abs(recorded - REFERENCE_TEMPERATURE).max(initial=0.0))


def _lacks(what: Text, remedy: str) -> Condition:
    return Condition(what, (what,), Verbatim(remedy))


def declared_in_words(lines: Collection[str], stated: TestUncertainty) -> list[Text]:
    found: list[Text] = []
    for line in ("temperature", "fixturing", *lines) if lines == REPEAT_LINES else lines:
        negligible, own = (getattr(table, line, None) for table in (stated.negligible, stated.machine))
        if negligible:
            found.append(say("{line:capital}: declared negligible by {by}: {reason}.", line=_NAMES[line],
                             by=Verbatim(negligible.by), reason=Verbatim(negligible.reason.rstrip(". "))))  # fmt: skip
        if own:
            found.append(say("{line:capital}: declared the machine's own by {by}: {reason}.", line=_NAMES[line],
                             by=Verbatim(own.by), reason=Verbatim(own.reason.rstrip(". "))))  # fmt: skip
    return found


def with_declared(budget: Budget, lines: Sequence[str], stated: TestUncertainty) -> Budget:
    """The budget of which each declared line says so: those of a length are its first; a form's own deviation never."""
    own = () if lines == REPEAT_LINES else ("", *lines) if lines == FORM_LINES else lines
    named = list(budget.lines)
    for i, (line, name) in enumerate(zip(budget.lines, own, strict=False)):
        if name and getattr(stated.negligible, name, None):
            named[i] = replace(line, name=say("{line} (declared negligible)", line=line.name))
        elif name and getattr(stated.machine, name, None):
            named[i] = replace(line, name=say("{line} (declared the machine's own)", line=line.name))
    return replace(budget, lines=named)


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
