"""Sets that stand in the place of an effect: an exact construction, and the identity of a bar of unknown length."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.asserted import AlternativeSet, alternative_sets
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, search
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.constructions import indicated, model, step_gauge
from tests.recordings import TRAVEL, bar_facts, bars


def searched(effect: str, size: float, length: float | None = None) -> SearchResult:
    """Twenty bars on a machine with one error, told of nothing; their length is certified or not."""
    points = bars(np.random.default_rng(21), 20, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = RecordingModel(Ballbar(bar_facts(), points), effects((effect,)))
    read = points.at(truth.simulate(np.array([size]), np.array([400.0]), Noise(1e-3), np.random.default_rng(22)))
    facts = bar_facts(length, None if length is None else 0.1)
    return search(RecordingModel(Ballbar(facts, read), ()), None, alpha=0.01, seed=1)


def sets_of(found: SearchResult) -> dict[tuple[str, ...], AlternativeSet]:
    assert found.combinations is not None
    sets = alternative_sets(found.first.comparison, found.combinations, found.chosen, found.versions)
    return {tuple(sorted(one.effects)): one for one in sets}


@pytest.fixture(scope="module")
def stretched() -> SearchResult:
    return searched("scale_x", 20.0)


def test_a_scale_is_the_other_two_where_the_length_is_unknown(stretched: SearchResult) -> None:
    """e of X alone is e of all three, which a length takes up, less that of Y and Z: equal sizes, the same likelihood."""
    assert stretched.effects == ("scale_x",)
    instead = sets_of(stretched)["scale_y", "scale_z"]
    assert instead.odds == pytest.approx(1.0, abs=1e-3)
    assert instead.sizes[0] == pytest.approx(instead.sizes[1], rel=1e-3)
    assert instead.sizes[0] == pytest.approx(-20.0 / 300.0, rel=0.4)  # of a prior of 300 ppm
    assert instead.prior_odds > 5


def test_a_certified_length_parts_them() -> None:
    found = searched("scale_x", 20.0, 400.0)
    assert found.effects == ("scale_x",)
    assert ("scale_y", "scale_z") not in sets_of(found)


def test_every_set_can_be_the_effect_as_far_as_it_is_said_to(stretched: SearchResult) -> None:
    """By least squares of what the effect shows, set by set; and none of a set's parts would do."""
    comparison, (index,) = stretched.first.comparison, stretched.chosen
    scale, every = comparison.noise_scale[:, None], stretched.first.explanations

    def columns(numbers: tuple[int, ...]) -> Floats:
        return comparison.rest(np.hstack([every[i].members[0].columns for i in numbers]) / scale)

    def projected(numbers: tuple[int, ...], of: Floats) -> Floats:
        own = columns(numbers)
        return np.asarray(own @ np.linalg.lstsq(own, of, rcond=None)[0])

    shows = projected((index,), comparison.left)
    left = comparison.left - shows
    variance = float(left @ left) / (comparison.degrees_of_freedom - 1)
    numbers = {str(explanation.name): i for i, explanation in enumerate(every)}
    for one in sets_of(stretched).values():
        assert one.instead_of == (every[index].name,)
        members = tuple(numbers[name] for name in one.effects)
        missed = shows - projected(members, shows)
        assert np.log(one.odds) == pytest.approx(float(missed @ missed) / (2 * variance), abs=1e-6)
        for fewer in combinations(members, len(members) - 1):
            part = shows - projected(fewer, shows) if fewer else shows
            assert part @ part > 2 * (missed @ missed)


def test_a_strong_squareness_stands_alone() -> None:
    found = searched("squareness_xy", 60.0, 400.0)
    assert found.effects == ("squareness_xy",)
    assert not sets_of(found)


def test_squarenesses_that_a_job_does_not_name_are_one_class_with_what_they_look_like() -> None:
    """Seven lines of a gauge, each with a length of its own: another temperature on each, or three squarenesses."""
    facts = artefact_facts(kind="step_gauge", u_um=0.5)
    truth = ("squareness_xy", "squareness_yz", "squareness_zx")
    read = indicated(facts, step_gauge(), truth, (3.0, 6.0, 5.0), sigma=2e-3, seed=4)
    found = search(model(facts, read, (), None), None, alpha=0.01, seed=1)
    assert found.effects == ("artefact_set_up_temperature",)
    one = sets_of(found)["squareness_yz", "squareness_zx"]
    assert one.odds < 20
    told = search(model(facts, read, truth, None), None, alpha=0.01, seed=1)
    assert told.first.p_value > 0.01


@pytest.mark.long
def test_what_imitates_a_weak_effect_by_chance_is_not_told() -> None:
    """Of all pairs whose least squares lose less than 20 : 1 and yet leave a hundredth of it; no identity is among them."""
    facts = artefact_facts(kind="step_gauge", u_um=0.5)
    read = indicated(facts, step_gauge(), ("squareness_xy",), (12.0,), sigma=2e-3, seed=4)
    found = search(model(facts, read, (), None), None, alpha=0.01, seed=1)
    assert found.effects == ("squareness_xy",)
    comparison, (index,) = found.first.comparison, found.chosen
    every, sets = found.first.explanations, sets_of(found)
    known = [i for i in comparison.visible if i != index and every[i].kind == EFFECT and not every[i].members[0].shape]
    known = [i for i in known if every[i].members[0].columns.shape[1] == 1]
    forms = comparison.rest(
        np.hstack([every[i].members[0].columns for i in (*known, index)]) / comparison.noise_scale[:, None]
    )
    own = forms[:, -1]
    shows = own * (own @ comparison.left) / (own @ own)
    left = comparison.left - shows
    variance = float(left @ left) / (comparison.degrees_of_freedom - 1)
    chance = []
    for pair in combinations(range(len(known)), 2):
        basis = np.linalg.qr(forms[:, pair])[0]
        missed = shows - basis @ (basis.T @ shows)
        if 2 * np.log(20.0) * variance > float(missed @ missed) > 1e-2 * float(shows @ shows):
            chance.append(tuple(sorted(str(every[known[k]].name) for k in pair)))
    assert chance
    assert not {names for names in chance if names in sets and sets[names].odds * sets[names].prior_odds > 20}
