"""The overview of a diagnosis, and what to measure next."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import cmm_uq
from cmm_uq.analysis.conformity.accuracy import consequences, costs
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.diagnosis.asserted import AlternativeSet
from cmm_uq.analysis.diagnosis.diagnosis import ModelAverage, Rival
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionTerm
from cmm_uq.analysis.diagnosis.empirical.model import BestKnown, EmpiricalFunction, EmpiricalModel, NamedForm
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.simulated import SimulationMistakes
from cmm_uq.analysis.planning.set_up import DetectionChange, NextPlan, Separation
from cmm_uq.artefacts import artefact_facts, artefact_of, kind_of
from cmm_uq.base.messages import say
from cmm_uq.base.units import unit
from cmm_uq.certificate.diagnosis.overview import overview_of, share_of
from cmm_uq.certificate.diagnosis.page import diagnosis_document
from cmm_uq.certificate.diagnosis.sections import next_sentence, place_words, region_words
from cmm_uq.certificate.document import Document, Overview, Plot, Table
from cmm_uq.certificate.render import render_html
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.certificate.results.contents import next_data
from cmm_uq.machine.physics.catalogue import EVERY, every
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.constructions import plate
from tests.artefacts.simulated import diagnosed, diagnosis_of
from tests.certificate.saying import leaves

IDENTIFIER = re.compile(r"\b[a-z]+(?:_[a-z0-9]+)+\b")  # words that no technician says


def recorded() -> JobDiagnosis:
    found = diagnosis_of("iota-1102-20C")
    assert isinstance(found, JobDiagnosis)
    return found


def consistent() -> JobDiagnosis:
    """The same as if it could have shown everything, so that nothing more were to be measured."""
    return replace(recorded(), unseen=(), next_plan=None)


@pytest.fixture(scope="module")
def explained() -> JobDiagnosis:
    """The real recording, its squareness of X and Y in no model: what it has against a simulation without it, as its own."""
    found = diagnosis_of("iota-1102-20C-against-simulation")
    assert isinstance(found, JobDiagnosis)
    job, kind = found.job, kind_of(found.job)
    observe = partial(kind.observing("diagnosed"), job.facts.artefact, where=job.recording_path)
    given = (job, found.diagnosis, observe, kind.tested, 0, OutsideReadings.of(job.points, found.findings, observe))
    own = replace(found, simulated=None, mistakes=SimulationMistakes())
    return replace(own, consequences=consequences(*given), costs=costs(*given))


def modelled(found: JobDiagnosis, form: NamedForm | None, *, predicts: bool = True) -> JobDiagnosis:
    """The same as if no effect were found, and one function of X were fitted."""
    d, x = found.diagnosis, np.linspace(0.0, 900.0, 19)
    term = FunctionTerm("x_mm", say("error along Y as a function of X"), "y", variable="x")
    one = EmpiricalFunction(
        term, 0.99, (("step", 0.7), ("smooth", 0.29)), form, (), 10.0, (x, np.where(x > 500, 10.0, 0.0), 0 * x + 0.5),
        (x, x, 0 * x), '[[effect]]\nname = "empirical_x_y"\n',
    )  # fmt: skip
    gain = Improvement(3.0, 1.0, 3.3, 1.2, 40.0, 8.0)
    best = BestKnown("straightness_x_y", say("Straightness of X along Y"), 0.001, 5e5, gain, say("a bowed guideway"))
    verdict = "empirical" if predicts else "unexplained"
    changed = replace(d, verdict=verdict, effects=(), after=d.before, indistinguishable=(), best_known=best,
                      empirical=EmpiricalModel((one,), gain, predicts))  # fmt: skip
    return replace(found, diagnosis=changed, next_plan=None)


STEP = NamedForm("step", 0.97, {"size_um": Quantity(10.0, 0.5, (9.0, 11.0), unit("µm")),
                                "at": Quantity(520.0, 6.0, (508.0, 532.0), unit("mm"))})  # fmt: skip


def test_a_function_is_told_by_its_form_only_where_that_is_known(explained: JobDiagnosis) -> None:
    named, open_ = (rows(modelled(explained, form)) for form in (STEP, None))
    told = "Error along Y as a function of X: a step of 10.0 ± 1.0 µm, at 520 ± 12 mm, probability 97 %."
    assert named["Found"].replace("\u00a0", " ") == told
    assert "its form is not told: a step 70 %, a smooth curve 29 %" in open_["Found"].replace("\u00a0", " ")
    assert "predicted to 1.2 µm with it, to 3.3 µm without it" in named["How sure"].replace("\u00a0", " ")
    assert "nearest is straightness of X along Y" in named["What to do"]
    assert "more than 10000 times as probable" in named["What to do"]
    page = diagnosis_document(modelled(explained, STEP))
    assert any(str(section.title) == "What no known effect accounts for" for section in page.sections)


def test_a_function_that_predicts_nothing_is_not_told(explained: JobDiagnosis) -> None:
    found = rows(modelled(explained, STEP, predicts=False))
    assert "A misfit that no known effect accounts for." in found["Found"]
    assert "step" not in found["Found"]


def rows(found: JobDiagnosis) -> dict[str, str]:
    return {str.__str__(label): str.__str__(text) for label, text in overview_of(found).rows}


def plots(document: Document) -> list[Plot]:
    return [block for section in document.sections for block in section.blocks if isinstance(block, Plot)]


def tables(document: Document) -> list[Table]:
    return [block for section in document.sections for block in section.blocks if isinstance(block, Table)]


@pytest.mark.long
def test_what_was_found_is_said_with_its_sense_its_place_and_what_to_do(explained: JobDiagnosis) -> None:
    """−173″ by the machine's own calibration (Harris 2004, table 7): the angle is smaller than 90°."""
    told = rows(explained)
    assert list(told) == ["Found", "Where", "How sure", "What to do"]
    assert re.match(r"Squareness X–Y: the angle between X and Y is 90° minus 17\d ± \d+\s″\.", told["Found"])
    assert told["Where"].startswith("Along X, depending on Y, most from ")
    assert "adjust the guideways or the squareness in the compensation" in told["What to do"]
    gain = explained.diagnosis.improvement
    assert f"{gain.heldout_rms_after_um:.1f}" in told["How sure"]
    assert f"{gain.heldout_rms_before_um:.1f}" in told["How sure"]
    assert overview_of(explained).standing == "open"


@pytest.mark.long
def test_a_consistent_recording_has_one_picture_and_nothing_before_and_after() -> None:
    document = diagnosis_document(consistent())
    assert len(plots(document)) == 1
    assert document.overview is not None
    assert document.overview.standing == "good"
    assert "Before and after" not in [section.title for section in document.sections]
    share = f"{100 * consistent().diagnosis.p_value:.0f} of 100"
    assert rows(consistent())["How sure"] == f"Noise alone looks like this in {share} recordings."
    assert "see the warnings" in rows(consistent())["What to do"]  # a row of it is a copy


def test_a_consistent_one_that_could_not_have_shown_much_says_so_and_what_to_measure() -> None:
    """Twenty bars leave bows of guideways open: no comfort in green."""
    overview = overview_of(recorded())
    assert (overview.standing, overview.verdict) == ("open", "Consistent, as far as this recording can show")
    assert "this recording could not have shown: straightness of X" in rows(recorded())["How sure"]
    assert "measure the set-ups" in rows(recorded())["What to do"]
    titles = [str.__str__(section.title) for section in diagnosis_document(recorded()).sections]
    assert titles.index("What to measure next") < titles.index("What would not have been seen")


@pytest.mark.long
def test_an_explained_one_has_the_field_the_profile_and_each_observation(explained: JobDiagnosis) -> None:
    document = diagnosis_document(replace(explained, next_plan=None))
    assert len(plots(document)) == 3
    titles = [str.__str__(section.title) for section in document.sections]
    assert titles[:2] == ["What was left out", "Where it is"]
    assert titles[-1] == "Candidate explanations"  # long tables are detail


def test_no_text_of_the_page_is_an_identifier(explained: JobDiagnosis) -> None:
    document = diagnosis_document(explained)
    texts = [str.__str__(text) for text in leaves(replace(document, attachments=(), produced_by=document.title))]
    assert [text for text in texts if IDENTIFIER.search(text)] == []
    assert not [name for name in EVERY for text in texts if name in text]


def test_an_unexplained_one_says_so_and_sends_nobody_to_compensate(explained: JobDiagnosis) -> None:
    d = explained.diagnosis
    found = replace(
        explained, diagnosis=replace(d, verdict="unexplained", effects=(), after=d.before, indistinguishable=())
    )
    assert rows(found)["Found"] == "A misfit that no known effect accounts for."
    assert "do not compensate" in rows(found)["What to do"]
    assert overview_of(found).standing == "bad"
    [field, *_] = plots(diagnosis_document(found))
    assert [text for text in field.lettering if "After" in text] == []


def test_of_two_that_cannot_be_told_apart_both_causes_are_told(explained: JobDiagnosis) -> None:
    group = (("squareness_xy", "straightness_x_y"),)
    told = rows(replace(explained, diagnosis=replace(explained.diagnosis, indistinguishable=group)))
    assert "It could as well be: straightness of X along Y." in told["Found"]
    assert "If it is squareness X–Y: the axes are not square" in told["What to do"]
    assert "If it is straightness of X along Y: a bowed guideway" in told["What to do"]


def test_where_nothing_stands_out_by_itself_it_says_so(explained: JobDiagnosis) -> None:
    told = rows(replace(explained, diagnosis=replace(explained.diagnosis, where=())))
    assert told["Where"] == "Spread over the recording: no reading or direction by itself stands out."


def test_a_place_is_told_with_axis_covariate_and_region(explained: JobDiagnosis) -> None:
    (place,) = explained.diagnosis.where
    y = replace(place, covariate="y_mm", region=(300.4, 412.7), along="x")
    assert place_words(y) == "along X, depending on Y, most from 300 to 413\u00a0mm"
    time = replace(place, covariate="time_s", region=(10.0, 20.5), along="z", scale=True)
    told = "in the scale of Z, depending on the time, most from 10 to 20.5\u00a0s"
    assert place_words(time) == told
    assert region_words("x_mm", 650.003, 650.01) == "at 650\u00a0mm"
    assert region_words("x_mm", -420.0, -1.234) == "from −420 to −1.23\u00a0mm"
    own = replace(place, covariate="humidity of the hall", region=(40.0, 50.0), along=None)
    assert place_words(own) == "depending on the humidity of the hall, most from 40 to 50"


@pytest.mark.parametrize(("p", "told"), [
    (0.17, "17 of 100"), (0.05, "5 of 100"), (0.004, "1 of 250"), (1e-4, "1 of 10000"), (9e-5, "fewer than 1 of 10\u00a0000"),
])  # fmt: skip
def test_a_p_value_is_told_as_a_share_of_recordings(p: float, told: str) -> None:
    assert share_of(p) == told


@pytest.mark.long
def test_the_verdict_is_said_in_colour_by_a_sign_and_in_words(explained: JobDiagnosis) -> None:
    for found, sign, name in ((consistent(), "✓", "good"), (explained, "!", "open")):
        page = render_html(diagnosis_document(found))
        title = overview_of(found).verdict
        assert f'<div class="overview {name}">' in page
        assert re.search(rf'<p class="verdict"><span aria-hidden="true">{sign}</span> {re.escape(title)}</p>', page)
        assert page.index('class="overview') < page.index('class="particulars"')


@pytest.mark.long
def test_the_terminal_says_the_same_four_lines_first(explained: JobDiagnosis, tmp_path: Path) -> None:
    job = explained.job.folder
    remarks = cmm_uq.diagnose(job).outcome.summary.remarks
    for (label, text), said in zip(rows(explained).items(), remarks, strict=False):
        assert str.__str__(said) == f"{label}: {text}"


def test_an_overview_is_a_block_of_any_document(explained: JobDiagnosis) -> None:
    from cmm_uq.certificate.diagnosis.page import diagnosis_sections

    first = diagnosis_sections(explained)[0].blocks[0]
    assert isinstance(first, Overview)
    assert first == overview_of(explained)


def test_what_remains_as_probable_without_what_is_asserted_is_said_beside_it(explained: JobDiagnosis) -> None:
    d, free = explained.diagnosis, np.zeros((0, 0))

    def rival(probability: float, *effects: str, unknown: bool = False) -> Rival:
        functions = (say("error along Y as a function of X"),) if unknown else ()
        return Rival(probability, effects, functions, {}, {}, d.after, free)

    several = (
        rival(0.56, "squareness_xy"), rival(0.3, unknown=True), rival(0.09, "squareness_xy", "scale_curvature_x"),
        rival(0.04, "straightness_x_y"),
    )  # fmt: skip
    open_ = replace(explained, diagnosis=replace(d, remaining=ModelAverage(several)))
    told = rows(open_)["How sure"]
    assert "Otherwise: error along Y as a function of X 30\u00a0%." in told
    assert "Otherwise" not in rows(explained)["How sure"]
    assert overview_of(open_).verdict == "Explained: more than one cause is possible"
    alone = replace(explained, diagnosis=replace(d, indistinguishable=(), remaining=ModelAverage()))
    assert overview_of(alone).verdict == "Explained: the cause is found"


@pytest.mark.long
@pytest.mark.parametrize("job", ["iota-1102-20C-against-simulation", "plate-simulated"])
def test_no_table_is_without_rows(job: str) -> None:
    tables = [block for section in diagnosed(job).sections for block in section.blocks if isinstance(block, Table)]
    assert tables
    assert [table.caption for table in tables if not table.rows] == []


def test_a_fault_of_the_artefact_is_as_large_as_that_artefact_allows() -> None:
    """Three times its certificate's 0.5 µm at most, where the same deformation of the machine could be far more."""
    artefact = artefact_of(artefact_facts(kind="plate", u_um=0.5), plate())
    names = [fault.name for fault in artefact.own_faults() if fault.reported[0].name == fault.coefficients[0].name]
    plan = NextPlan(
        (), 1, 5, (), tuple(DetectionChange(name, np.inf, 0.5) for name in names), reached=True, box=np.zeros((3, 2))
    )
    data = next_data(plan, artefact)
    assert data is not None
    unbound, differs = every(), 0
    for name, shown in zip(names, data["shows"], strict=True):
        sd = artefact.faults[name].coefficients[0].prior_sd
        assert shown["detected_before"] is None
        assert shown["detected_after"] == pytest.approx(0.5 * sd)
        differs += sd < unbound[name].coefficients[0].prior_sd / 2
    assert differs


@pytest.mark.parametrize(
    ("odds", "expected"),
    [
        ((40.0, 25.0), "Odds of 25 : 1 or more for the true one are then expected."),
        ((40.0, 0.6), "Odds of 40 : 1 or more for the true one are then expected, but for 1 of 2 pairs, which"),
        (
            (0.095, 0.6),
            "No set-up that was tried is expected to part what this recording cannot: odds of 0.6 : 1 at best",
        ),
    ],
)
def test_set_ups_that_would_part_nothing_are_no_advice(odds: tuple[float, ...], expected: str) -> None:
    pairs = tuple(Separation(("scale_x", "scale_y"), 1.0, each) for each in odds)
    plan = NextPlan((), 3, 5, pairs, (), reached=False, box=np.zeros((3, 2)))
    artefact = artefact_of(artefact_facts(kind="plate"), plate())
    before = SimpleNamespace(artefact=artefact)
    told = next_sentence(
        cast("JobDiagnosis", SimpleNamespace(next_plan=plan, diagnosis=SimpleNamespace(before=before)))
    )
    assert expected in told
    assert told.startswith("Measure next: ") == (max(odds) > 3)


def test_more_alternatives_than_a_sentence_holds_are_a_table(explained: JobDiagnosis) -> None:
    """Each with its likelihood ratio and odds, the more probable first, and where to look for it; none twice."""
    d = explained.diagnosis
    item = d.effects[0]
    names = ("scale_x", "scale_y", "scale_z", "straightness_x_y", "rotation_x_x")
    sets = tuple(
        AlternativeSet((item.effect,), (name,), (every()[name].title,), (0.1,), odds, prior)
        for name, odds, prior in zip(names, (1.0, 2.0, 3.0, 4.0, 5.0), (90.0, 4.0, 1.0, 10.0, 0.1), strict=True)
    )
    many = replace(explained, diagnosis=replace(d, effects=(replace(item, alternatives=sets),)))
    told = rows(many)
    assert "It could as well be one of 5 others; a table below has them." in told["Found"]
    assert told["What to do"].count("If it is") == 1
    (table,) = [
        t for t in tables(diagnosis_document(many)) if str.__str__(t.caption) == "What could stand in its place"
    ]
    said = [[str.__str__(cell) for cell in row] for row in table.rows]
    assert [row[1] for row in said] == [
        "Rotation of carriage X about X", "Scale error of Z", "Scale error of Y", "Straightness of X along Y",
        "Scale error of X",
    ]  # fmt: skip
    assert said[0][2:4] == ["5 : 1", "1 : 10"]
    assert said[-1][2:] == [
        "1 : 1",
        "90 : 1",
        "the scale or its compensation: check the linear compensation of this axis",
    ]


def test_three_alternatives_are_told_in_a_sentence(explained: JobDiagnosis) -> None:
    item = explained.diagnosis.effects[0]
    sets = (AlternativeSet((item.effect,), ("scale_y",), (every()["scale_y"].title,), (0.1,), 1.0, 60.0),)
    few = replace(explained, diagnosis=replace(explained.diagnosis, effects=(replace(item, alternatives=sets),)))
    assert "It could as well be: scale error of Y (odds beforehand 60 : 1 against it)." in rows(few)["Found"]
    captions = [str.__str__(t.caption) for t in tables(diagnosis_document(few))]
    assert "What could stand in its place" not in captions
