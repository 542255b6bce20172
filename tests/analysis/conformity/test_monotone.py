"""The law of docs/standards.md: no decision that a larger error, a larger uncertainty or a missing row would improve.

Every test is a complete one of tests/analysis/conformity/by_hand, changed at random; the changed test is decided beside it.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, Phase, assume, example, given, settings, strategies as st

from cmm_uq.analysis.conformity.decision import Outcome, PriorKnowledge, decide
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.conformity import FalseAccept, GuardBand, PosteriorProbability, Rule, UncertaintyRatio
from tests.analysis.conformity.by_hand.deciding import decided
from tests.analysis.conformity.by_hand.tables import Case, Right, job_of

FEW = settings(
    max_examples=40, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.generate, Phase.shrink],
)  # fmt: skip
MANY = settings(max_examples=400, deadline=None, derandomize=True, database=None)

ORDER = ("fail", "conditional fail", "remeasure", "undecided", "conditional pass", "pass")

RULES = (
    '"simple"', '"ISO 14253-1"', '"ASME B89.7.3.1"', '"ILAC-G8 binary"', '"ILAC-G8 non-binary"', "{ guard_band = 1.0 }",
    "{ max_false_accept = 0.02 }", "{ uncertainty_ratio = 3 }",
)  # fmt: skip
"""Without a prior."""

VDI = 'conformity.standard = "VDI/VDE 2617-2.1"; conformity.characteristic = '
B89 = 'conformity.standard = "ASME B89.4.1-1997"; conformity.characteristic = '
TIP = "column tip_x_mm 150 tip_y_mm 0 tip_z_mm -100"
BASES: tuple[tuple[str, str, str, str, str], ...] = (
    ("step gauge, seven lines", "lengths", "", "", "1/300"),
    ("step gauge, seven lines", "lengths", "", 'conformity.standard = "ASME B89.4.10360.2-2008"', "6/180/2"),
    ("step gauge, seven lines", "lengths", "", 'conformity.standard = "VDI/VDE 2617"', "3/20/1"),
    ("step gauge, seven lines", "ranges", "", "", "2/440/3"),
    ("step gauge, diagonals of Y-Z", "lengths", TIP, 'conformity.characteristic = "E150"', "1/260"),
    ("step gauge, space diagonals", "lengths", "", f'{VDI}"U3"', "4/300/1"),
    ("step gauge, axes", "lengths", "", f'{VDI}"U1"', "2/260"),
    ("step gauge, face diagonals", "lengths", "", f'{VDI}"U2"', "5/260"),
    ("gauge blocks, seven lines", "lengths", "", 'artefact.kind = "gauge_blocks"', "1/300/2"),
    ("step gauge, axes, ten lengths", "lengths", "", f'{B89}"linear displacement accuracy"', "3/340"),
    ("gauge block, four orientations", "lengths", "", f'artefact.kind = "gauge_blocks"; {B89}"bidirectional length"', "2/20"),
    ("plate along the axes", "lengths", "", f'artefact.kind = "plate"; {B89}"linear displacement accuracy"', "1/10"),
    ("ballbar, twenty places", "bars", "", "", "5"),
    ("ballbar, tips to both sides", "offset", "", "", "2/1"),
    ("sphere", "spheres", "", "", "1/form"),
    ("sphere", "spheres", "", 'conformity.characteristic = "P_Size"', "1/size"),
    ("sphere", "spheres", "", 'conformity.standard = "ISO 10360-5:2010"; conformity.characteristic = "P_STU"', "1/size"),
    ("sphere", "spheres", "", 'conformity.standard = "ISO 10360-8:2013"; probe.sensing = "optical"', "1/form"),
    ("sphere", "fixed", "repeats 10", "", "1/y/4"),
)  # fmt: skip
"""Recording, job and their changes, and what is put in error: one of every kind, standard and characteristic."""

INPUTS = {
    "expansion": ("u_cte_per_k", 1e-6), "temperature": ("u_temperature_k", 0.2), "alignment": ("u_alignment_um", 0.5),
    "fixturing": ("u_fixturing_um", 0.5), "repeat": ("u_repeat_um", 0.5), "form": ("u_form_um", 0.5),
}  # fmt: skip
"""Key of each line of the test uncertainty, and a figure that matters beside a limit of 5 µm."""

tests = st.sampled_from(BASES)
rules = st.sampled_from(RULES)
errors = st.sampled_from([0.5, 1.9, 3.0, 4.2, 4.68, 4.9, 5.1, 5.33, 5.5, 8.0, 12.0])
gross = st.sampled_from([30.0, 400.0, 700.0, 2500.0, 9000.0])
signs = st.sampled_from(["", "−"])


def changed(base: tuple[str, str, str, str, str], error: str, rule: str, more: str = "", job: str = "") -> Case:
    """A complete test with an error, by a rule."""
    recording, table, common, changes, where = base
    both = "; ".join(filter(None, (changes, f"conformity.rule = {rule}", job)))
    return Case("", (recording, table), "; ".join(filter(None, (common, f"{error} at {where}", more))), both,
                Right("", ()), (), "")  # fmt: skip


def outcome(case: Case) -> tuple[str, str, set[str]]:
    """Finding, outcome, and what is missing; a test of which nothing is stated is ``refused``."""
    try:
        found = decided(case.files())
    except CmmUqError:
        return "refused", "refused", set()
    return found.finding, found.outcome, {str(text) for text in found.missing}


@given(base=tests, rule=rules, sign=signs, small=errors, large=errors | gross)
@FEW
def test_a_larger_error_never_improves_the_finding(
    base: tuple[str, str, str, str, str], rule: str, sign: str, small: float, large: float
) -> None:
    """(a) Of one value, or of all repeats of it; of nothing is stated where too much of a recording is damaged."""
    assume(small < large)
    before, *_ = outcome(changed(base, f"{sign}{small}", rule))
    after, *_ = outcome(changed(base, f"{sign}{large}", rule))
    assert after == "refused" or ORDER.index(after) <= ORDER.index(before)


def stating(base: tuple[str, str, str, str, str], line: str, value: float | None) -> str:
    """The change that states a line by a figure in place of a declaration, or neither."""
    declared = job_of(base[1], base[3])["test_uncertainty"].get("negligible", {})
    changes = [f"no test_uncertainty.negligible.{line}"] if line in declared else []
    stated = job_of(base[1], base[3])["test_uncertainty"]
    if value is None and INPUTS[line][0] in stated:
        changes.append(f"no test_uncertainty.{INPUTS[line][0]}")
    return "; ".join([*changes, *([] if value is None else [f"test_uncertainty.{INPUTS[line][0]} = {value}"])])


@given(base=tests, rule=rules, sign=signs, error=errors, line=st.sampled_from([*INPUTS, "u_um", "form_um"]),
       size=st.sampled_from([0.1, 0.4, 1.0]), times=st.sampled_from([1.3, 3.0, 20.0]))  # fmt: skip
@FEW
def test_a_larger_uncertainty_makes_no_pass_and_by_iso_14253_1_no_fail(
    base: tuple[str, str, str, str, str], rule: str, sign: str, error: float, line: str, size: float, times: float
) -> None:
    """(b) Of any input of [artefact] or [test_uncertainty]."""
    assume(line != "form_um" or base[1] == "spheres")

    def job(value: float) -> str:
        return stating(base, line, value * INPUTS[line][1]) if line in INPUTS else f"artefact.{line} = {value}"

    before, stated, _ = outcome(changed(base, f"{sign}{error}", rule, "temperature 21", job(size)))
    after, then, _ = outcome(changed(base, f"{sign}{error}", rule, "temperature 21", job(times * size)))
    assert "refused" not in (before, after)
    for one, other in ((before, after), (stated, then)):
        assert "pass" not in other or "pass" in one
        assert rule != '"ISO 14253-1"' or other != "fail" or one == "fail"


@pytest.mark.long
@given(base=tests, rule=rules, sign=signs, error=errors, line=st.sampled_from([*INPUTS]), declared=st.booleans())
@FEW
def test_a_statement_left_out_makes_no_pass_and_by_iso_14253_1_no_fail(
    base: tuple[str, str, str, str, str], rule: str, sign: str, error: float, line: str, declared: bool
) -> None:
    """(b) A declaration, or an input."""
    left_out = stating(base, line, None)
    whole = changed(
        base, f"{sign}{error}", rule, "temperature 21", "" if declared else stating(base, line, INPUTS[line][1])
    )
    assume(left_out or not declared)
    before, then, _ = outcome(whole)
    after, now, _ = outcome(changed(base, f"{sign}{error}", rule, "temperature 21", left_out))
    assert before != "refused"
    assert "pass" not in now or "pass" in then
    assert rule != '"ISO 14253-1"' or after != "fail" or before == "fail"


@pytest.mark.long
@given(base=tests, rule=rules, error=errors, what=st.sampled_from(["no temp", "no approach", "no rated_conditions",
       "no artefact.cte_per_k", "no machine.travel_mm", "no probe", "no test_uncertainty"]))  # fmt: skip
@FEW
def test_what_is_not_stated_or_not_recorded_makes_no_pass(
    base: tuple[str, str, str, str, str], rule: str, error: float, what: str
) -> None:
    """(b) Columns of the recording, and other tables of the job."""
    column = what in ("no temp", "no approach")
    assume(what != "no probe" or "probe" not in base[3])
    left_out = changed(base, str(error), rule, what if column else "", "" if column else what)
    _, then, _ = outcome(changed(base, str(error), rule))
    _, now, _ = outcome(left_out)
    assert "pass" not in now or "pass" in then


PARTS = [
    "1",
    "2",
    "*/20",
    "1/300",
    "1/300/2",
    "5/180/3",
    "3/340",
    "*/*/3",
    "*/*/1",
    "7",
    "4",
    "20",
    "3/2",
    "1/10",
    "2/5/1",
]


@pytest.mark.long
@given(
    base=tests, rule=rules, error=errors, parts=st.lists(st.sampled_from(PARTS), min_size=1, max_size=2, unique=True)
)
@FEW
def test_a_removed_row_never_completes_a_test(
    base: tuple[str, str, str, str, str], rule: str, error: float, parts: list[str]
) -> None:
    """(c) A complete test of which something is removed is no pass: what is not there is named, or was never asked for."""
    whole = changed(base, str(error), rule)
    fewer = {"spheres": "points 24", "fixed": "repeats 9"}.get(base[1], f"without {' '.join(parts)}")
    less = replace(whole, recording=f"{whole.recording}; {fewer}")
    assume(less.files()["recording.csv"] != whole.files()["recording.csv"])
    _, _, had = outcome(whole)
    _, now, lacks = outcome(less)
    assert not had, "the base is complete"
    assert now == "refused" or lacks
    assert "pass" not in now


@pytest.mark.long
@given(base=tests, first=st.sampled_from(PARTS), second=st.sampled_from(PARTS))
@FEW
def test_an_incomplete_test_stays_incomplete_with_less(
    base: tuple[str, str, str, str, str], first: str, second: str
) -> None:
    """(c) Removing more makes no pass of what is incomplete."""
    assume(first != second)
    some = changed(base, "0.5", '"simple"', f"without {first}")
    _, then, _ = outcome(some)
    assume(then == "incomplete")
    _, now, still = outcome(replace(some, recording=f"{some.recording} {second}"))
    assert now != "pass"
    assert now == "refused" or still


BY_RULE: tuple[Rule, ...] = (
    "simple", "ISO 14253-1", "ASME B89.7.3.1", "ILAC-G8 binary", "ILAC-G8 non-binary", GuardBand(guard_band=0.5),
    GuardBand(guard_band=1.0), FalseAccept(max_false_accept=0.02), FalseAccept(max_false_accept=0.3),
    UncertaintyRatio(uncertainty_ratio=3),
)  # fmt: skip


def rank(found: Outcome) -> int:
    return ORDER.index(found)


@given(
    rule=st.sampled_from(BY_RULE),
    value=st.floats(0, 30),
    more=st.floats(0, 30),
    u=st.floats(0.01, 20),
    signed=st.booleans(),
)
@example(rule="ISO 14253-1", value=9.999, more=0.002, u=9.0, signed=True)
@MANY
def test_one_value_by_every_rule_without_a_prior_is_monotone_in_the_value(
    rule: Rule, value: float, more: float, u: float, signed: bool
) -> None:
    assert rank(decide(value + more, u, 10.0, rule, signed=signed).outcome) <= rank(
        decide(value, u, 10.0, rule, signed=signed).outcome
    )


@given(
    rule=st.sampled_from(BY_RULE),
    value=st.floats(0, 30),
    u=st.floats(0.01, 20),
    times=st.floats(1, 100),
    signed=st.booleans(),
)
@MANY
def test_one_value_with_a_larger_uncertainty_is_never_accepted_where_it_was_not(
    rule: Rule, value: float, u: float, times: float, signed: bool
) -> None:
    before = decide(value, u, 10.0, rule, signed=signed).outcome
    after = decide(value, times * u, 10.0, rule, signed=signed).outcome
    assert "pass" not in after or "pass" in before
    assert rule != "ISO 14253-1" or after != "fail" or before == "fail"


@given(
    rule=st.sampled_from(["JCGM 106", "Z540.3", PosteriorProbability(posterior_probability=0.8)]),
    value=st.floats(-12, 12),
    u=st.floats(0.01, 20),
    times=st.floats(1, 100),
    sd=st.floats(0.5, 30),
    mean=st.sampled_from([0.0, 0.0, 3.0, -3.0]),
    signed=st.booleans(),
)
@example(rule="JCGM 106", value=9.5, u=1.0, times=5.0, sd=4.0, mean=0.0, signed=True)
@example(rule="Z540.3", value=9.9, u=1.0, times=100.0, sd=4.0, mean=0.0, signed=True)
@MANY
def test_with_a_prior_a_larger_uncertainty_accepts_nothing_either(
    rule: Rule, value: float, u: float, times: float, sd: float, mean: float, signed: bool
) -> None:
    assume(signed or value >= 0)
    prior = PriorKnowledge(mean, sd)
    before, after = (decide(value, each, 10.0, rule, signed=signed, prior=prior) for each in (u, times * u))
    assert after.outcome != "pass" or before.outcome == "pass"
    assert after.guard_band is None or (before.guard_band is not None and after.guard_band >= before.guard_band - 1e-3)


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(("rule", "largest"), [("JCGM 106", (5.1, 6.07)), ("Z540.3", (4.29, 4.86))])
def test_a_prior_alone_accepts_nothing(rule: Rule, largest: tuple[float, float], signed: bool) -> None:
    """Of errors of 0 ± 1 nearly all conform to 10; a measurement that alone could prove no value adds nothing to that.

    Half a normal distribution's 95 % interval fits between ± 10 up to u = 10/1.96, its upper 95 % limit below 10 up to
    10/1.645; with 2 % it is 10/2.326 and 10/2.054.
    """
    most, prior = largest[0 if signed else 1], PriorKnowledge(0.0, 1.0)
    assert decide(0.0, most, 10.0, rule, signed=signed, prior=prior).outcome == "pass"
    for u in (1.01 * most, 1e6):
        found = decide(0.0, u, 10.0, rule, signed=signed, prior=prior)
        assert (found.outcome, found.guard_band) == ("undecided", None)


def test_a_test_that_is_known_worse_is_not_accepted_by_its_prior() -> None:
    """4.95 of 5 among errors of 0 ± 1: known to 0.2 it is 4.76 ± 0.2, which reaches 5.08; known to 1 it is 2.475 ± 0.71."""
    job = 'conformity.rule = "JCGM 106"; conformity.prior = { sd_um = 1.0 }'
    known = Case("", ("step gauge, seven lines", "lengths"), "4.95 at 1/300", job, Right("", ()), (), "")
    assert outcome(known)[1] == "undecided"
    assert outcome(replace(known, job=f"{job}; artefact.u_um = 1.0"))[1] == "undecided"
