"""Information of placings adds up to that of the recording that they make together."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.physics.catalogue import effects
from cmm_uq.planning.information import told, whole
from cmm_uq.planning.placing import joined
from cmm_uq.planning.ready import ready_plan
from tests.planning.plans import EVERY_KIND, SIX, setting

RIVALS = effects(("rotation_x_z", "straightness_y_z", "artefact_sag"))


@pytest.mark.parametrize("kind", [kind for kind in EVERY_KIND if kind != "shift"])
def test_the_sum_over_placings_is_the_whole(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, SIX, **wishes)
    _, placings = ready_plan(chosen)
    chosen = chosen.sized(joined(placings))
    known = told(chosen, placings, RIVALS)
    together = whole(chosen, joined(placings), RIVALS)
    np.testing.assert_allclose(known.each.sum(axis=0), together, rtol=1e-6, atol=1e-6 * np.abs(together).max())


def test_repeats_add_as_often_as_they_are_made() -> None:
    facts, _ = EVERY_KIND["ballbar"]
    once, thrice = (told(setting(facts, repeats=n), ready_plan(setting(facts, repeats=n))[1]) for n in (1, 3))
    np.testing.assert_allclose(thrice.each, 3 * once.each, rtol=1e-9)


def test_a_short_line_of_a_long_gauge_keeps_the_certificate_of_the_whole() -> None:
    """0.4 µm on 1000 mm is 0.4 ppm on any line, however short."""
    facts, _ = EVERY_KIND["step_gauge"]
    chosen = setting(facts, length_mm=1000.0)
    _, placings = ready_plan(chosen)
    sized = chosen.sized(joined(placings))
    longest = max(float(p.points.columns["reference_mm"].max()) for p in placings)
    assert [u.prior_mean for u in told(sized, placings[4:5]).unknowns if u.known] == [longest]
    assert next(u.prior_mean for u in told(chosen, placings[4:5]).unknowns if u.known) < longest
