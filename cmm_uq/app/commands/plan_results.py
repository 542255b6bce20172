"""The results.json of a plan."""

from __future__ import annotations

from typing import Any

from cmm_uq.app.commands.plan_noise import noise_data, worth_data
from cmm_uq.app.commands.plan_words import combination
from cmm_uq.app.commands.planning import Outlook, Plan
from cmm_uq.certificate.results_file import head

SCHEMA = "cmm-uq/plan/1"


def plan_results(plan: Plan) -> dict[str, Any]:
    """results.json of a plan."""
    better = None if plan.better is None or plan.scores is None else {
        "criterion": plan.setting.plan.criterion, "score_before": plan.scores[0], "score_after": plan.scores[1],
        "kept": plan.kept, "added": len(plan.better.placings) - plan.kept, **_outlook_data(plan.better),
    }  # fmt: skip
    return {
        **head(plan.job, SCHEMA),
        "noise": noise_data(plan),
        "start": {"name": plan.name, "placings": len(plan.start.placings), **_outlook_data(plan.start)},
        "better": better,
        "repeats": worth_data(plan),
        "free": list(plan.free),
        "conditions": [
            {"what": condition.what, "met": condition.met, "missing": list(condition.missing)}
            for condition in plan.conditions
        ],
        "placings": [
            {"measurement": number, "title": placing.title, "minutes": time,
             "middle_mm": placing.middle.tolist(), "points": len(placing.points)}
            for number, (placing, time) in enumerate(zip(plan.to_measure, plan.minutes, strict=True), plan.first)
        ],
        "minutes": sum(plan.minutes),
    }  # fmt: skip


def _outlook_data(outlook: Outlook) -> dict[str, Any]:
    found = outlook.identifiability
    if found is None:
        return {}
    return {
        "determined": [
            {
                "effect": p.unknown.key[0],
                "parameter": p.unknown.key[1],
                "unit": p.unknown.unit,
                "u": p.u,
                "u_with_prior": p.u_with_prior,
                "u_white": p.u_white,
                "status": p.status,
            }
            for p in found.parameters
        ],
        "undetermined": [
            {
                "parameters": {f"{owner}.{name}": part for (owner, name), part in parts.items()},
                "words": combination(parts),
            }
            for parts in found.free
        ],
        "singular_values": found.singular_values.tolist(),
        "indistinguishable": [{"effects": [a, b], "cosine": cosine} for a, b, cosine in found.alike],
        "absorbed": [{"effect": name, "as": list(others)} for name, others in found.absorbed],
        "unseen": list(found.unseen),
        "smallest": [
            {
                "effect": power.effect,
                "parameter": power.parameter,
                "unit": power.unit,
                "detected": power.detectable,
                "named": power.identifiable,
            }
            for power in outlook.powers
        ],
    }
