"""What a certificate says of where its error factors hold."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from cmm_uq.analysis.machine.agreement import Agreement, FigurePair
from cmm_uq.analysis.machine.regions import FactorRegions
from cmm_uq.base.messages import Verbatim
from cmm_uq.certificate.certificate import certified, with_capability
from cmm_uq.certificate.document import Paragraph, Table
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.results.contents import _identifiability
from cmm_uq.certificate.sections.conformity import machine_alone, performance
from cmm_uq.certificate.sections.method import method
from cmm_uq.certificate.sections.regions import over_range, regions_data, regions_section, regions_warnings
from cmm_uq.certificate.sections.results import error_factors
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.simulated import analysed, outcome
from tests.conftest import ROOT

JOB = "iota-1102-20C"
KEY = ("scale_x", "ppm")


def regions() -> FactorRegions:
    found = analysed(JOB).regions
    assert isinstance(found, FactorRegions)
    return found


def told(*, stated: Quantity | None = None, tolerance: float | None = None, **changed: object) -> Result:
    """The result with another scale of X over the recorded set-ups, a tolerance of it, and other regions."""
    result, found = analysed(JOB), replace(regions(), **{"influence": (), **changed})  # type: ignore[arg-type]
    parameters = dict(result.parameters)
    if stated is not None:
        parameters[KEY[0]] = {KEY[1]: stated}
    model = result.job.facts.model.model_copy(update={"tolerances": {} if tolerance is None else {KEY[0]: tolerance}})
    artefact = result.job.facts.artefact.model_copy(update={"certificate": None})  # its own machine's makes no pass
    job = replace(result.job, facts=result.job.facts.model_copy(update={"model": model, "artefact": artefact}))
    return replace(result, job=job, parameters=parameters, all_errors=lambda: found)


class Averaged(Result):
    averaged = 2  # type: ignore[assignment]


def agreement(*pairs: FigurePair) -> Agreement:
    return Agreement({"factor": 6, "line": 19, "length": 19}, pairs)


def scale(value: float, u: float) -> Quantity:
    return Quantity(value, u, (value - 2 * u, value + 2 * u), analysed(JOB).parameters[KEY[0]][KEY[1]].unit)


FACTOR = FigurePair("factor", KEY, scale(10.2, 0.5), scale(16.0, 0.5), 1.7)
LINE = FigurePair("line", 4, scale(12.0, 1.5), scale(-25.0, 2.0), 2.5)
LENGTH = FigurePair("length", 7, scale(12.0, 1.0), scale(3.0, 1.0), 1.2, 404.2)


def first(result: Result) -> tuple[str, ...]:
    table = next(block for block in regions_section(result).blocks if isinstance(block, Table))
    return tuple(map(str, table.rows[0]))


def test_a_row_has_the_mean_the_range_and_the_eighths() -> None:
    result = told(stated=scale(10.2, 1.35), whole={KEY: scale(3.6, 4.0)}, eighths={KEY: (-9.4, 21.2)})
    assert first(result) == ("Scale error of X", "10.2", "2.7", "3.6", "8.0", "−9.4", "21.2", "ppm")


def test_nothing_is_known_better_everywhere_than_over_the_set_ups() -> None:
    """U of the mean, 2.7, stands, also where a capability of the laboratory has raised it."""
    result = told(stated=scale(10.2, 1.35), whole={KEY: scale(3.6, 0.5)}, eighths={})
    assert over_range(result)[KEY].expanded == pytest.approx(2.7)
    assert first(result)[3:] == ("3.6", "2.7", "", "", "ppm")
    data = regions_data(result)
    assert data["over_range"]["scale_x"]["ppm"]["u"] == pytest.approx(1.35)
    assert data["regions"]["eighths"] == {}


def test_beside_an_average_over_explanations_stands_the_mean_of_all_errors_together() -> None:
    """The average of a factor beside other explanations, 10.2, is no mean over the recorded set-ups; 7.5 is."""
    result = told(stated=scale(10.2, 1.35), whole={KEY: scale(3.6, 4.0)}, recorded={KEY: scale(7.5, 1.0)})
    remaining = replace(result.diagnosed.diagnosis.remaining, rivals=(("one", 0.6), ("other", 0.4)))
    diagnosis = replace(result.diagnosed.diagnosis, remaining=remaining)
    averaged = replace(result, diagnosed=replace(result.diagnosed, diagnosis=diagnosis))
    assert averaged.averaged == 2
    assert first(averaged)[1:3] == ("7.5", "2.0")
    assert first(result)[1:3] == ("10.2", "2.7")


def test_a_factor_that_is_not_given_is_not_given_elsewhere() -> None:
    free = replace(told(), contradictions=())
    assert KEY in over_range(free)
    ls = free.least_squares
    k = [unknown.key for unknown in ls.unknowns].index(KEY)
    alone = np.zeros((len(ls.unknowns), 1))
    alone[k] = 1.0
    estimate = replace(free.estimate, least_squares=replace(ls, null_space=alone))
    assert KEY not in over_range(replace(free, estimate=estimate))


@pytest.mark.parametrize(
    ("tolerance", "warned"),
    [
        (20.0, False),  # within it everywhere
        (12.0, True),  # within it over the set-ups, open over the range
        (10.0, False),  # open already
        (3.0, True),  # beyond it over the set-ups, open over the range
    ],
)
def test_a_tolerance_that_is_open_over_the_range_is_warned_of(tolerance: float, warned: bool) -> None:
    """10.2 ± 1.0 over the recorded set-ups; 10 ± 8 over the range, of 2 to 18."""
    result = told(stated=scale(10.2, 0.5), tolerance=tolerance, whole={KEY: scale(10.0, 4.0)})
    warnings = [str(text) for text in regions_warnings(result)]
    assert bool(warnings) == warned
    if warned:
        assert warnings == [
            "Tolerances are judged on the error factors as estimated. Over the measuring range it is open whether these are "
            "kept: Scale error of X (10.0 ± 8.0 ppm)."
        ]


def test_a_factor_that_all_errors_deny_is_withdrawn_with_both_figures_shown() -> None:
    """10.2 ± 1.0 by the named errors, 16 ± 1 by all together: no value in the table, none over the range, no tolerance."""
    kept = told(stated=scale(10.2, 0.5), tolerance=20.0, whole={KEY: scale(10.0, 4.0)})
    result = told(
        stated=scale(10.2, 0.5), tolerance=20.0, whole={KEY: scale(10.0, 4.0)}, recorded={KEY: scale(16.0, 0.5)},
        agreement=agreement(FACTOR),
    )  # fmt: skip
    assert KEY in result.not_given
    (warning,) = regions_warnings(result)
    assert str(warning) == (
        "Scale error of X is not given: 10.2 ± 1.0 ppm by the named errors alone, 16.0 ± 1.0 ppm of the same set-ups by all "
        "errors together, which their joint uncertainty does not allow."
    )
    assert not over_range(result)
    (row,) = [row for row in error_factors(result).blocks[0].rows if str(row[0]) == "Scale error of X"]
    assert str(row[1]) == "not given"
    (verdict,) = [one for one in result.verdicts if one.name == "scale_x.ppm"]
    (without,) = [one for one in kept.verdicts if one.name == "scale_x.ppm"]
    assert (verdict.outcome, without.outcome) == ("undecided", "pass")
    assert {"scale_x.ppm": 1.0} in _identifiability(result)["undetermined"]
    data = regions_data(result)["regions"]
    assert (data["disagree"], data["recorded"]["scale_x"]["ppm"]["value"]) == (["scale_x.ppm"], 16.0)
    assert KEY not in kept.not_given
    assert not regions_warnings(kept)


def test_what_was_read_otherwise_than_expected_withdraws_what_follows_from_a_model_and_no_more() -> None:
    """A line and a length that all errors together deny: no factor over the set-ups, the range or within a tolerance, and no
    figure without noise; what is decided on values as read stands."""
    job = outcome(JOB).results["conformity"]
    kept, result = (
        told(stated=scale(10.2, 0.5), tolerance=20.0, whole={KEY: scale(10.0, 4.0)}, agreement=agreement(*pairs))
        for pairs in ((), (LINE, LENGTH))
    )
    assert [str(text) for text in regions_warnings(result)] == [
        "No figure by a model of the machine's errors is given: the slope of the line of measurement 4 is 12.0 ± 3.0 ppm as "
        "read, and −25.0 ± 4.0 ppm by all errors together, which their joint uncertainty does not allow. Decisions on values "
        "as read stand.",
        "No figure by a model of the machine's errors is given: the error of a length of 404.2 mm in measurement 7 is 12.0 ± "
        "2.0 ppm as read, and 3.0 ± 2.0 ppm by all errors together, which their joint uncertainty does not allow. Decisions "
        "on values as read stand.",
    ]
    assert {effect for effect, _ in result.not_given} >= {one.name for one in result.model.effects}
    assert not over_range(result)
    assert (machine_alone(kept), machine_alone(result)) == (regions().performance, None)
    (verdict,) = [one for one in result.verdicts if one.name == "scale_x.ppm"]
    assert verdict.outcome == "undecided"
    data = certified(result, Page(lambda found: [], lambda found: {})).results
    assert "performance_of_machine" not in data
    (one,), (before,) = data["conformity"], job
    assert {key: one[key] for key in one} == {key: before[key] for key in one}
    assert data["accuracy_uncertainty"] == outcome(JOB).results["accuracy_uncertainty"]
    found = data["regions"]["agreement"]
    assert [(each["figure"], each["ratio"], each["length_mm"]) for each in found["disagree"]] == [
        ("line 4", 2.5, None), ("length 7", 1.2, 404.2),
    ]  # fmt: skip
    notes = [str(note) for note in performance(result).blocks[0].notes]  # type: ignore[union-attr]
    assert any("is not stated: statements of it contradict each other." in note for note in notes)


def test_a_certificate_says_how_much_was_held_against_what() -> None:
    texts = [str(one.text) for one in regions_section(told(agreement=agreement(replace(LENGTH, ratio=0.224)))).blocks
             if isinstance(one, Paragraph)]  # fmt: skip
    assert (
        "44 figures were held against what all errors together say of them: error factors by the named errors alone, slopes "
        "of lines and errors of lengths as read. The largest difference is 22 % of what their joint uncertainty allows."
    ) in texts


def test_of_an_average_over_explanations_no_figure_of_the_named_errors_alone_is_said() -> None:
    result = told(stated=scale(10.2, 0.5), recorded={KEY: scale(16.0, 0.5)}, agreement=agreement(FACTOR))
    (warning,) = regions_warnings(Averaged(**{one.name: getattr(result, one.name) for one in fields(result)}))
    assert (
        str(warning) == "Scale error of X is not given: with errors beside the named ones the recording contradicts it."
    )


def test_why_nothing_is_stated_is_said() -> None:
    result = replace(analysed(JOB), all_errors=lambda: Verbatim("the travel of axis x is needed"))
    (block,) = regions_section(result).blocks
    assert isinstance(block, Paragraph)
    assert str(block.text).endswith("what they are elsewhere is not stated: the travel of axis x is needed.")
    assert regions_data(result) == {"regions": {"not_stated": "the travel of axis x is needed"}}
    assert not over_range(result)
    assert not regions_warnings(result)


def test_results_have_what_the_page_has() -> None:
    results = outcome(JOB).results
    data = results["regions"]
    stated, _ = with_capability(analysed(JOB))
    for (effect, name), quantity in over_range(stated).items():
        assert results["over_range"][effect][name]["value"] == quantity.value
    assert data["observations"] == data["of"] == 19
    assert data["of_priors"] == [".".join(key) for key in regions().whole]
    assert {row["family"] for row in data["families"]} == set(regions().scales)
    assert all(len(row["u_ratio"]) == len(data["of_priors"]) for row in data["priors"])


def test_the_method_names_where_its_equations_and_their_trials_stand() -> None:
    paragraph = method(analysed(JOB)).blocks[0]
    assert isinstance(paragraph, Paragraph)
    pages = re.findall(r"docs/\S+\.md", str(paragraph.text))
    assert len(pages) == 4
    assert all((ROOT / page).is_file() for page in pages)
