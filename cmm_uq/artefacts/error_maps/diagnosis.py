"""The diagnosis of a set of error maps: what changes with temperature, and which maps contradict the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.diagnosis.asserted import OmittedEffect
from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.location import region_of
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.artefacts.error_maps import comparison
from cmm_uq.artefacts.error_maps.columns import MapColumn, columns_of, turned
from cmm_uq.artefacts.error_maps.comparison import CandidateCause, ColumnComparison
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Section, figure_columns, section, table
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.predicted_errors import WHERE, maps_of
from cmm_uq.machine.physics.catalogue import effects as effects_named
from cmm_uq.machine.physics.effects.thermal import THERMAL_SCALE
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.uncertainty.quantity import Quantity

_WELL_KNOWN = 0.95  # probability from which no other explanation is named beside one
_BAND = 2.0  # standard uncertainties of a band that is not to hold zero
_NAMED = 0.05  # probability from which another explanation is named


@dataclass(frozen=True, eq=False)
class Difference:
    column: MapColumn  # the error
    rival: CandidateCause  # the explanation in words, with the map that differs if one does
    probability: float  # of it
    instead: tuple[Text, ...]  # others that could stand in its place
    # numbers of the maps that it, or one of those, has differ from the others, from 0 as their temperatures
    maps: frozenset[int]
    # of the position, mm, where it exceeds half its largest value and its band does not hold zero
    region: tuple[float, float]
    p_value: float  # of "these maps differ by noise alone", corrected for all errors that were compared
    amplitude: float  # largest value, in the column's unit
    # position in mm, difference and its standard uncertainty in the column's unit, each (p,)
    curve: tuple[Floats, Floats, Floats]
    turned: bool  # whether the map would agree if its sign were turned

    @property
    def amplitude_um(self) -> float:
        """Largest value in µm; of a rotation at a lever of one metre."""
        return self.amplitude * self.column.unit[1] / MICROMETRE


@dataclass(frozen=True, eq=False)
class MapsDiagnosis:
    verdict: str  # ``consistent``, ``explained``, ``partial`` or ``unexplained``
    p_value: float  # p_value, alpha: of "the maps differ by noise alone", and the rate of false alarms asked for
    alpha: float
    comparisons: tuple[ColumnComparison, ...]  # every error that was compared
    # what is asserted, most probable first; ``explained`` is the part of how the maps of this error differ
    effects: tuple[OmittedEffect, ...]
    differences: tuple[Difference, ...]  # beyond them, the most significant first
    # displacement, rotation: noise of a reading, µm and ″; ``None`` where no such error was compared
    displacement: Quantity | None
    rotation: Quantity | None
    improvement: Improvement  # parts of the travel predicted from the rest; a rotation counts as µm at one metre

    def p_of(self, compared: ColumnComparison) -> float:
        """Of "these maps differ by noise alone" for one error, corrected for all that were compared."""
        return min(1.0, len(self.comparisons) * compared.p_value)


Modelled = tuple[ColumnComparison, tuple[Version, ...]]  # a column, and what of its comparison is asserted


def diagnose_maps(
    columns: Sequence[MapColumn], named: Sequence[str], *, alpha: float, seed: int, progress: Progress | None = None
) -> MapsDiagnosis:
    modelled, effects, differences, p_values = list[Modelled](), [], [], [1.0]
    for i, column in enumerate(columns):
        compared = comparison.column_comparison(column, named, seed)
        p_value = len(columns) * compared.p_value
        p_values.append(p_value)
        modelled.append((compared, compared.versions if p_value < alpha else ()))
        if p_value < alpha:
            if found := expansion_shown(compared):
                effects.append(found)
            differences += [_difference(compared, index, p_value) for index in compared.unknown]
        if progress:
            progress((i + 1) / len(columns))
    verdict = "consistent" if min(p_values) >= alpha else "unexplained" if not effects else "explained"
    if verdict == "explained" and differences:
        verdict = "partial"
    return MapsDiagnosis(
        verdict, min(p_values), alpha, tuple(compared for compared, _ in modelled),
        tuple(sorted(effects, key=lambda e: -e.probability)), tuple(sorted(differences, key=lambda d: -d.amplitude_um)),
        _noise(modelled, rotations=False), _noise(modelled, rotations=True), _improvement(modelled),
    )  # fmt: skip


def expansion_shown(compared: ColumnComparison) -> OmittedEffect | None:
    """An effect that the maps of a column show: probable, not zero, and better at predicting what was held out."""
    if compared.effect is None:
        return None
    without = [v for v in compared.versions if v.explanation != compared.effect]
    gain = comparison.held_out(compared, compared.versions)[1] - comparison.held_out(compared, without)[1]
    draws = comparison.expansion(compared, compared.effect)
    (effect,) = effects_named((str(compared.rivals[compared.effect].effect),))
    reported = effect.to_reported(draws[:, None], np.zeros((len(draws), 0)))
    units = {parameter.name: parameter.unit for parameter in effect.reported}
    parameters = {name: Quantity.of_draws(values, units[name]) for name, values in reported.items()}
    sure = all(q.interval95[0] > 0 or q.interval95[1] < 0 for q in parameters.values())
    if not sure or gain.sum() <= np.sqrt(len(gain)) * gain.std(ddof=1):
        return None
    whole, rest, left = (
        float(np.sum(comparison.residual(compared, some) ** 2)) for some in ((), without, compared.versions)
    )
    probability = compared.combinations.of(compared.effect)
    return OmittedEffect(
        effect.name, effect.title, probability, parameters, (rest - left) / whole, probability, effect.points_to
    )


def _difference(compared: ColumnComparison, index: int, p_value: float) -> Difference:
    column, rival = compared.column, compared.rivals[index]
    value, u = comparison.function(compared, index)
    unit = column.unit[1]
    probability = compared.combinations.of(index)
    others = compared.instead(_NAMED) if probability < _WELL_KNOWN else ()
    sure = np.abs(value) > _BAND * u
    instead = tuple(compared.rivals[i] for i in others)
    return Difference(
        column, rival, probability, tuple(one.name for one in instead),
        frozenset(one.map for one in (rival, *instead) if one.map is not None),
        region_of(column.positions, value, sure if sure.any() else None), p_value,
        float(np.abs(value).max()) / unit, (column.positions, value / unit, u / unit),
        rival.map is not None and turned(column, rival.map),
    )  # fmt: skip


def _improvement(modelled: Sequence[Modelled]) -> Improvement:
    rms: list[list[Floats]] = [[], [], [], []]
    gains = [np.zeros(0)]
    for compared, versions in modelled:
        early, late = comparison.held_out(compared, ()), comparison.held_out(compared, versions)
        left = (comparison.residual(compared, some) for some in ((), versions))
        for place, values in zip(rms, (*left, early[0], late[0]), strict=True):
            place.append(values)
        gains.append(late[1] - early[1])
    gain = np.concatenate(gains)
    before, after, early_um, late_um = (
        float(np.sqrt(np.mean(np.concatenate(v) ** 2))) / MICROMETRE if v else 0.0 for v in rms
    )
    se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else 0.0
    return Improvement(before, after, early_um, late_um, float(gain.sum()), se, say("parts of the travel"))


def _noise(modelled: Sequence[Modelled], *, rotations: bool) -> Quantity | None:
    """Root mean square, over the columns, of the noise of a reading once everything found is modelled."""
    chosen = [each for each in modelled if (each[0].column.component >= 3) == rotations]
    if not chosen:
        return None
    unit, factor = chosen[0][0].column.unit
    variances, freedoms = np.array([comparison.noise_of(*each) for each in chosen]).T
    value = float(np.sqrt(variances.mean())) / factor
    u = value * float(np.sqrt(np.sum(variances**2 / (2 * freedoms)))) / float(variances.sum())
    return Quantity(value, u, (max(value - 1.96 * u, 0.0), value + 1.96 * u), unit)


@dataclass(frozen=True, eq=False)
class MapsDiagnosed:
    job: Job  # what was read
    maps: tuple[ErrorMap, ...]  # its error maps, in the order in which it names them
    findings: tuple[Finding, ...]  # what is odd among the maps' figures
    diagnosis: MapsDiagnosis  # what changes with temperature, and which maps contradict the others


def diagnose_error_maps(job: Job, *, seed: int, alpha: float, progress: Progress | None = None) -> MapsDiagnosed:
    maps, columns, findings = compared_maps(job)
    findings += squareness_findings(maps)
    found = diagnose_maps(columns, job.facts.model.effects, alpha=alpha, seed=seed, progress=progress)
    return MapsDiagnosed(job, tuple(maps), tuple(findings), found)


def compared_maps(job: Job) -> tuple[tuple[ErrorMap, ...], list[MapColumn], list[Finding]]:
    maps = maps_of(job)
    if len(maps) < 2:
        raise CmmUqError("one error map has nothing to be compared with", where=WHERE,
                         fix="Name two or more maps of the machine; with three it shows which of them differs")  # fmt: skip
    for effect in effects_named(job.facts.model.effects, where="job.toml [model] effects"):
        if effect.columns and not THERMAL_SCALE.has(effect):
            raise CmmUqError(f"{effect.name} needs {', '.join(effect.columns)}, which error maps do not have",
                             where="job.toml [model] effects", fix="Leave it out")  # fmt: skip
    if job.facts.conformity:
        raise CmmUqError("error maps are diagnosed, no standard here decides on them",
                         where="job.toml [[conformity]]", fix="Leave it out")  # fmt: skip
    columns, findings = columns_of(maps)
    if not columns:
        why = "; ".join(finding.why for finding in findings)
        raise CmmUqError(f"the error maps have nothing in common to compare: {why}", where=WHERE,
                         fix="Map the same errors at the same positions each time")  # fmt: skip
    return tuple(maps), columns, findings


def refuse_unfit(job: Job) -> None:
    compared_maps(job)


def squareness_data(maps: Sequence[ErrorMap]) -> list[dict[str, float]]:
    """Of each map for ``results.json``, ″; empty where no map states any."""
    return [{"temperature_c": m.temperature, **m.squareness_arcsec} for m in _stated(maps)]


def squareness_findings(maps: Sequence[ErrorMap]) -> list[Finding]:
    same: dict[tuple[float, ...], list[float]] = {}
    for m in _stated(maps):
        same.setdefault(tuple(m.squareness.tolist()), []).append(m.temperature)
    return [
        Finding("copied", (), (), say(
            "squareness: the maps at {temperatures} °C give the same figures. They were measured once, and say "
            "nothing of how it changes; measure it at each temperature",
            temperatures=commas(number(t, "g") for t in some),
        ))
        for some in same.values() if len(some) > 1
    ]  # fmt: skip


def squareness_sections(maps: Sequence[ErrorMap]) -> tuple[Section, ...]:
    if not (ordered := _stated(maps)):
        return ()
    figures = np.array([m.squareness for m in ordered]) / ARCSECOND
    rows: list[tuple[Text, ...]] = [
        (say("{temperature:g}\u00a0°C", temperature=m.temperature), *(signed(value, ".5g") for value in row))
        for m, row in zip(ordered, figures, strict=True)
    ]
    rows.append((say("Largest less smallest"), *(number(value, ".5g") for value in np.ptp(figures, axis=0))))
    pairs = figure_columns(*(say("{pair} / ″", pair=Verbatim(pair)) for pair in ("XY", "YZ", "ZX")))
    note = say(
        "There is one figure a map, without an uncertainty: whether they differ is not tested. One "
        "arc second moves a point by 2.4 µm over 500 mm."
    )
    return (section(say("Squareness of the axes"), table(say("Squareness"), [say("Map"), *pairs], rows, note)),)


def _stated(maps: Sequence[ErrorMap]) -> list[ErrorMap]:
    """By temperature; none where no map states a squareness."""
    return sorted(maps, key=lambda m: m.temperature) if any(m.squareness.any() for m in maps) else []
