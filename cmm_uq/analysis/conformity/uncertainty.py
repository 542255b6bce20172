"""Test uncertainty: its lines and the rated conditions, stated, met or answered for; its causes, and that all values conform.

Calibration, expansion and temperature of the artefact are shared by all values of a test, alignment and fixturing by those of
one set-up (ISO/TS 23165:2006): the probability that all conform is not the product of their own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
import scipy

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, say, semicolons
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import HOUR, MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.tables.conformity import Circumstances, RatedConditions, TestUncertainty, key_of_line
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.maths.uncertainty.budget import Budget

LENGTH_LINES = ("calibration", "expansion", "temperature", "alignment", "fixturing")  # in the order of their budget
SIZE_LINES, FORM_LINES, REPEAT_LINES = LENGTH_LINES[:3], ("form",), ("repeat",)
WARM = 0.5  # K from 20 °C from which on an unknown expansion matters
# what a line that is not stated may well be: of the temperature, of the coefficient (1/K), of an angle (rad), of all others
UNSTATED_K, UNSTATED_EXPANSION, UNSTATED_RAD, UNSTATED_UM = 0.3, 1e-6, 1e-4, 1.0
# 1/K; a gauge outside is not of normal expansion (ISO 10360-2:2009, as commonly reported)
NORMAL_EXPANSION = 8e-6, 13e-6
STEEL, LARGEST_EXPANSION = 11.5e-6, 25e-6  # 1/K; of what gauges are made of, aluminium expands most

_NAMES = {
    "calibration": say("calibration of the artefact"), "expansion": say("expansion coefficient of the artefact"),
    "temperature": say("temperature of the artefact"), "alignment": say("alignment of the artefact"),
    "fixturing": say("fixturing of the artefact"), "form": say("calibration of the form"),
    "repeat": say("what of the artefact changes between the readings"),
    "orientation": say("angles, with alignment to the base"), "turning": say("what of angles changes between readings"),
}  # fmt: skip


def uncertainty_conditions(lines: Collection[str], artefact: Artefact, under: Circumstances) -> tuple[Condition, ...]:
    """That each of some lines is stated or declared, and what it is computed from recorded and stated."""
    found = []
    for line in _acting(lines, artefact):
        if not _met(line, artefact, under):
            key = "" if line == "calibration" else key_of_line(line, angular=artefact.angular)
            place = f"{key} in [test_uncertainty]" if key else f"{artefact.key_of_u} in [artefact]"
            what = say("uncertainty: {line} is neither stated nor declared negligible", line=_NAMES[line])
            remedy = f'{place}, or {line} = {{ by = "…", reason = "…" }} in [test_uncertainty.negligible]'
            found.append(replace(_lacks(what, remedy), line=_NAMES[line] if key else NOTHING, key=key))
    acts = under.uncertainty.u_temperature_k and not under.uncertainty.declared("temperature")
    if "temperature" in _acting(lines, artefact) and "expansion" not in lines and acts and not under.cte_per_k:
        what = say("uncertainty: that of the temperature is stated, and no expansion coefficient by which it acts")
        found.append(_lacks(what, "cte_per_k in [artefact], or temperature in [test_uncertainty.negligible]"))
    if "form" in lines and artefact.form <= 0:
        ball = say("uncertainty: the form deviation of the test sphere is not stated")
        plane = say("uncertainty: the form deviation of the surface is not stated")
        what = plane if artefact.forms() is None else ball
        found.append(_lacks(what, "form_um in [artefact]"))
    return (*found, *(_thermal(artefact, under) if "expansion" in lines else ()))


def u_of_unstated(lines: Collection[str], artefact: Artefact, under: Circumstances, length_mm: float) -> float:
    """Standard uncertainty, µm, that lines of a length which are neither stated nor declared may well have.

    It counts before a value is called nonconforming, and for nothing else. The figures are this project's, larger than a
    laboratory that controls its temperature has; an expansion of which no coefficient is stated was not corrected at all.
    """
    per_length = dict.fromkeys(("orientation", "turning"), UNSTATED_RAD) | {
        "temperature": abs(under.cte_per_k or STEEL) * UNSTATED_K,
        "expansion": away_from_20(artefact) * (UNSTATED_EXPANSION if under.cte_per_k else LARGEST_EXPANSION),
    }
    missing = {line for line in _acting(lines, artefact) if not _met(line, artefact, under)}
    if "expansion" in lines and not under.cte_per_k and not under.uncertainty.declared("expansion"):
        missing.add("expansion")
    each = [per_length[line] * length_mm / MICROMETRE if line in per_length else UNSTATED_UM for line in missing]
    return float(np.linalg.norm(each)) if each else 0.0


def _acting(lines: Collection[str], artefact: Artefact) -> list[str]:
    return [line for line in lines if not (artefact.angular and line == "temperature")]  # uniform, it changes no angle


def _met(line: str, artefact: Artefact, under: Circumstances) -> bool:
    """Whether a line is stated above zero or declared; of a calibration that of each length, or of each size."""
    stated = under.uncertainty
    if line == "calibration":
        found = artefact.indications()
        u = np.array([size.sd for size in artefact.sizes]) if found is None else found.u
        return stated.declared(line) is not None or bool(np.all(u > 0))
    if line == "repeat" and not artefact.angular and _both_lines(under) and _two_readings(1.0, under) > 0:
        return True
    return bool(getattr(stated, key_of_line(line, angular=artefact.angular)) or stated.declared(line))


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
        other = "temperature in [test_uncertainty.machine] of a machine that measures and corrects it"
    elif not stated.declared("expansion"):
        what = say(
            "uncertainty: how far the artefact was from 20 °C, on which that of its expansion coefficient depends"
        )
        other = "expansion in [test_uncertainty.machine] or [test_uncertainty.negligible]"
    else:
        return
    yield _lacks(what, f"column temp_artefact_c, or {other}")


def away_from_20(artefact: Artefact) -> float:
    """How far the artefact was from 20 °C at most, K; 0 where its temperature was not recorded."""
    recorded = artefact.points.columns.get("temp_artefact_c")
    return 0.0 if recorded is None else float(np.abs(recorded - REFERENCE_TEMPERATURE).max(initial=0.0))


def normal_expansion(cte: float | None) -> tuple[Condition, ...]:
    """A length of normal expansion, where that of the gauge is stated and is another (ISO 10360-2:2009)."""
    low, high = NORMAL_EXPANSION
    if not cte or low <= cte <= high:
        return ()
    what = say(
        "a length of normal expansion, {low:g} to {high:g} × 10⁻⁶ /K (that of the gauge is {cte:.3g} × 10⁻⁶ /K)",
        low=low * 1e6,
        high=high * 1e6,
        cte=cte * 1e6,
    )
    return (Condition(what, (what,)),)


def unknown_expansion(artefact: Artefact, cte_per_k: float | None) -> Text:
    """What a reader must know of lengths measured away from 20 °C on a gauge of unknown expansion; else nothing."""
    away = away_from_20(artefact)
    if cte_per_k or away < WARM:
        return NOTHING
    return say(
        "The artefact was up to {away:.2g} K from 20 °C and its expansion is not stated{key}: its lengths "
        "are taken as those at 20 °C, which for steel is {steel:.2g} µm wrong in a metre.",
        away=away,
        steel=11.5 * away,
        key=at_key("[artefact] cte_per_k"),
    )


def _lacks(what: Text, remedy: str) -> Condition:
    return Condition(what, (what,), Verbatim(remedy))


def declared_in_words(lines: Collection[str], stated: TestUncertainty) -> list[Text]:
    found: list[Text] = []
    for line in ("temperature", "fixturing", *lines) if lines == REPEAT_LINES else lines:
        for table in (stated.negligible, stated.machine):
            if one := getattr(table, line, None):
                name, by, why = _NAMES[line], Verbatim(one.by), Verbatim(one.reason.rstrip(". "))
                negligible = say("{line:capital}: declared negligible by {by}: {reason}.", line=name, by=by, reason=why)
                own = say("{line:capital}: declared the machine's own by {by}: {reason}.", line=name, by=by, reason=why)
                found.append(negligible if table is stated.negligible else own)
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


_ROUNDING, _NAMED = 1e-9, 5  # K; copies that are named one by one


def rated_conditions(circumstances: Circumstances, points: Points) -> tuple[Condition, ...]:
    """Those that the job states; what was not recorded is not shown to be met, and limits hold for stated conditions only."""
    rated, used, found = circumstances.rated, circumstances.probe, []
    if rated.temperature_c is None and rated.declared is None:
        what = say("rated conditions: the temperatures for which the limits hold are not stated")
        remedy = 'temperature_c in [rated_conditions], or there declared = { by = "…", reason = "…" }'
        found.append(_lacks(what, remedy))
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
    ends = np.searchsorted(time, time + HOUR, side="right")
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
    each = [
        say("measurement {two}, repeat {repeat} of measurement {one}, repeat {first}",
            two=two, repeat=repeat, one=one, first=first)
        for one, first, two, repeat in runs
    ]  # fmt: skip
    if not each:
        return NOTHING
    copies, more = semicolons(each[:_NAMED]), len(each) - _NAMED
    if more <= 0:
        return say("Copies to the last digit, which do not count: {copies}.", copies=copies)
    return say("Copies to the last digit, which do not count: {copies} and {count} more.", copies=copies, count=more)


_SETTINGS = 4096  # Of the shared causes, over which is averaged: the joint probability of 105 lengths is good to 0.001
_AT_ONCE = 2_000_000  # Numbers that are held at once


@dataclass(frozen=True, eq=False)
class Causes:
    # (m, s) by how much one standard uncertainty of each cause that all values share changes each value, µm, with sign
    shared: Floats
    own: Floats  # (m,) standard uncertainty that values of one set-up share, µm
    set_up: Ints  # (m,) number of the set-up

    @property
    def u(self) -> Floats:
        """(m,) standard uncertainty of each value, µm."""
        return np.asarray(np.sqrt((self.shared**2).sum(axis=1) + self.own**2), dtype=np.float64)

    def at_least(self, least_um: Floats) -> Causes:
        """The same with u not below some (m,), µm: what these have more is shared by all; where u is 0 it stays so."""
        u = self.u
        more = np.where((u > 0) & (u < least_um), np.sqrt(np.maximum(least_um**2 - u**2, 0.0)), 0.0)
        return Causes(np.column_stack([self.shared, more]), self.own, self.set_up) if more.any() else self

    def of(self, chosen: Ints) -> Causes:
        return Causes(self.shared[chosen], self.own[chosen], self.set_up[chosen])


def temperatures(found: Indications, artefact: Artefact) -> Floats | None:
    """Temperature of the artefact at each length, (m,) °C; ``None`` where it was not recorded."""
    recorded = artefact.points.columns.get("temp_artefact_c")
    return None if recorded is None else np.asarray(recorded[found.rows].mean(axis=1), dtype=np.float64)


def length_budget(
    length_mm: float, u_mm: float, temperature_c: float, circumstances: Circumstances, u_beside_mm: float = 0.0
) -> Budget:
    """Test uncertainty of one length (ISO/TS 23165:2006); ``u_mm`` includes ``u_beside_mm`` of a short gauge beside it."""
    from cmm_uq.maths.uncertainty.budgets.machine import length_test_uncertainty

    stated = circumstances.uncertainty
    return length_test_uncertainty(
        length_mm, float(_own(np.array(u_mm), u_beside_mm)), temperature_c=temperature_c,
        cte_per_k=circumstances.cte_per_k or 0.0, u_cte_per_k=stated.u_cte_per_k, u_temperature_k=stated.u_temperature_k,
        u_alignment_mm=stated.u_alignment_um * MICROMETRE, u_fixturing_mm=stated.u_fixturing_um * MICROMETRE,
        u_beside_mm=u_beside_mm,
    )  # fmt: skip


def causes_of_lengths(found: Indications, artefact: Artefact, circumstances: Circumstances) -> Causes:
    """Of every length of a recording, by the same budget."""
    recorded = temperatures(found, artefact)
    degrees = np.full(len(found.lengths), REFERENCE_TEMPERATURE) if recorded is None else recorded
    beside = np.zeros(len(found.u)) if found.u_beside is None else found.u_beside
    each = np.column_stack([found.lengths, _own(found.u, beside), degrees])
    different, which = np.unique(each, axis=0, return_inverse=True)
    budgets = [length_budget(length, u, t, circumstances).lines for length, u, t in different.tolist()]
    lines = np.array([[line.contribution for line in own] for own in budgets])[which.ravel()] / MICROMETRE
    calibration, expansion, temperature, alignment, fixturing = lines.T
    signed = np.sign(degrees - REFERENCE_TEMPERATURE) * expansion
    further = [] if found.u_beside is None else [beside / MICROMETRE]
    shared = np.column_stack([calibration, signed, temperature, *further])
    return Causes(shared, np.hypot(alignment, fixturing), artefact.points.measurement[found.rows[:, 0]])


def _own(u: Floats, beside: Floats | float) -> Floats:
    return np.asarray(np.where(np.asarray(beside) > 0, np.sqrt(np.maximum(u**2 - np.asarray(beside) ** 2, 0.0)), u))


def probability_of_all(
    values: Sequence[float] | Floats, limits: Sequence[float] | Floats, causes: Causes, *, signed: bool
) -> float | None:
    """Probability that all quantities lie within their limits, given what was measured; ``None`` without an uncertainty.

    Of what is shared the largest cause, or of each set-up its own, is integrated exactly; over the others an even sequence
    of settings is averaged, the same on every run.

    ``values, limits``: (m,) of what was measured, µm.
    """
    if not len(causes.own) or not np.all(causes.u > 0):
        return None
    value, limit = np.asarray(values, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    shared = causes.shared[:, np.any(causes.shared, axis=0)]
    if np.any(causes.own > 0):
        return _averaged(value, limit, shared, causes.own, causes.set_up, signed)
    largest = int(np.argmax((shared**2).sum(axis=0)))
    others, all_alike = np.delete(shared, largest, axis=1), np.zeros(len(value), dtype=np.int64)
    return _averaged(value, limit, others, shared[:, largest], all_alike, signed)


def _averaged(value: Floats, limit: Floats, shared: Floats, slope: Floats, group: Ints, signed: bool) -> float:
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=group[order][0] - 1))
    settings = _normal(_SETTINGS if shared.shape[1] else 1, shared.shape[1])
    total = 0.0
    for block in np.array_split(settings, max(1, len(settings) * len(value) // _AT_ONCE)):
        moved = (value[:, None] + shared @ block.T)[order]
        s, top = slope[order][:, None], limit[order][:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([-top - moved if signed else np.full_like(moved, -np.inf), top - moved]) / s
            lower, upper = np.where(s == 0, -np.inf, ends.min(axis=0)), np.where(s == 0, np.inf, ends.max(axis=0))
        outside = (s == 0) & ((moved > top) | (signed & (moved < -top)))
        most, least = np.minimum.reduceat(upper, starts), np.maximum.reduceat(lower, starts)
        chance = np.maximum(0.0, scipy.special.ndtr(most) - scipy.special.ndtr(least))
        chance = np.where(np.logical_or.reduceat(outside, starts, axis=0), 0.0, chance)
        total += float(chance.prod(axis=0).sum())
    return total / len(settings)


def _normal(count: int, dimensions: int) -> Floats:
    """Normal deviates (count, dimensions) spread evenly: Kronecker's sequence of the generalised golden ratio."""
    ratio = 2.0  # root of x^(d + 1) = x + 1
    for _ in range(40):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1, dimensions + 1)
    return np.asarray(scipy.special.ndtri((0.5 + np.outer(np.arange(1, count + 1), steps)) % 1), dtype=np.float64)
