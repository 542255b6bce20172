"""``results.json`` of a part, schema ``cmm-uq/part/1``, for other programs. Lengths in mm, angles in °, shares from 0 to 1.

What each key of a ``results.json`` of the schema ``cmm-uq/part/1`` is: its unit, and a sentence.

A part in capitals stands for any name, ``[]`` for each entry of a list.
"""

from __future__ import annotations

from math import degrees, isfinite
from typing import Any

from cmm_uq import __version__
from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.certificate.origin import NAME
from cmm_uq.certificate.part.measurement import CertificateStatus, FurtherSetUps, PartMeasurement, UnseenError
from cmm_uq.certificate.part.method import methods_data
from cmm_uq.certificate.sections.priors import families_data, priors_data
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.verdicts import Verdicts

SCHEMA = "cmm-uq/part/1"


def part_results(found: PartMeasurement) -> dict[str, Any]:
    """Contents of ``results.json``."""
    simulated, facts = found.simulated, found.job.facts
    names = [one.name for one in found.characteristics]
    stated = [_characteristic(found, i) for i in range(len(names))]
    return {
        "schema": SCHEMA,
        "software": {"name": NAME, "version": __version__},
        "job": _job(found.job),
        "part": {"name": facts.part.name, "drawing": facts.part.drawing or None, "serial": facts.part.serial or None,
                 "not_measured": list(facts.part.not_measured)},
        "machine": standing_data(found.standing) | {
            "families": families_data(found.given.machine.scales),
            "bounds": [one.model_dump() for one in facts.machine_state.bound],
        },
        "simulation": {
            "virtual_measurements": simulated.trials, "asked": found.asked, "seed": found.seed, "coverage": simulated.coverage,
            "digits": found.digits, "settled": simulated.stable, "first_order": not found.virtual.exact,
            "places": len(found.virtual.places), "points": len(found.plan.points),
            "coefficients": sum(len(cause.factors) for cause in found.virtual.places[0].causes),
            "not_drawn": [{"effect": name, "lacks": column} for name, column in found.virtual.places[0].lacking.items()],
        },
        "characteristics": stated,
        "correlation": {"characteristics": names, "matrix": found.correlation.tolist()},
        "covariance": {"characteristics": names, "units": [unit_of(one) for one in found.characteristics],
                       "matrix": _covariance(found).tolist()},
        "decision": {
            "rule": rule_name(facts.decision.rule), "words": _plain(found.judged_by),
            "prior": None if facts.decision.prior is None else facts.decision.prior.model_dump(),
            "outcome": found.outcome, "probability_all_conform": found.together,
        },
        "verdicts": Verdicts.of_results({"characteristics": stated}).data(),
        "budget": _budget(found),
        "unseen": [_unseen(one) for one in found.unseen],
        "priors": priors_data(found.influence),
        "further": None if found.further is None else _further(found.further),
        "ways": [
            {"way": _plain(way.name), "u": list(map(_in, found.characteristics, way.u.tolist()))} for way in found.ways
        ],
        "other_methods": methods_data(found.methods),
        "warnings": [_plain(text) for text in found.warnings],
    }  # fmt: skip


def unit_of(one: CharacteristicFacts) -> str:
    """Of a characteristic in ``results.json``."""
    return "°" if one.asks.limits == "angles" else "mm"


def standing_data(one: CertificateStatus) -> dict[str, Any]:
    """The machine's certificate."""
    return {
        "source": one.source, "files": list(one.files), "number": one.number or None, "laboratory": one.laboratory or None,
        "machine": one.machine, "serial": one.serial or None, "origin": one.origin, "date": one.date.isoformat(),
        "age_days": one.age.days, "valid_until": None if one.valid_until is None else one.valid_until.isoformat(),
        "verdict": one.verdict,
        "checked": [{"what": each.what, "count": each.count} for each in one.checked if not each.why],
        "not_checked": [{"what": each.what, "why": each.why} for each in one.checked if each.why],
        "computed_again": one.again, "signatures_held_to_trusted": one.trusted, "draft": one.draft,
        "given_recording": one.given_recording, "drawn": _plain(one.path), "drift": _plain(one.drift),
        "changes": None if one.changes is None else [
            {"parameter": name, "change": change} for name, change in one.changes.items()
        ],
        "temperature_c": one.temperature_c, "inputs_sha256": dict(one.inputs_sha256),
    }  # fmt: skip


def _job(job: PartJob) -> dict[str, Any]:
    said = job.facts.job
    return {
        "id": said.id, **({"number": said.number} if said.number else {}), "origin": said.origin,
        "date": said.date.isoformat(),
        **({"language": said.language} if said.language != ENGLISH else {}), "inputs_sha256": sha256(job.inputs),
    }  # fmt: skip


def _characteristic(found: PartMeasurement, i: int) -> dict[str, Any]:
    facts, stated, judged = found.characteristics[i], found.stated[i], found.judged[i]
    low, high = (_in(facts, end) for end in stated.interval)
    return {
        "name": facts.name, "what": facts.what, "features": list(facts.features), "datums": list(facts.datums),
        "association": found.plan.characteristics[i].association, "unit": unit_of(facts),
        "measured": None if found.measured is None else _in(facts, float(found.measured[i])),
        "mean_error": _in(facts, stated.error), "value": None if stated.value is None else _in(facts, stated.value),
        "value_is": "median" if never_negative(found.plan)[i] else "mean",
        "stated_by": "interval" if stated.value is not None and never_negative(found.plan)[i] else "U",
        "u": _in(facts, stated.u), "U": _in(facts, stated.U), "k": stated.k if isfinite(stated.k) else None,
        "interval95": [low, high], "worst_cause": found.budget.worst(facts.name),
        "limits": None if judged is None else _limits(facts, judged),
        "decision": None if judged is None or judged.outcome is None else {
            "outcome": judged.outcome, "probability_conforming": judged.probability, "probability_beyond": judged.beyond,
            "margin_u": float(found.margins[i]) if isfinite(found.margins[i]) else None,
        },
    }  # fmt: skip


def _limits(facts: CharacteristicFacts, judged: LimitDecision) -> dict[str, Any]:
    ends = None if judged.accepted is None else [None if end is None else _in(facts, end) for end in judged.accepted]
    return {
        "lower": None if judged.lower is None else _in(facts, judged.lower),
        "upper": None if judged.upper is None else _in(facts, judged.upper), "accepted": ends,
    }  # fmt: skip


def _budget(found: PartMeasurement) -> dict[str, Any]:
    shares = found.budget
    return {
        "characteristics": list(shares.characteristics),
        "causes": [
            {"cause": name, "first": first, "total": total}
            for name, first, total in zip(shares.causes, shares.first.tolist(), shares.total.tolist(), strict=True)
        ],
        "factors": [
            {"factor": name, "share": share} for name, share in zip(shares.factors, shares.within.tolist(), strict=True)
        ],
    }


def _unseen(one: UnseenError) -> dict[str, Any]:
    return {
        "characteristic": one.characteristic, "effect": one.effect or None, "line": one.line, "title": _plain(one.title),
        "share": one.share, "why": _plain(one.why),
    }  # fmt: skip


def _further(one: FurtherSetUps) -> dict[str, Any]:
    return {
        "effects": list(one.effects), "setups": one.setups, "text": _plain(one.text), "command": one.command or None,
        "file": one.file or None, "missed": list(one.missed),
    }  # fmt: skip


def _covariance(found: PartMeasurement) -> Floats:
    factor = [degrees(1.0) if one.asks.limits == "angles" else 1.0 for one in found.characteristics]
    matrix: Floats = found.simulated.covariance * factor
    return matrix * [[each] for each in factor]


def _in(one: CharacteristicFacts, value: float) -> float:
    """A value of a characteristic in its unit."""
    return degrees(value) if one.asks.limits == "angles" else value


def _plain(text: Text) -> str:
    return str.__str__(text)
