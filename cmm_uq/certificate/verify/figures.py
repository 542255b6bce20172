"""Whether the figures of a ``results.json`` agree with each other: U with its interval, k with U and u, u with the covariance.

Of a part also shares and margins, and whether they are those of its job and of its machine's certificate. Numbers there have
ten digits, and each rule is kept to what these allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.certificate.verify.given import JOB, Inquiry
from cmm_uq.jobs.part.feature import ASKS
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.verdicts import Verdict, Verdicts

if TYPE_CHECKING:
    from cmm_uq.analysis.parts.plan import Plan
    from cmm_uq.base.points import Floats


QUANTITY = frozenset({"value", "u", "interval95", "U", "k"})  # keys of a quantity
DIGITS = 2e-9  # of numbers of ten digits: what a difference of two of them may be off, of the larger
_ROOT = 1e-8
Wrong = tuple[str, str, object, object]  # key, problem, what stands there, what should


def quantities(data: Any, path: str = "", *, inner: bool = False) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Every quantity of plain data with its path; ``inner`` those within quantities, too."""
    if isinstance(data, Mapping):
        if data.keys() >= QUANTITY:
            yield path, data
            if not inner:
                return
        for key, value in data.items():
            yield from quantities(value, f"{path}.{key}" if path else str(key), inner=inner)
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from quantities(value, f"{path}[{i}]", inner=inner)


def check_figures(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    wrong = partial(inquiry.wrong, "figures", file)
    for path, quantity in quantities(data):
        inquiry.looked("figures")
        try:
            for key, problem, stands, should in _quantity(quantity):
                wrong(f"{path}.{key}", problem, stands, should)
        except (TypeError, ValueError):
            wrong(path, "is no quantity", dict(quantity))
    _check_covariance(inquiry, data, file)
    plain, uncertain = data.get("accuracy") or {}, data.get("accuracy_uncertainty") or {}
    if list(plain) != list(uncertain):
        wrong("accuracy", "names other figures than accuracy_uncertainty", list(plain), list(uncertain))
    for name, value in plain.items():
        inquiry.looked("figures")
        if name in uncertain and uncertain[name]["value"] != value:
            wrong(f"accuracy.{name}", "is not the value in accuracy_uncertainty", value, uncertain[name]["value"])
    _check_tolerances(inquiry, data, file)
    sampling = data.get("sampling") or {}
    for key in ("ess_min", "rhat_max", "draws", "steps"):
        value = sampling.get(key)
        if value is not None and not value > 0:
            wrong(f"sampling.{key}", "is not above zero", value)
    inquiry.looked("figures")


def _not_over_u(k: float | None, expanded: float, u: float) -> Iterator[Wrong]:
    if u > 0 and (k is None or abs(k - expanded / u) > 2 * DIGITS * abs(expanded / u)):
        yield "k", "is not U over u", k, f"{expanded / u:.10g}"


def _quantity(quantity: Mapping[str, Any]) -> Iterator[Wrong]:
    value, u, expanded, factor = quantity["value"], quantity["u"], quantity["U"], quantity["k"]
    if value is None:
        return
    low, high = quantity["interval95"]
    most = max(abs(value), abs(low), abs(high))
    if u < 0:
        yield "u", "is an uncertainty below zero", u, ""
    if not low - DIGITS * most <= value <= high + DIGITS * most:
        yield "interval95", "does not contain the value", quantity["interval95"], value
    should = max(high - value, value - low)
    if abs(expanded - should) > DIGITS * most:
        yield "U", "is not the larger distance from the value to an end of its interval", expanded, f"{should:.10g}"
    yield from _not_over_u(factor, expanded, u)
    if u == 0 and factor is not None:
        yield "k", "is U over u of nothing uncertain", factor, None


def _check_covariance(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Symmetric, with the squares of the standard uncertainties."""
    covariance = data.get("covariance")
    if not covariance:
        return
    wrong = partial(inquiry.wrong, "figures", file)
    names, matrix = covariance["parameters"], covariance["matrix"]
    if len(matrix) != len(names) or any(len(row) != len(names) for row in matrix):
        wrong("covariance.matrix", "has not a row and a column for each parameter")
        return
    raised = bool((data.get("cmc") or {}).get("raised"))
    for i, name in enumerate(names):
        inquiry.looked("figures")
        owner, _, parameter = name.partition(".")
        group = data.get("artefact", {}) if owner == "artefact" else data.get("estimates", {}).get(owner, {})
        quantity = group.get(parameter) if isinstance(group, Mapping) else None
        root = math.sqrt(max(matrix[i][i], 0.0))
        u = quantity.get("u") if isinstance(quantity, Mapping) and not raised else None
        if u is not None and abs(root - u) > _ROOT * max(u, root):
            wrong(f"covariance.matrix[{i}][{i}]", f"is not the square of u of {name}", matrix[i][i], f"{u**2:.10g}")
        for j in range(i):
            place, a, b = f"covariance.matrix[{i}][{j}]", matrix[i][j], matrix[j][i]
            if a != b:
                wrong(place, "is not symmetric", a, b)
            if abs(a) > math.sqrt(max(matrix[i][i] * matrix[j][j], 0.0)) * (1 + _ROOT):
                wrong(place, "is larger than a covariance can be", a)


def _check_tolerances(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """In or out where the whole interval is."""
    for effect, limits in (data.get("tolerances") or {}).items():
        for parameter, tolerance in limits.items():
            quantity = (data.get("estimates", {}).get(effect) or {}).get(parameter)
            if parameter == "verdict" or quantity is None:
                continue
            low, high = quantity["interval95"]
            inside, outside = -tolerance <= low and high <= tolerance, low > tolerance or high < -tolerance
            should = "in" if inside else "out" if outside else "open"
            inquiry.compare("decisions", file, f"tolerances.{effect}.verdict", "does not follow from the interval",
                            limits.get("verdict"), should)  # fmt: skip


def check_verdicts(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """The list of verdicts, where there is one: what standards, tolerances and limits decided, and the gravest of these."""
    if "verdicts" not in data:
        return

    def decision(verdict: Verdict) -> tuple[object, ...]:
        return verdict.called, verdict.outcome, verdict.value, verdict.limit

    stated = Verdicts.of_results(data)
    decided = Verdicts.of_results({key: value for key, value in data.items() if key != "verdicts"})
    inquiry.looked("decisions", 1 + len(stated))
    # a parameter that the recording does not determine stands in this list alone
    left = [each for each in stated if each.by or each.value is not None or each.outcome != "undecided"]
    lacking = all(  # beside what a standard lacks stands the key that would state it
        len(each.missing) == len(should.missing) and all(map(str.startswith, should.missing, each.missing))
        for each, should in zip(left, decided, strict=False)
    )
    stands, wanted = list(map(decision, left)), list(map(decision, decided))
    if stands != wanted or not lacking:
        inquiry.wrong("decisions", file, "verdicts.statements", "are not what was decided", stands, wanted)
    for i, (a, b) in enumerate((each.U, should.U) for each, should in zip(left, decided, strict=False)):
        if a != b and not math.isclose(a or 0.0, b or 0.0, rel_tol=DIGITS):
            inquiry.wrong("figures", file, f"verdicts.statements[{i}].U", "is not that of what was decided", a, b)
    if (overall := data["verdicts"]["overall"]) != stated.overall:
        inquiry.wrong("decisions", file, "verdicts.overall", "is not the gravest", overall, stated.overall)


def is_zone(characteristic: Mapping[str, Any]) -> bool:
    """Whether a characteristic is the width of a zone, which is never negative."""
    return ASKS[characteristic["what"]].limits == "zone"


def check_part_figures(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every figure of a part that another one contradicts."""
    budget = data["budget"]
    causes = [line["cause"] for line in budget["causes"]] + [line["factor"] for line in budget["factors"]]
    for i, each in enumerate(data["characteristics"]):
        inquiry.looked("figures", 6)
        for key, problem, stands, should in _characteristic(each):
            inquiry.wrong("figures", file, f"characteristics[{i}].{key}", problem, stands, should)
        if causes and (worst := each["worst_cause"]) not in causes:
            inquiry.wrong("figures", file, f"characteristics[{i}].worst_cause", "is no line of the budget", worst)
    _check_matrices(inquiry, data, file)
    _check_budget(inquiry, data, file)


def _characteristic(each: Mapping[str, Any]) -> Iterator[Wrong]:
    u, expanded, (low, high) = each["u"], each["U"], each["interval95"]
    value, measured = each["value"], each["measured"]
    median = each.get("value_is") in ("median", "stated")  # before 0.9.0 no value was
    zone, most = is_zone(each), max(abs(low), abs(high), abs(each["mean_error"]), abs(measured or 0.0))
    if u < 0:
        yield "u", "is an uncertainty below zero", u, ""
    if low > high:
        yield "interval95", "ends before it begins", each["interval95"], ""
    yield from _not_over_u(each["k"], expanded, u)
    half = 0.5 * (high - low)
    if not zone and not median and abs(expanded - half) > DIGITS * most:
        yield "U", "is not half of its interval", expanded, f"{half:.10g}"
    if (measured is None) != (value is None):
        yield "value", "is stated of nothing measured, or not of what was", value, measured
    elif value is not None:
        should = measured - each["mean_error"]
        should = max(0.0, should) if zone else should
        if not median and abs(value - should) > DIGITS * most:
            yield "value", "is not what was measured less the mean error", value, f"{should:.10g}"
        if median and value < 0:
            yield "value", "is less than zero", value, "0"
        if (median or not zone) and not low - DIGITS * most <= value <= high + DIGITS * most:
            yield "interval95", "does not contain the value", each["interval95"], value
    yield from _margin(each, most)


def _margin(each: Mapping[str, Any], most: float) -> Iterator[Wrong]:
    """From the value to the nearest limit, in standard uncertainties."""
    decision, limits, u = each["decision"], each["limits"], each["u"]
    if decision is None or limits is None or decision["margin_u"] is None or not u:
        return
    margin, should = decision["margin_u"], min(inside_of(limits, each["value"])) / u
    if abs(margin - should) > 2 * DIGITS * (abs(should) + most / u):
        yield "decision.margin_u", "is not the distance to the nearest limit over u", margin, f"{should:.10g}"


def inside_of(limits: Mapping[str, Any], value: float) -> list[float]:
    """How far a value is inside of each limit that there is, negative where it is outside."""
    ends = ((limits["upper"], -1.0), (limits["lower"], 1.0))
    return [side * (value - end) for end, side in ends if end is not None]


def _check_matrices(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Covariances with the squares of u, symmetric; correlations that are theirs."""
    every, wrong = data["characteristics"], partial(inquiry.wrong, "figures", file)
    names, covariance, correlation = [each["name"] for each in every], data["covariance"], data["correlation"]
    for group, key in ((covariance, "covariance"), (correlation, "correlation")):
        inquiry.looked("figures")
        if group["characteristics"] != names or [len(row) for row in group["matrix"]] != [len(names)] * len(names):
            wrong(f"{key}.matrix", "has not a row and a column for each characteristic")
            return
    if covariance["units"] != [each["unit"] for each in every]:
        wrong("covariance.units", "are not those of the characteristics", covariance["units"])
    for i, each in enumerate(every):
        inquiry.looked("figures", i + 1)
        variance, u = covariance["matrix"][i][i], each["u"]
        if abs(math.sqrt(max(variance, 0.0)) - u) > _ROOT * u:
            problem = f"is not the square of u of {each['name']}"
            wrong(f"covariance.matrix[{i}][{i}]", problem, variance, f"{u**2:.10g}")
        for j in range(i + 1):
            a, b, r = covariance["matrix"][i][j], covariance["matrix"][j][i], correlation["matrix"][i][j]
            size = u * every[j]["u"]
            should = 1.0 if i == j else a / size if size else 0.0
            if abs(a - b) > DIGITS * size or correlation["matrix"][j][i] != r:
                wrong(f"covariance.matrix[{i}][{j}]", "is not symmetric", a, b)
            if abs(r - should) > 10 * DIGITS:
                wrong(f"correlation.matrix[{i}][{j}]", "is not that of the covariances", r, f"{should:.10g}")


def _check_budget(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """A share of each cause and factor for each characteristic; what is not seen stands in a line of it."""
    budget, wrong = data["budget"], partial(inquiry.wrong, "figures", file)
    names = [each["name"] for each in data["characteristics"]]
    stated = budget["characteristics"]
    inquiry.compare("figures", file, "budget.characteristics", "are not those of the part", stated, names)
    rows = [(f"causes[{i}].{key}", line[key]) for i, line in enumerate(budget["causes"]) for key in ("first", "total")]
    rows += [(f"factors[{i}].share", line["share"]) for i, line in enumerate(budget["factors"])]
    for place, shares in rows:
        if len(shares) != len(names):
            wrong(f"budget.{place}", "has not a share for each characteristic", len(shares), len(names))
    for i, line in enumerate(data["unseen"]):
        inquiry.looked("figures")
        if line["characteristic"] not in names or not line["share"] <= 1.0 + 0.05:
            wrong(f"unseen[{i}]", "is no share of a characteristic", line["share"])


_OF_THE_MACHINE = (
    "source", "files", "number", "laboratory", "machine", "serial", "origin", "date", "age_days", "valid_until", "draft",
    "inputs_sha256",
)  # fmt: skip
_OF_FURTHER = ("file", "number", "laboratory", "artefact", "date", "corrected", "origin")
"""Of ``machine``, what its certificate says; what was verified of it depends on the version that did."""

_SAME = 1e-9
_NEAR_MM = 1e-7  # features that are found by going on from a start agree so well on any processor


def check_part_job(
    inquiry: Inquiry, job: PartJob, plan: Plan, measured: Floats | None, data: Mapping[str, Any], file: str
) -> None:
    """Keep what the job says otherwise; ``measured``: (c,) values of the measured points, mm and rad."""
    facts, said, problem = job.facts, data["job"], f"is not what {JOB} says"
    part, decision, prior = data["part"], data["decision"], facts.decision.prior
    stated: list[tuple[str, object, object]] = [
        ("job.id", said["id"], facts.job.id), ("job.number", said.get("number") or "", facts.job.number or ""),
        ("job.origin", said["origin"], facts.job.origin), ("job.date", said["date"], facts.job.date.isoformat()),
        ("part.name", part["name"], facts.part.name), ("part.drawing", part["drawing"] or "", facts.part.drawing),
        ("part.serial", part["serial"] or "", facts.part.serial),
        ("part.not_measured", part["not_measured"], list(facts.part.not_measured)),
        ("decision.rule", decision["rule"], rule_name(facts.decision.rule)),
        ("decision.prior", decision["prior"], prior and prior.model_dump()),
        ("simulation.points", data["simulation"]["points"], len(plan.points)),
        ("characteristics", len(data["characteristics"]), len(facts.characteristic)),
    ]  # fmt: skip
    each = zip(data["characteristics"], facts.characteristic, plan.characteristics, strict=False)
    for i, (one, wish, known) in enumerate(each):
        where, angle = f"characteristics[{i}]", wish.asks.limits == "angles"
        wished = {"name": wish.name, "what": wish.what, "features": list(wish.features), "datums": list(wish.datums),
                  "association": known.association, "unit": "°" if angle else "mm"}  # fmt: skip
        stated += [(f"{where}.{key}", one[key], should) for key, should in wished.items()]
        limits = one["limits"] or {"lower": None, "upper": None}
        value = None if measured is None else float(measured[i])
        for key, stands, should, room, otherwise in (
            ("limits.lower", limits["lower"], known.lower, _SAME, problem),
            ("limits.upper", limits["upper"], known.upper, _SAME, problem),
            ("measured", one["measured"], value, _NEAR_MM, "is not the value of the measured points"),
        ):
            inquiry.looked("inputs")
            inside = None if should is None else math.degrees(should) if angle else should
            near = stands is inside if stands is None or inside is None else (
                abs(stands - inside) <= room * max(1.0, abs(inside)))  # fmt: skip
            if not near:
                inquiry.wrong("inputs", file, f"{where}.{key}", otherwise, stands, f"{inside}")
    for place, at_hand, agreed in stated:
        inquiry.compare("inputs", file, place, problem, at_hand, agreed)


def check_standing(inquiry: Inquiry, should: Mapping[str, Any], data: Mapping[str, Any], file: str) -> None:
    said, problem = data["machine"], "is not what the machine's certificate says"
    for key in _OF_THE_MACHINE:
        inquiry.compare("inputs", file, f"machine.{key}", problem, said[key], should[key])
    more, found = said.get("further", []), should.get("further", [])
    inquiry.compare("inputs", file, "machine.further", "has other certificates than the job", len(more), len(found))
    for i, (one, other) in enumerate(zip(more, found, strict=False)):
        for key in _OF_FURTHER:
            inquiry.compare("inputs", file, f"machine.further[{i}].{key}", problem, one[key], other[key])
    tests, stated = ([one["stated"] for one in each.get("passed", [])] for each in (said, should))
    inquiry.compare("inputs", file, "machine.passed", "are not the tests that the job states", tests, stated)
