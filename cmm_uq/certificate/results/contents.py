"""results.json: what other programs read of a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.conformity.statement import TOLERANCE_WORDS, Statement
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS, OmittedEffect
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.diagnosis.overview import sentence
from cmm_uq.certificate.diagnosis.sections import costs_data, next_data, unseen_data
from cmm_uq.certificate.origin import software
from cmm_uq.certificate.result import JobDiagnosis, Result
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.certificate.sections.findings import corrections, periods_data, withheld_data
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.maths.uncertainty.budget_results import budget_data
from cmm_uq.maths.uncertainty.correlation import Covariance
from cmm_uq.maths.uncertainty.quantity import Quantity

SCHEMA = "cmm-uq/results/1"


def head(job: Job, schema: str = SCHEMA, *, effects: bool = True) -> dict[str, Any]:
    """What every results.json begins with: the schema, the program, and which job with which inputs of which origin."""
    facts = job.facts.job
    derived = facts.derived_from
    return {
        "schema": schema,
        "software": software(job, effects=effects),
        "job": {
            "id": facts.id,
            "origin": facts.origin,
            "date": facts.date.isoformat(),
            "machine": job.facts.machine.name,
            **({"serial": job.facts.machine.serial} if job.facts.machine.serial else {}),
            **({"derived_from": derived.model_dump()} if derived else {}),
            **({"replaces": facts.replaces.model_dump(mode="json", exclude_none=True)} if facts.replaces else {}),
            **({"altered": list(job.altered)} if job.altered else {}),
            **({"language": facts.language} if facts.language != ENGLISH else {}),
            "inputs_sha256": sha256(job.inputs),
        },
        **({"acquisition": job.acquired.data} if job.acquired else {}),
        **({"import": [recognised.data for recognised in job.imported]} if job.imported else {}),
    }


def results(result: Result) -> dict[str, Any]:
    """A result as plain data, in the layout of the schema ``cmm-uq/results/1``."""
    posterior = result.posterior
    return {
        **head(result.job),
        "estimates": {effect: _quantities(values) for effect, values in result.parameters.items()},
        "artefact": _quantities(result.sizes),
        "certified": {
            size.name: {"value": size.nominal, "u": size.sd}
            for size in result.artefact.sizes
            if size.certified and size.role == "dimension"
        },
        "covariance": covariance_data(result.covariance),
        "differences": [
            {"of": ".".join(one.second), "minus": ".".join(one.first), one.second[1]: quantity_data(one.quantity)}
            for combination in result.undetermined
            for one in result.differences(combination)
        ],
        "tolerances": tolerances_data(result.verdicts),
        "noise": {
            "stated_coordinate_um": result.noise.stated_um,
            "coordinate_um": quantity_data(result.noise.coordinate),
            **{
                f"{name}_um": {**quantity_data(one.size), "probability": one.probability}
                for name, one in result.noise.components.items()
            },
            **({"display_step_um": result.noise.display_um} if result.noise.display_um else {}),
            "axes_differ_probability": result.noise.axes_apart,
            "p_value": result.noise.p_value,
            "contradicts_stated": result.noise.contradicts_stated,
        },
        "sampling": {
            "sampler": posterior.sampler, "seed": posterior.seed, "draws": len(posterior.draws),
            "ess_min": posterior.ess_min, "rhat_max": posterior.rhat_max, "steps": posterior.steps,
            "autocorrelation_time": posterior.autocorrelation_time, "converged": posterior.converged,
        },
        "least_squares": _least_squares(result),
        **contradictions_data(result),
        "identifiability": _identifiability(result),
        "accuracy": {name: quantity.value for name, quantity in result.accuracy.items()},
        "accuracy_uncertainty": {name: quantity_data(quantity) for name, quantity in result.accuracy.items()},
        "conformity": [_statement(statement) for statement in result.statements],
        "verdicts": result.verdicts.data(),
        "diagnosis": diagnosis_data(result.diagnosed),
        "screening": [finding_data(finding, result.job.facts.recording.file) for finding in result.findings],
    }  # fmt: skip


def diagnosis_data(found: JobDiagnosis) -> dict[str, Any]:
    """The ``diagnosis`` part."""
    d, changes, simulated = found.diagnosis, found.consequences, found.simulated
    return {
        **({} if simulated is None else {"simulation": simulated.data({
            owner: _quantities(values) for owner, values in corrections(simulated, d.after, d.posterior).items()
        })}),
        "verdict": d.verdict,
        "p_value": d.p_value,
        **false_alarms(d.alpha),
        "where": [
            {"covariate": place.covariate, "region": list(place.region), "p_value": place.p_value,
             "amplitude_um": place.amplitude_um, "what": place.what, "direction": place.along, "also": list(place.also)}
            for place in d.where
        ],
        "effects": [effect_data(item, d.improvement) for item in d.effects],
        "withheld": withheld_data(d.withheld),
        "indistinguishable": [list(group) for group in d.indistinguishable],
        "suggested_measurements": [
            {"separates": list(s.separates), "what": s.what, "repetitions": s.repetitions, "odds": s.odds}
            for s in found.suggestions
        ],
        "noise": {
            "stated_coordinate_um": found.job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(d.noise.coordinate), "placing_um": quantity_data(d.noise.placing),
            "correlated_in_time": d.noise.correlated_in_time, "heavy_tails": d.noise.heavy_tails,
            "contradicts_stated": d.noise.contradicts_stated,
        },
        "screening": [finding_data(f, found.job.facts.recording.file) for f in found.findings],
        "improvement": improvement_data(d.improvement),
        "next_plan": next_data(found.next_plan, found.diagnosis.after.artefact),
        "unseen": unseen_data(found.unseen),
        "rivals": [{"explanation": name, "probability": p} for name, p in d.rivals],
        **costs_data(found),
        **({"compared_on": d.compared} if d.compared < int(d.before.used.sum()) else {}),
        "corrected": None if changes is None else {
            "accuracy": {
                name: {"before": quantity_data(a), "after": quantity_data(b)} for name, (a, b) in changes.figures.items()
            },
            "conformity": [{"before": _statement(a), "after": _statement(b)} for a, b in changes.statements],
        },
    }  # fmt: skip


def false_alarms(alpha: float) -> dict[str, float]:
    """The rate of false alarms that was asked for, where it is not the usual one: without it nothing can be made again."""
    return {} if alpha == FALSE_ALARMS else {"false_alarms": alpha}


def effect_data(item: OmittedEffect, gain: Improvement) -> dict[str, Any]:
    return {
        "effect": item.effect, "probability": item.probability, "probability_together": item.together,
        "group": list(item.group), "explained": item.explained, "parameters": _quantities(item.parameters),
        **({"other_periods_mm" if item.settled else "periods_mm": periods_data(item.modes)} if item.modes else {}),
        "words": sentence(item, gain),
    }  # fmt: skip


def improvement_data(gain: Improvement) -> dict[str, Any]:
    return {
        "rms_before_um": gain.rms_before_um, "rms_after_um": gain.rms_after_um,
        "heldout_rms_before_um": gain.heldout_rms_before_um, "heldout_rms_after_um": gain.heldout_rms_after_um,
        "elpd_gain": gain.elpd_gain, "elpd_gain_se": gain.elpd_gain_se,
    }  # fmt: skip


def tolerances_data(verdicts: Verdicts) -> dict[str, Any]:
    """Each parameter that is determined with its tolerance, and whether it is in or out, or neither is proved."""
    found: dict[str, Any] = {}
    for one in verdicts:
        if not one.by and one.value is not None:
            effect, _, parameter = one.name.partition(".")
            found[effect] = {parameter: one.limit, "verdict": TOLERANCE_WORDS[one.outcome]}
    return found


def covariance_data(covariance: Covariance) -> dict[str, Any]:
    """How estimates vary together; an element of the matrix is in the product of the units of its row and column."""
    return {
        "parameters": list(covariance.parameters), "units": list(covariance.units),
        "matrix": covariance.matrix.tolist(),
    }  # fmt: skip


def contradictions_data(result: Result) -> dict[str, Any]:
    """Averaged estimates that a line denies, and what it says; nothing where there are none."""
    each = [
        {"parameter": ".".join(one.key), "measurement": one.measurement, "alone": quantity_data(one.alone)}
        for one in result.contradictions
    ]
    return {"contradicted": each} if each else {}


def _quantities(quantities: Mapping[str, Quantity]) -> dict[str, Any]:
    return {name: quantity_data(quantity) for name, quantity in quantities.items()}


def _least_squares(result: Result) -> dict[str, Any]:
    ls = result.least_squares
    estimates: dict[str, dict[str, Any]] = {}
    for i, unknown in enumerate(ls.unknowns):
        owner, name = unknown.key
        known = bool(ls.determined[i])
        estimates.setdefault(owner, {})[name] = {
            "value": float(ls.value[i]) if known else None,
            "u": float(np.sqrt(ls.covariance[i, i])) if known else None,
        }
    return {
        "estimates": estimates,
        "observations": len(ls.residuals),
        "degrees_of_freedom": ls.degrees_of_freedom,
        "residual_rms_um": None if ls.residual_sd is None else ls.residual_sd / MICROMETRE,
    }


def _identifiability(result: Result) -> dict[str, Any]:
    ls = result.least_squares
    return {
        "parameters": int(ls.rank + ls.null_space.shape[1]),
        "rank": ls.rank,
        "condition_number": ls.condition if np.isfinite(ls.condition) else None,
        "undetermined": [
            {f"{u.key[0]}.{u.key[1]}": float(part) for u, part in zip(ls.unknowns, column, strict=True) if part}
            for column in ls.null_space.T
        ]
        + [{".".join(one.key): 1.0} for one in result.contradictions],
        "prior_share": {f"{u.key[0]}.{u.key[1]}": result.prior_share(u.key) for u in ls.unknowns},
    }


def _statement(statement: Statement) -> dict[str, Any]:
    return {
        "standard": statement.facts.standard, "characteristic": statement.characteristic,
        "quantity": statement.quantity, "value_um": statement.value_um, "signed": statement.signed,
        "limit_um": statement.limit_um, "u_um": statement.u_um, "rule": rule_name(statement.facts.rule),
        "guard_band_um": statement.decision.guard_band, "decision": statement.outcome, "finding": statement.finding,
        "probability_conforming": statement.decision.probability_conforming, "scope": statement.scope,
        "missing": list(statement.missing_with_remedies), "remarks": list(statement.remarks),
        "probability_all_conform": statement.joint,
        "mpe": None if statement.facts.mpe is None else statement.facts.mpe.model_dump(),
        "prior": None if statement.facts.prior is None else statement.facts.prior.model_dump(),
        "global_risks": None if statement.risks is None else {
            "consumer": statement.risks.consumer, "producer": statement.risks.producer,
        },
        "test_uncertainty": None if statement.budget is None else budget_data(statement.budget),
        "outside": list(statement.outside),
        "errors": [
            {"measurement": item.measurement, "repeat": item.repeat, "length_mm": item.length_mm, "error_um": item.error_um,
             "u_um": item.u_um, "U_um": 2 * item.u_um, "limit_um": item.limit_um,
             "probability_conforming": item.decision.probability_conforming, "outcome": item.decision.outcome,
             "guard_band_um": item.decision.guard_band, "position": item.position or None, "standing": item.standing,
             "set_aside": item.set_aside}
            for item in statement.errors
        ],
    }  # fmt: skip


def finding_data(finding: Finding, file: str) -> dict[str, Any]:
    return {
        "kind": finding.kind, "rows": [str(m) for m in finding.measurements], "lines": list(finding.lines),
        "file": file, "why": finding.why, "set_aside": finding.set_aside,
    }  # fmt: skip
