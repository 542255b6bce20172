"""Of periods that equally spaced positions cannot tell apart all are told and none is asserted: only that there is one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.asserted import IMPROBABLE
from cmm_uq.analysis.diagnosis.comparison.combinations import Combination, Combinations
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.analysis.diagnosis.joint import UNRESOLVED, Mode, _peaks, _too_little, finer, period_settled
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.certificate.diagnosis.overview import sentence
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.recordings import TRAVEL

PERIOD, PITCH = 14.9, 5.0
LONG = Quantity(15.0, 0.1, (14.8, 15.2), unit("mm"))


def plate(places: Floats) -> Diagnosis:
    """Holes at some places along X and five along Y, 8 µm of a periodic error of X, 1 µm of noise."""
    i, j = (each.ravel() for each in np.meshgrid(places, PITCH * np.arange(5), indexing="ij"))
    reference = np.column_stack([i, j, np.zeros_like(i)])
    xyz = reference + np.array([250.0, 200.0, -300.0])
    xyz[:, 0] -= 8e-3 * np.sin(2 * np.pi * xyz[:, 0] / PERIOD + 0.5)
    xyz += 1e-3 * np.random.default_rng(1).standard_normal(xyz.shape)
    number = np.arange(1, len(xyz) + 1)
    columns = {f"reference_{a}_mm": reference[:, k] for k, a in enumerate("xyz")}
    points = Points(
        xyz, np.ones_like(number), number, np.ones_like(number), Machine("m", "XYZ", TRAVEL), columns, number
    )
    model = RecordingModel(Plate(artefact_facts(kind="plate"), points), effects(("scale_x", "scale_y")))
    return diagnose(model, stated_um=None, alpha=0.01, seed=0)


@pytest.mark.long
def test_five_places_do_not_tell_a_period_from_a_function() -> None:
    """Less a scale and where the plate stood three figures remain, and amplitude, phase and period are three."""
    found = plate(PITCH * np.arange(5))
    assert (found.verdict, found.effects) == ("empirical", ())
    (gone,) = found.withheld
    assert (gone.effect, gone.why) == ("periodic_scale_x", IMPROBABLE)
    assert found.best_known is not None
    assert found.best_known.effect == "periodic_scale_x"


@pytest.mark.long
def test_eight_places_at_equal_distances_do_not_tell_a_period_from_its_aliases() -> None:
    """Sampled every 5 mm, frequencies that differ or sum up to a multiple of 1/5 mm⁻¹ are one (sampling theorem)."""
    found = plate(PITCH * np.arange(8))
    (item,) = found.effects
    assert (item.effect, item.settled) == ("periodic_scale_x", False)
    assert set(item.parameters) == {"amplitude_um"}, "no period and no phase"
    assert item.probability + 1 - item.together > 0.5
    assert item.together >= 0.99
    assert len(item.modes) == 5
    assert sum(mode.probability for mode in item.modes) == pytest.approx(1.0, abs=0.01)
    assert all(0.05 < mode.probability < 0.5 for mode in item.modes)
    for n, wanted in enumerate((PERIOD, *(1 / (k / PITCH + s / PERIOD) for k in (1, 2) for s in (-1, 1)))):
        assert any(abs(mode.period.value - wanted) < 2 * mode.period.u for mode in item.modes), n
    told = sentence(item, found.improvement)
    assert "and repeats with one of several periods" in told
    assert told.count(" mm: ") == 5


@pytest.mark.parametrize(
    ("probability", "other", "asserted"),
    [(0.51, 0.0, True), (0.51, 0.49, True), (0.49, 0.0, False), (0.49, 0.51, False)],
)
def test_without_a_period_an_error_is_asserted_where_it_is_more_probable_than_not_over_all_periods(
    probability: float, other: float, *, asserted: bool
) -> None:
    """As any effect (ASSERTED), whatever else there may be; a function of the reading is no part of it."""
    why = _too_little(searched(probability, other), 0, (Mode(LONG, 0.3, (10.0, 20.0)), Mode(LONG, 0.3, (30.0, 40.0))))
    assert why is (None if asserted else UNRESOLVED)


@pytest.mark.parametrize(("share", "with_period"), [(0.6, False), (0.7, True)])
def test_an_error_is_asserted_with_a_period_where_both_together_are_more_probable_than_not(
    share: float, *, with_period: bool
) -> None:
    """Of 0.77: 0.46 with a period that has six tenths of it, 0.54 with one that has seven."""
    assert period_settled(searched(0.77, 0.0), 0, (Mode(LONG, share, (10.0, 20.0)),)) is with_period


def searched(probability: float, other: float) -> SearchResult:
    """A periodic error, a function of the same reading and nothing, of these probabilities; readings from 0 to 400 mm."""
    effect = effects(("periodic_scale_x",))[0]
    member = (Member(np.ones((3, 1)), (15.0,)),)
    explanations = [
        Explanation(say("periodic_scale_x"), EFFECT, member, imitated_by=effect.imitated_by, effect=effect),
        Explanation(say("function"), UNKNOWN, member, term=effect.imitated_by[0]),
    ]
    each = {(0,): probability, (1,): other, (): 1 - probability - other}
    found = {frozenset(key): Combination((), float(np.log(p))) for key, p in each.items() if p > 0}
    readings = SimpleNamespace(artefact=SimpleNamespace(points=SimpleNamespace(readings={"x": np.array([0.0, 400.0])})))
    first = SimpleNamespace(explanations=explanations, model=readings)
    combinations = Combinations(explanations, found)
    return cast("SearchResult", SimpleNamespace(first=first, combinations=combinations, chosen=frozenset({0})))


def test_peaks_are_parted_where_the_evidence_between_them_is_a_tenth_of_the_lower() -> None:
    evidence = np.log([1.0, 0.2, 0.05, 0.6, 0.07, 0.5, 0.04])
    parts = [part.tolist() for part in _peaks(np.arange(7), evidence)]
    assert parts == [[0, 1], [2, 3, 4, 5, 6]], "0.05 of 0.6 is less than a tenth, 0.07 of 0.5 is more"


@pytest.mark.long
def test_places_at_unequal_distances_do() -> None:
    found = plate(np.sort(np.random.default_rng(4).uniform(0, 400, 24)).round(2))
    (item,) = found.effects
    assert item.effect == "periodic_scale_x"
    assert not found.withheld
    low, high = item.parameters["period_mm"].interval95
    assert low < PERIOD < high
    assert high - low < 0.1


@pytest.mark.parametrize(("likely", "step"), [(0.5, 0.1), (1.5, 0.1), (-0.5, 0.1), (3.0, 5.0), (0.0, 1e-9)])
def test_shapes_to_draw_from_are_two_at_least_wherever_the_likely_ones_lie(likely: float, step: float) -> None:
    found = finer(np.array([likely]), step, 0.0, 1.0)
    assert len(found) >= 2
    assert np.all(np.diff(found) > 0)
    assert (found[0] >= 0.0, found[-1] <= 1.0) == (True, True)
