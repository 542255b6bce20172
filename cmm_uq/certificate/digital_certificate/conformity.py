"""Statements of conformity in a digital certificate: one word of the schema for each decision, and all that it rests on.

The schema knows pass, fail, conditionalPass, conditionalFail, noPass and noFail. Undecided, incomplete and remeasure are all
three ``noPass``: conformity is not stated. Which of them it is stands in the ``refType`` and in words; a program that knows
nothing but the schema cannot take one for a pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import UNITS
from cmm_uq.certificate.digital_certificate.administration import SayIn, english, one_line, rich_of, words_of
from cmm_uq.certificate.digital_certificate.figures import DigitalFigures, Part
from cmm_uq.certificate.digital_certificate.quantities import ONE, decimal, dsi_of, ratio
from cmm_uq.certificate.wording import stated_row, stated_value
from cmm_uq.jobs.dcc.certificate import Data, DccQuantity, DccResult, QuantityList, StatementMetadata
from cmm_uq.jobs.dcc.quantities import Expanded, ExpandedList, Real, RealList
from cmm_uq.jobs.verdicts import TOLERANCE_RULE, Verdict, Verdicts

IN_THE_SCHEMA: Mapping[str, str] = MappingProxyType({
    "pass": "pass", "fail": "fail", "conditional pass": "conditionalPass", "conditional fail": "conditionalFail",
    "undecided": "noPass", "incomplete": "noPass", "remeasure": "noPass",
})  # fmt: skip
"""By the word of results.json."""

_WHY: Mapping[str, Text] = MappingProxyType({
    "undecided": say("Neither conformity nor nonconformity is proved by the rule, so noPass: conformity is not stated."),
    "incomplete": say(
        "What was measured conforms, but the test lacks what is named as missing, so noPass: conformity is not stated."
    ),
    "remeasure": say(
        "The standard asks for further readings before anything is decided, so noPass: conformity is not stated."
    ),
})  # fmt: skip

_MICROMETRE, _MILLIMETRE = UNITS["µm"].dsi, UNITS["mm"].dsi
_P_TWICE = Decimal("0.9545")
"""Probability of a normal distribution within two standard deviations."""


def of_tolerances(verdicts: Verdicts, say_in: SayIn, *, certifies: bool) -> Mapping[str, StatementMetadata]:
    """Statements on parameters that have a tolerance, by their names (``scale_x.ppm``): each stands with its result."""
    return {one.name: _of_tolerance(one, say_in, certifies=certifies) for one in verdicts if not one.by}


def _of_tolerance(one: Verdict, say_in: SayIn, *, certifies: bool) -> StatementMetadata:
    limit, unit = decimal(one.limit or 0.0), dsi_of(one.unit)
    bounds = ((say("Smallest permissible value"), -limit), (say("Largest permissible value"), limit))
    return StatementMetadata(
        name=words_of(say("Conformity with its tolerance"), say_in),
        description=english([f"Missing: {what}" for what in one.missing]) if one.missing else None,
        references=(TOLERANCE_RULE,),
        declaration=rich_of((Verbatim(one.outcome), *((_WHY[one.outcome],) if one.outcome in _WHY else ())), say_in),
        conformity=IN_THE_SCHEMA[one.outcome] if certifies else None,
        data=Data(parts=tuple(
            DccQuantity(name=words_of(name, say_in), value=Real(value=bound, unit=unit), ref_type=("cmm_toleranceLimit",))
            for name, bound in bounds
        )),
        ref_type=("basic_conformity", f"cmm_{one.outcome.replace(' ', '')}") if certifies else ("cmm_notCertified",),
    )  # fmt: skip


def statements(
    decided: Sequence[Mapping[str, Any]], say_in: SayIn, figures: DigitalFigures, *, certifies: bool
) -> tuple[StatementMetadata, ...]:
    """A statement for each decision of results.json."""
    return tuple(_statement(i, one, say_in, figures, certifies=certifies) for i, one in enumerate(decided))


def _statement(
    i: int, one: Mapping[str, Any], say_in: SayIn, figures: DigitalFigures, *, certifies: bool
) -> StatementMetadata:
    decision, path = one["decision"], ("conformity", str(i))
    standard, characteristic = Verbatim(one["standard"]), Verbatim(one["characteristic"])
    named = say("{standard}, {characteristic}", standard=standard, characteristic=characteristic)
    remarks = [*one["remarks"], *(f"Missing: {what}" for what in one["missing"])]
    # as on the first page: of a size that may be zero its interval, beside which no U is stated
    value = stated_value(one["value_um"], 2 * one["u_um"], signed=one.get("signed", True))
    declared = (
        say("{decision}: {quantity}", decision=Verbatim(decision), quantity=Verbatim(one["quantity"])),
        stated_row(decision, value, UNITS["µm"], one["limit_um"]), *((_WHY[decision],) if decision in _WHY else ()),
    )  # fmt: skip
    return StatementMetadata(
        id=figures.id_of(path),
        name=words_of(named, say_in),
        description=english(remarks) if remarks else None,
        norms=(one_line(one["standard"]),),
        references=(one_line(one["rule"]),),
        declaration=rich_of(declared, say_in),
        conformity=IN_THE_SCHEMA[decision] if certifies else None,
        data=Data(parts=tuple(_figures(path, one, say_in, figures))),
        ref_type=("basic_conformity", f"cmm_{decision.replace(' ', '')}") if certifies else ("cmm_notCertified",),
    )


def _figures(path: tuple[str, ...], one: Mapping[str, Any], say_in: SayIn, figures: DigitalFigures) -> Iterator[Part]:
    """The value with its uncertainty, its limit, the acceptance limit of the rule, and probabilities."""

    def quantity(key: str, name: Text, value: Real, *ref_type: str) -> DccQuantity:
        return DccQuantity(id=figures.id_of((*path, key)), name=words_of(name, say_in), value=value, ref_type=ref_type)

    u, limit, guard = decimal(one["u_um"]), decimal(one["limit_um"]), one["guard_band_um"]
    stated = Expanded(uncertainty=2 * u, factor=Decimal(2), probability=_P_TWICE, distribution="normal")
    value = Real(value=decimal(one["value_um"]), unit=_MICROMETRE, uncertainty=stated if u > 0 else None)
    yield quantity("value_um", say("Value that is least favourable"), value, "basic_measuredValue")
    bound = Real(value=limit, unit=_MICROMETRE)
    yield quantity("limit_um", say("Limit"), bound, "cmm_toleranceLimit")
    if guard is not None:
        band = decimal(guard)
        yield quantity("guard_band_um", say("Guard band"), Real(value=band, unit=_MICROMETRE), "cmm_guardBand")
        accepted = Real(value=max(limit - band, Decimal(0)), unit=_MICROMETRE)
        yield quantity("acceptance_limit_um", say("Acceptance limit"), accepted, "basic_acceptanceLimitUpper")
    for key, name in (
        ("probability_conforming", say("Probability that the value is within its limit")),
        ("probability_all_conform", say("Probability that all values are within their limits")),
    ):
        if one[key] is not None:
            yield quantity(key, name, Real(value=decimal(one[key]), unit=ONE.dsi), "cmm_conformanceProbability")
    yield from _permissible(path, one["mpe"] or {}, say_in, figures)
    for key in ("prior", "global_risks"):
        yield from figures.parts((*path, key), one[key])


def _permissible(
    path: tuple[str, ...], mpe: Mapping[str, Any], say_in: SayIn, figures: DigitalFigures
) -> Iterator[Part]:
    """A, K and B of a maximum permissible error A + L/K, at most B."""
    units = {"a_um": _MICROMETRE, "k": ratio(_MILLIMETRE, _MICROMETRE), "b_um": _MICROMETRE}
    for key, value in mpe.items():
        if value is not None:
            letter = key.partition("_")[0].upper()
            name = say("{letter} of the maximum permissible error A + L/K, at most B", letter=Verbatim(letter))
            yield DccQuantity(
                id=figures.id_of((*path, "mpe", key)), name=words_of(name, say_in), ref_type=("cmm_toleranceLimit",),
                value=Real(value=decimal(value), unit=units[key]),
            )  # fmt: skip


def evidence(
    decided: Sequence[Mapping[str, Any]], say_in: SayIn, figures: DigitalFigures, *, certifies: bool
) -> tuple[DccResult, ...]:
    """Every value that was decided, and the budget of the one that is named."""
    found = []
    for i, one in enumerate(decided):
        path = ("conformity", str(i))
        parts = (*_values(path, one["errors"], say_in, figures, certifies=certifies),
                 *figures.parts((*path, "test_uncertainty"), one["test_uncertainty"]))  # fmt: skip
        if parts:
            name = words_of(say("All values decided by {standard}", standard=Verbatim(one["standard"])), say_in)
            found.append(DccResult(name=name, data=Data(parts=parts), ref_type=("cmm_conformity",)))
    return tuple(found)


def _values(
    path: tuple[str, ...],
    errors: Sequence[Mapping[str, Any]],
    say_in: SayIn,
    figures: DigitalFigures,
    *,
    certifies: bool,
) -> Iterator[Part]:
    if not errors:
        return
    below = (*path, "errors")
    values = tuple(decimal(one["error_um"]) for one in errors)
    uncertainty = ExpandedList(
        uncertainties=tuple(decimal(one["U_um"]) for one in errors), factors=(Decimal(2),), probabilities=(_P_TWICE,),
        distributions=("normal",),
    )  # fmt: skip
    known = all(one["u_um"] > 0 for one in errors)
    column = DccQuantity(
        id=figures.id_of((*below, "error_um")), name=words_of(say("Value"), say_in), ref_type=("basic_measurementError",),
        value=RealList(values=values, units=(_MICROMETRE,), uncertainty=uncertainty if known else None),
    )  # fmt: skip
    others = [{key: value for key, value in one.items() if key not in ("error_um", "u_um", "U_um")} for one in errors]
    rest = [part for table in figures.parts(below, others) if isinstance(table, QuantityList) for part in table.parts]
    words = tuple(IN_THE_SCHEMA[one["outcome"]] for one in errors)
    outcomes = StatementMetadata(conformity_list=words, ref_type=("basic_conformity",)) if certifies else None
    yield QuantityList(
        name=words_of(say("Values in the order of the recording"), say_in), parts=(column, *rest),
        metadata=() if outcomes is None else (outcomes,), ref_type=("cmm_table",),
    )  # fmt: skip
