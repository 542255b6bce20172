"""Whether the ``results.json`` of a part speaks of the job and the machine's certificate that are beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.certificate.part.results import standing_data
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import JOB
from cmm_uq.jobs.part.job import PartJob

if TYPE_CHECKING:
    from cmm_uq.base.points import Floats
    from cmm_uq.certificate.part.measurement import CertificateStatus

_OF_THE_MACHINE = (
    "source", "files", "number", "laboratory", "machine", "serial", "origin", "date", "age_days", "valid_until", "draft",
    "inputs_sha256",
)  # fmt: skip
"""Of ``machine``, what its certificate says; what was verified of it depends on the version that did."""

_SAME = 1e-9
_NEAR_MM = 1e-7
"""Features that are found by going on from a start agree so well on any processor."""

Asked = tuple[str, object, object]


def check_part_job(
    inquiry: Inquiry, job: PartJob, plan: Plan, measured: Floats | None, data: Mapping[str, Any], file: str
) -> None:
    """Keep what the job says otherwise: names, dates, what the drawing asks for, limits, rule, and measured values.

    Parameters
    ----------
    job : of the inputs.
    plan : of the job.
    measured : (c,) values of the measured points, mm and rad; ``None`` where there are none.
    data : of results.json.
    file : its name.
    """
    facts, said = job.facts, data["job"]
    part, decision = data["part"], data["decision"]
    prior = None if facts.decision.prior is None else facts.decision.prior.model_dump()
    asked: list[Asked] = [
        ("job.id", said["id"], facts.job.id), ("job.number", said.get("number") or "", facts.job.number or ""),
        ("job.origin", said["origin"], facts.job.origin), ("job.date", said["date"], facts.job.date.isoformat()),
        ("part.name", part["name"], facts.part.name), ("part.drawing", part["drawing"] or "", facts.part.drawing),
        ("part.serial", part["serial"] or "", facts.part.serial),
        ("part.not_measured", part["not_measured"], list(facts.part.not_measured)),
        ("decision.rule", decision["rule"], rule_name(facts.decision.rule)), ("decision.prior", decision["prior"], prior),
        ("simulation.points", data["simulation"]["points"], len(plan.points)),
        ("characteristics", len(data["characteristics"]), len(facts.characteristic)),
    ]  # fmt: skip
    for i, (one, wish, known) in enumerate(
        zip(data["characteristics"], facts.characteristic, plan.characteristics, strict=False)
    ):
        where = f"characteristics[{i}]"
        angle = wish.asks.limits == "angles"
        asked += [(f"{where}.name", one["name"], wish.name), (f"{where}.what", one["what"], wish.what),
                  (f"{where}.features", one["features"], list(wish.features)),
                  (f"{where}.datums", one["datums"], list(wish.datums)),
                  (f"{where}.association", one["association"], known.association),
                  (f"{where}.unit", one["unit"], "°" if angle else "mm")]  # fmt: skip
        limits = one["limits"] or {"lower": None, "upper": None}
        numbers: list[tuple[str, Any, float | None, float]] = [
            (f"limits.{key}", limits[key], getattr(known, key), _SAME) for key in ("lower", "upper")
        ]
        value = None if measured is None else float(measured[i])
        numbers.append(("measured", one["measured"], value, _NEAR_MM))
        for key, stands, should, room in numbers:
            inquiry.looked("inputs")
            inside = None if should is None else degrees(should) if angle else should
            if not _near(stands, inside, room):
                inquiry.wrong("inputs", file, f"{where}.{key}", _otherwise(key), stands, f"{inside}")
    _compare(inquiry, asked, file, f"is not what {JOB} says")


def check_standing(inquiry: Inquiry, standing: CertificateStatus, data: Mapping[str, Any], file: str) -> None:
    """Keep what the machine's certificate says otherwise.

    Parameters
    ----------
    standing : as the certificate inside has it.
    data : of results.json.
    file : its name.
    """
    should, said = standing_data(standing), data["machine"]
    _compare(inquiry, [(f"machine.{key}", said[key], should[key]) for key in _OF_THE_MACHINE], file,
             "is not what the machine's certificate says")  # fmt: skip


def _compare(inquiry: Inquiry, asked: Sequence[Asked], file: str, problem: str) -> None:
    for place, stands, should in asked:
        inquiry.looked("inputs")
        if stands != should:
            inquiry.wrong("inputs", file, place, problem, stands, should)


def _otherwise(key: str) -> str:
    return "is not the value of the measured points" if key == "measured" else f"is not what {JOB} says"


def _near(a: float | None, b: float | None, room: float) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= room * max(1.0, abs(b))
