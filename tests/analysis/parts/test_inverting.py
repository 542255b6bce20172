"""A measurement of a zone that is turned round says what its distribution says, and its intervals hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.parts.inverting import Inverse, alike, inverse, nodes_of
from cmm_uq.analysis.parts.result import middle, possible_interval
from cmm_uq.base.points import Floats

Width = Callable[[Floats], Floats]

WIDTHS: dict[str, tuple[int, Width]] = {
    "modulus of a normal quantity": (1, lambda z: np.abs(z[..., 0])),
    "place in a plane": (2, lambda z: np.linalg.norm(z, axis=-1)),
    "range of twelve points": (12, lambda z: np.ptp(z, axis=-1)),
}
"""Number of coordinates, each with an error of one, and the zone of them."""


def turned_round(width: Width, measured: Floats, errors: Floats) -> Inverse:
    """As :class:`cmm_uq.analysis.parts.virtual.AtPose` does it."""
    found, alone = float(width(measured)), width(errors)
    parts = measured - errors
    truly = width(parts)
    nodes = nodes_of(found, alone)
    trials = [parts[like] * (node / truly[like])[:, None] for node in nodes for like in [alike(truly, node)]]
    return inverse(found, width(measured + errors), alone, nodes, np.array([width(part + errors) for part in trials]))


@pytest.mark.parametrize("found", [0.5, 1.5, 3.0, 10.0])
def test_draws_of_a_place_are_those_of_the_noncentral_distribution(found: float) -> None:
    """Off by θ in a plane, errors of one along each axis: P(measured ≥ f) is that of χ² of two degrees of freedom about θ²."""
    random = np.random.default_rng(3)
    width = WIDTHS["place in a plane"][1]
    measured = np.array([found, 0.0])
    again = width(measured + random.standard_normal((200_000, 2)))
    true = turned_round(width, measured, random.standard_normal((100_000, 2)))(again)
    assert np.mean(true < 0) == pytest.approx(np.exp(-0.5 * found**2), abs=0.006)
    for p in (0.025, 0.5, 0.9, 0.975):
        theta = np.quantile(true, p)
        if theta > 0:
            assert stats.ncx2.sf(found**2, 2, theta**2) == pytest.approx(p, abs=0.01)


@pytest.mark.parametrize("name", WIDTHS)
@pytest.mark.parametrize("true", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_intervals_hold_however_small_the_zone(name: str, true: float) -> None:
    """95 % hold, of a normal quantity up to 96.5 % near one; to three standard deviations of 400 measurements. The form is
    a tilt, whose largest points are no others for their errors."""
    random = np.random.default_rng(17)
    count, width = WIDTHS[name]
    shape = np.arange(count) - 0.5 * count
    size = float(width(random.standard_normal((5000, count))).std()) if count > 2 else 1.0
    part, held, above, widths = true * size * shape / width(shape), 0, 0, []
    for _ in range(400):
        measured = part + random.standard_normal(count)
        inverted = turned_round(width, measured, random.standard_normal((1000, count)))
        draws = inverted(width(measured + random.standard_normal((1000, count))))
        low, high = possible_interval(draws, 0.95)
        held += low <= true * size <= high
        above += middle(draws) > true * size
        widths.append(high - low)
    assert 0.95 - 3 * np.sqrt(0.05 * 0.95 / 400) < held / 400 < 0.965 + 3 * np.sqrt(0.035 * 0.965 / 400)
    if true:  # as often too large as too small
        assert above / 400 == pytest.approx(0.5, abs=3 * np.sqrt(0.25 / 400))
    assert min(widths) > 1.5 * size  # however well the part happened to be measured


def test_what_is_far_from_zero_is_turned_round_as_what_is_linear() -> None:
    """θ = 2f − g: a modulus of 100 errs as the quantity does, beyond the quantiles too."""
    errors = np.random.default_rng(1).standard_normal((20_000, 1))
    inverted = turned_round(WIDTHS["modulus of a normal quantity"][1], np.array([100.0]), errors)
    read = np.linspace(95.0, 105.0, 41)
    np.testing.assert_allclose(inverted(read), 200.0 - read, atol=0.02)
