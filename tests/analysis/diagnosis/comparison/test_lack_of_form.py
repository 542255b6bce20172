"""The probability of "nothing is missing" among functions: against Fisher's F, and by an error that no effect has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.lack_of_form import lack_of_form, likeliest_noise
from cmm_uq.analysis.diagnosis.comparison.search import model_comparison, search
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily, FunctionTerm
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats, Machine
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.diagnosis.comparison.test_lack_of_fit import one_effect
from tests.analysis.diagnosis.dense_noise import some_kinds
from tests.analysis.diagnosis.test_invariance import NAMED as SIX
from tests.recordings import TRAVEL, bar_facts, bars


def function_of(columns: Floats, log_prior: float = 0.0) -> FunctionFamily:
    """Of no covariate in particular, with columns (m, r)."""
    nowhere = np.zeros((0, 1, columns.shape[1]))
    return FunctionFamily(
        FunctionTerm("x_mm", Verbatim("x")), "step", columns[:, None], log_prior, np.zeros(0), nowhere
    )


def the_effect(comparison: CandidateComparison) -> Floats:
    return comparison.explanations[0].members[0].columns


@pytest.mark.parametrize("p", [0.002, 0.02])
def test_of_one_function_in_white_noise_it_is_that_of_the_f_test(p: float) -> None:
    """Odds grow with F. Of fifty draws, or 450, as many as exceed them scatter binomially."""
    c = one_effect(p)
    found = [lack_of_form(c, lambda: [function_of(the_effect(c))], seed, 0.002) for seed in range(40)]
    assert np.mean(found) == pytest.approx(p, abs=3 * np.sqrt(p / (40 * 50)))


def test_a_function_of_two_coefficients_is_judged_by_what_it_takes_along_either() -> None:
    c, random = one_effect(1e-6), np.random.default_rng(3)
    other = random.standard_normal((len(c.observed), 1))
    mixed = np.hstack([the_effect(c) + other, the_effect(c) - other])
    assert lack_of_form(c, lambda: [function_of(mixed)], 1, 0.002) < 1e-4
    assert lack_of_form(c, lambda: [function_of(np.hstack([other, other**2]))], 1, 0.002) > 0.02


def test_where_nothing_could_show_nothing_is_missing() -> None:
    c = one_effect(1e-6)
    assert lack_of_form(c, list, 1, 0.002) == 1.0
    assert lack_of_form(c, lambda: [function_of(1e-9 * the_effect(c))], 1, 0.002) == 1.0
    absorbed = c.baseline[:, :1]
    assert lack_of_form(c, lambda: [function_of(absorbed)], 1, 0.002) == 1.0


def test_beside_a_function_the_noise_is_that_of_what_it_leaves() -> None:
    """What is left is a step between two halves: shared by each half in the one noise, white in the other beside it."""
    c, half = one_effect(0.5), np.repeat([-1.0, 1.0], 7)[:, None]
    white, *_ = some_kinds(np.ones(14))
    shared = replace(white, name="shared", slow=5.0 * np.hstack([half < 0, half > 0]).astype(float))
    left = c.rest(0.4 * half + 0.02 * np.random.default_rng(5).standard_normal((14, 1)))[:, 0]
    both = replace(c, kinds=[replace(shared, probability=0.5), replace(white, probability=0.5)], observed=left)
    assert both.noise_probability(()).argmax() == 0
    assert likeliest_noise(both, [function_of(half)]) == 1


@pytest.mark.parametrize(("of_forms", "found"), [(0.0019, 0.0095), (0.0021, None)])
def test_forms_speak_at_a_fifth_of_the_rate_where_effects_do_not(
    monkeypatch: pytest.MonkeyPatch, of_forms: float, found: float | None
) -> None:
    random = np.random.default_rng(1)
    once = bars(random, 20, 400.0, Machine("m", "XYZ", TRAVEL))
    read = once.at(once.xyz + 1e-3 * random.standard_normal(once.xyz.shape))
    model = RecordingModel(Ballbar(bar_facts(), read), effects(SIX))
    plain = model_comparison(model, None, 0, 0.01).p_value
    assert plain > 0.01
    monkeypatch.setattr("cmm_uq.analysis.diagnosis.comparison.search.lack_of_form", lambda *_: of_forms)
    result = search(model, None, alpha=0.01, seed=0)
    assert result.first.p_value == pytest.approx(plain if found is None else found)
    assert (result.combinations is None) is (found is None)
