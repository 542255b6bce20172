"""What each error makes of a recording, against what the bars themselves say."""

from __future__ import annotations

import numpy as np
import pytest

import cmm_uq
from cmm_uq.analysis.machine.performance import contributions
from cmm_uq.app.api.outcomes import Report
from cmm_uq.base.units import MICROMETRE
from tests.artefacts.simulated import reported
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def found() -> Report:
    return reported("iota-1102-20C")


def test_the_share_of_each_error_is_what_it_does_to_the_lengths_of_the_bars(found: Report) -> None:
    """Not by the design: each error displaces both balls, and the bar becomes shorter or longer along its own direction."""
    model = found.outcome.found.model  # type: ignore[attr-defined]
    values = found.outcome.found.posterior.draws.mean(axis=0)  # type: ignore[attr-defined]
    xyz, pairs = model.artefact.points.xyz, model.artefact.rows
    along = xyz[pairs[:, 1]] - xyz[pairs[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / lengths[:, None]
    deviations = (lengths - 404.2357)[model.used]
    shares, rms = {}, {}
    for i, effect in enumerate(model.effects):
        alone = np.where(np.arange(len(model.effects)) == i, values[: len(model.effects)], 0.0)
        moved = model.errors(xyz, alone)
        longer = -np.sum(directions * (moved[pairs[:, 1]] - moved[pairs[:, 0]]), axis=1)[model.used]
        shares[effect.name] = longer @ deviations / (deviations @ deviations)
        rms[effect.name] = np.sqrt(np.mean(longer**2) / 2) / MICROMETRE  # a length is the difference of two readings
    for one in contributions(model, values):
        if one.owner in shares:
            assert one.share == pytest.approx(shares[one.owner], abs=2e-3)
            assert one.rms_um == pytest.approx(rms[one.owner], rel=5e-3)


def test_the_shares_are_ranked_and_add_up_to_one(found: Report) -> None:
    model, values = found.outcome.found.model, found.outcome.found.posterior.draws.mean(axis=0)  # type: ignore[attr-defined]
    ranked = contributions(model, values)
    assert sum(one.share for one in ranked) == pytest.approx(1.0, abs=1e-12)
    assert [one.share for one in ranked] == sorted((one.share for one in ranked), reverse=True)
    assert ranked[0].owner == "squareness_xy"


def test_an_error_that_alone_acts_has_the_whole_share() -> None:
    truth = {"seed": 1, "effects": {"squareness_xy": {"angle_arcsec": -174.0}}, "noise": {"coordinate_um": 0.01}}
    drawn = cmm_uq.report(cmm_uq.simulate(ROOT / "examples" / "iota-1102-20C", truth))
    first, *rest = contributions(drawn.outcome.found.model, drawn.outcome.found.posterior.draws.mean(axis=0))  # type: ignore[attr-defined]
    assert (first.owner, first.share) == ("squareness_xy", pytest.approx(1.0, abs=0.01))
    assert max(abs(one.share) for one in rest) < 0.01
