"""results.json: what other programs read of a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.conformity.statement import TOLERANCE_WORDS, Statement
from cmm_uq.analysis.diagnosis.asserted import OmittedEffect
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS, Diagnosis
from cmm_uq.analysis.diagnosis.empirical.model import EmpiricalFunction
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.joint import Mode
from cmm_uq.analysis.diagnosis.power import ALLOWED
from cmm_uq.analysis.diagnosis.simulated import SimulatedTwin
from cmm_uq.analysis.diagnosis.smallest import PLACES, SmallestEffect
from cmm_uq.analysis.planning.set_up import NextPlan
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.diagnosis.empirical import mistakes_data
from cmm_uq.certificate.diagnosis.overview import sentence
from cmm_uq.certificate.origin import attributes, quantity_data, software
from cmm_uq.certificate.result import JobDiagnosis, Result
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.inference.linear_model import LeastSquares
from cmm_uq.maths.uncertainty.budget_results import budget_data
from cmm_uq.maths.uncertainty.quantity import Quantity
from cmm_uq.maths.uncertainty.type_a import Covariance

SCHEMA = "cmm-uq/results/1"


def head(job: Job, schema: str = SCHEMA, *, effects: bool = True) -> dict[str, Any]:
    """What every results.json begins with: the schema, the program, and which job with which inputs of which origin."""
    facts, serial = job.facts.job, job.facts.machine.serial
    there: dict[str, Any] = {
        "serial": serial or None, "derived_from": facts.derived_from and facts.derived_from.model_dump(),
        "replaces": facts.replaces and facts.replaces.model_dump(mode="json", exclude_none=True),
        "altered": list(job.altered) or None, "interim": facts.interim or None,
        "language": facts.language if facts.language != ENGLISH else None,
    }  # fmt: skip
    said = {
        "id": facts.id, "origin": facts.origin, "date": facts.date.isoformat(), "machine": job.facts.machine.name,
        **{key: value for key, value in there.items() if value is not None}, "inputs_sha256": sha256(job.inputs),
    }  # fmt: skip
    return {
        "schema": schema, "software": software(job, effects=effects), "job": said,
        **({"acquisition": job.acquired.data} if job.acquired else {}),
        **({"import": [recognised.data for recognised in job.imported]} if job.imported else {}),
    }  # fmt: skip


def results(result: Result) -> dict[str, Any]:
    """A result as plain data, in the layout of the schema ``cmm-uq/results/1``."""
    posterior, noise = result.posterior, result.noise
    return {
        **head(result.job),
        "estimates": _by_effect(result.parameters),
        "artefact": _quantities(result.sizes),
        "certified": {
            size.name: {"value": size.nominal, "u": size.sd}
            for size in result.artefact.sizes if size.certified and size.role == "dimension"
        },
        "covariance": covariance_data(result.covariance),
        "differences": [
            {"of": ".".join(one.second), "minus": ".".join(one.first), one.second[1]: quantity_data(one.quantity)}
            for combination in result.undetermined for one in result.differences(combination)
        ],
        "tolerances": tolerances_data(result.verdicts),
        "noise": {
            "stated_coordinate_um": noise.stated_um, "coordinate_um": quantity_data(noise.coordinate),
            **{f"{name}_um": {**quantity_data(one.size), "probability": one.probability}
               for name, one in noise.components.items()},
            **({"display_step_um": noise.display_um} if noise.display_um else {}),
            "axes_differ_probability": noise.axes_apart, "p_value": noise.p_value,
            "contradicts_stated": noise.contradicts_stated,
        },
        "sampling": {
            **attributes(posterior, "sampler", "seed"), "draws": len(posterior.draws),
            **attributes(posterior, "ess_min", "rhat_max", "steps", "autocorrelation_time", "converged"),
        },
        "least_squares": _least_squares(result.least_squares),
        **contradictions_data(result),
        "identifiability": _identifiability(result),
        "accuracy": {name: quantity.value for name, quantity in result.accuracy.items()},
        "accuracy_uncertainty": _quantities(result.accuracy),
        "conformity": [statement_data(statement) for statement in result.statements],
        "verdicts": result.verdicts.data(),
        "diagnosis": diagnosis_data(result.diagnosed),
        "screening": [finding_data(finding, result.job.facts.recording.file) for finding in result.findings],
    }  # fmt: skip


def diagnosis_data(found: JobDiagnosis) -> dict[str, Any]:
    d, changes, simulated = found.diagnosis, found.consequences, found.simulated
    return {
        **({} if simulated is None else {
            "simulation": simulated.data(_by_effect(corrections(found, simulated))),
            "simulation_mistakes": mistakes_data(found.mistakes),
        }),
        "verdict": d.verdict, "p_value": d.p_value, **false_alarms(d.alpha),
        "where": [
            {**attributes(place, "covariate", "region", "p_value", "amplitude_um", "what"), "direction": place.along,
             "also": list(place.also)}
            for place in d.where
        ],
        "effects": [effect_data(item, d.improvement) for item in d.effects],
        "withheld": [
            {**attributes(item, "effect", "probability", "why"), "periods_mm": _periods(item.modes)} for item in d.withheld
        ],
        "indistinguishable": [list(group) for group in d.indistinguishable],
        "suggested_measurements": [attributes(s, "separates", "what", "repetitions", "odds") for s in found.suggestions],
        "noise": {
            "stated_coordinate_um": found.job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(d.noise.coordinate), "placing_um": quantity_data(d.noise.placing),
            **attributes(d.noise, "correlated_in_time", "heavy_tails", "contradicts_stated"),
        },
        "screening": [finding_data(f, found.job.facts.recording.file) for f in found.findings],
        "improvement": improvement_data(d.improvement),
        "next_plan": next_data(found.next_plan, found.diagnosis.after.artefact),
        "unseen": unseen_data(found.unseen),
        **_beyond_effects(d),
        "rivals": [{"explanation": name, "probability": p} for name, p in d.rivals],
        **costs_data(found),
        **({"compared_on": d.compared} if d.compared < int(d.before.used.sum()) else {}),
        "corrected": None if changes is None else {
            "accuracy": {name: {"before": quantity_data(a), "after": quantity_data(b)}
                         for name, (a, b) in changes.figures.items()},
            "conformity": [{"before": statement_data(a), "after": statement_data(b)} for a, b in changes.statements],
        },
    }  # fmt: skip


def _beyond_effects(d: Diagnosis) -> dict[str, Any]:
    """What repeats share, the best known effect and the functions that were fitted, each where it is."""
    repeats, best, empirical = d.repeats, d.best_known, d.empirical
    found: dict[str, Any] = {}
    if repeats is not None and repeats.p_value < d.alpha:
        found["repeats"] = asdict(repeats)
    if best is not None:
        gain = {"improvement": improvement_data(best.improvement)}
        found["best_known"] = attributes(best, "effect", "probability", "odds_of_function") | gain
    if empirical is not None:
        gain = improvement_data(empirical.improvement)
        found["empirical"] = {
            "predicts": empirical.predicts,
            **gain,
            "functions": [*map(_function, empirical.functions)],
        }
    return found


def _function(one: EmpiricalFunction) -> dict[str, Any]:
    term, form = one.term, one.form
    return {
        "of": term.of, "along": term.along, "proportional_to": term.lever,
        "scale": term.along is not None and term.along == term.lever, "name": term.title,
        **attributes(one, "probability", "also", "amplitude_um"),
        "forms": [{"form": name, "probability": p} for name, p in one.forms],
        "form": form and attributes(form, "name", "probability") | {"parameters": _quantities(form.parameters)},
        "curve": dict(zip(("at", "error_um", "u_um"), (values.tolist() for values in one.curve), strict=True)),
        "effect": one.stated,
    }  # fmt: skip


def false_alarms(alpha: float) -> dict[str, float]:
    """The rate of false alarms that was asked for, where it is not the usual one: without it nothing can be made again."""
    return {} if alpha == FALSE_ALARMS else {"false_alarms": alpha}


def corrections(found: JobDiagnosis, simulated: SimulatedTwin) -> dict[str, dict[str, Quantity]]:
    """What the effects that were estimated anew differ by from what the simulation contains, by effect and parameter."""
    d, each = found.diagnosis, dict[str, dict[str, Quantity]]()
    for (owner, name), (values, of) in d.after.reported(d.posterior.draws, simulated.refitted).items():
        each.setdefault(owner, {})[name] = Quantity.of_draws(values, of)
    return each


def _periods(modes: Sequence[Mode]) -> list[dict[str, Any]]:
    return [attributes(m.period, "value", "u", "interval95") | {"probability": m.probability} for m in modes]


def next_data(plan: NextPlan | None, artefact: Artefact) -> dict[str, Any] | None:
    if plan is None:
        return None
    shows = []
    for one in plan.shown:
        effect = artefact.acting(every()[one.effect])
        before, after = (
            size * effect.coefficients[0].prior_sd if np.isfinite(size) and size <= ALLOWED else None
            for size in (one.before, one.after)
        )
        shows.append({"effect": one.effect, "parameter": effect.reported[0].name, "detected_before": before,
                      "detected_after": after})  # fmt: skip
    return {
        "repeats": plan.repeats, "reached": plan.reached,
        "set_ups": [
            {"measurement": plan.first + i, "what": placing.title, "ends": placing.ends}
            for i, placing in enumerate(plan.placings)
        ],
        "parts": [{"effects": list(one.effects), "odds_before": one.before, "odds_after": one.after} for one in plan.partings],
        "shows": shows,
    }  # fmt: skip


def costs_data(result: JobDiagnosis) -> dict[str, Any]:
    """What remains, and the average; nothing where one explanation is settled."""
    remaining, costs = result.diagnosis.remaining, result.costs
    if not remaining.rivals:
        return {}
    each = [None] * len(remaining.rivals) if costs is None else costs.each
    whole = {
        "estimates": _by_effect(remaining.averaged),
        "figures": {} if costs is None else _quantities(costs.figures),
        "decisions": [] if costs is None else [dict(one) for one in costs.decisions],
    }
    return {"remaining": [
        {
            "probability": rival.probability, "effects": list(rival.effects), "functions": list(rival.functions),
            "estimates": _by_effect(rival.named), "parameters": _by_effect(rival.added),
            "figures": {} if cost is None else _quantities(cost.figures),
            "decisions": [] if cost is None else [one.outcome for one in cost.statements],
        }
        for rival, cost in zip(remaining.rivals, each, strict=True)
    ], "averaged": whole}  # fmt: skip


def unseen_data(rows: Sequence[SmallestEffect]) -> list[dict[str, Any]]:
    return [
        {
            **attributes(row, "effect", "parameter", "detected", "named", "allowed", "shown", "share"),
            "taken_up_by": [name for name in row.taken_up if name != PLACES],
            **({} if row.periods is None else {"periods": attributes(row.periods, "parameter", "low", "high", "worst") | {
                "unresolved": [list(each) for each in row.periods.unresolved],
            }}),
        }
        for row in rows
    ]  # fmt: skip


def effect_data(item: OmittedEffect, gain: Improvement) -> dict[str, Any]:
    return {
        **attributes(item, "effect", "probability"), "probability_together": item.together,
        **attributes(item, "group", "explained"), "parameters": _quantities(item.parameters),
        **({"other_periods_mm" if item.settled else "periods_mm": _periods(item.modes)} if item.modes else {}),
        **({"alternatives": [attributes(one, *ALTERNATIVE) for one in item.alternatives]} if item.alternatives else {}),
        "words": sentence(item, gain),
    }  # fmt: skip


ALTERNATIVE = ("odds", "prior_odds", "effects", "instead_of", "sizes")  # what is stated of a set of effects instead


def improvement_data(gain: Improvement) -> dict[str, Any]:
    return attributes(gain, "rms_before_um", "rms_after_um", "heldout_rms_before_um", "heldout_rms_after_um", "elpd_gain",
                      "elpd_gain_se")  # fmt: skip


def tolerances_data(verdicts: Verdicts) -> dict[str, Any]:
    """Each parameter that is determined with its tolerance, and whether it is in or out, or neither is proved."""
    judged = ((one.name.partition("."), one) for one in verdicts if not one.by and one.value is not None)
    return {of[0]: {of[2]: one.limit, "verdict": TOLERANCE_WORDS[one.outcome]} for of, one in judged}


def covariance_data(covariance: Covariance) -> dict[str, Any]:
    """How estimates vary together; an element of the matrix is in the product of the units of its row and column."""
    return attributes(covariance, "parameters", "units") | {"matrix": covariance.matrix.tolist()}


def contradictions_data(result: Result) -> dict[str, Any]:
    """Averaged estimates that a line denies, and what it says; nothing where there are none."""
    each = [
        {"parameter": ".".join(one.key), "measurement": one.measurement, "alone": quantity_data(one.alone)}
        for one in result.contradictions
    ]
    return {"contradicted": each} if each else {}


def _quantities(quantities: Mapping[str, Quantity]) -> dict[str, Any]:
    return {name: quantity_data(quantity) for name, quantity in quantities.items()}


def _by_effect(named: Mapping[str, Mapping[str, Quantity]]) -> dict[str, Any]:
    return {effect: _quantities(parameters) for effect, parameters in named.items()}


def _least_squares(ls: LeastSquares) -> dict[str, Any]:
    estimates: dict[str, dict[str, Any]] = {}
    for unknown, known, value, variance in zip(
        ls.unknowns, ls.determined, ls.value, np.diag(ls.covariance), strict=True
    ):
        owner, name = unknown.key
        pair = (float(value), float(np.sqrt(variance))) if known else (None, None)
        estimates.setdefault(owner, {})[name] = dict(zip(("value", "u"), pair, strict=True))
    return {
        "estimates": estimates, "observations": len(ls.residuals), "degrees_of_freedom": ls.degrees_of_freedom,
        "residual_rms_um": None if ls.residual_sd is None else ls.residual_sd / MICROMETRE,
    }  # fmt: skip


def _identifiability(result: Result) -> dict[str, Any]:
    ls = result.least_squares
    free = [{".".join(key): part for key, part in parts.items()} for parts in ls.free]
    denied = (*result.left_to_prior, *(one.key for one in result.contradictions), *result.denied)
    return {
        "parameters": int(ls.rank + ls.null_space.shape[1]),
        "rank": ls.rank,
        "condition_number": ls.condition if np.isfinite(ls.condition) else None,
        "undetermined": free + [{".".join(key): 1.0} for key in denied],
        "prior_share": {".".join(u.key): result.prior_share(u.key) for u in ls.unknowns},
    }


def statement_data(statement: Statement) -> dict[str, Any]:
    return {
        "standard": statement.facts.standard,
        **attributes(statement, "characteristic", "quantity", "value_um", "signed", "limit_um", "u_um"),
        "rule": rule_name(statement.facts.rule),
        "guard_band_um": statement.decision.guard_band, "decision": statement.outcome, "finding": statement.finding,
        "probability_conforming": statement.decision.probability_conforming, "scope": statement.scope,
        "missing": list(statement.missing_with_remedies), "remarks": list(statement.remarks),
        "probability_all_conform": statement.joint,
        "mpe": None if statement.facts.mpe is None else statement.facts.mpe.model_dump(),
        **({} if (angle := statement.facts.angle_arcsec) is None else {"limit_arcsec": angle}),
        "prior": None if statement.facts.prior is None else statement.facts.prior.model_dump(),
        "global_risks": statement.risks and attributes(statement.risks, "consumer", "producer"),
        "test_uncertainty": None if statement.budget is None else budget_data(statement.budget),
        "outside": list(statement.outside),
        "errors": [
            {**attributes(item, "measurement", "repeat", "length_mm", "error_um", "u_um"), "U_um": 2 * item.u_um,
             "limit_um": item.limit_um, **attributes(item.decision, "probability_conforming", "outcome"),
             "guard_band_um": item.decision.guard_band, "position": item.position or None,
             **attributes(item, "standing", "set_aside")}
            for item in statement.errors
        ],
    }  # fmt: skip


def finding_data(finding: Finding, file: str) -> dict[str, Any]:
    return {
        "kind": finding.kind, "rows": [str(m) for m in finding.measurements], "lines": list(finding.lines),
        "file": file, "why": finding.why, "set_aside": finding.set_aside,
    }  # fmt: skip
