from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.errors import CmmUqError
from cmm_uq.physics.expansion import Body, Table, standardised_length
from cmm_uq.units import ARCSECOND


def test_expansion_in_the_end_gauge_of_the_gums_annex_h1():
    # l(αs·θs − α·θ), l = 50 mm, θ = −0.1 K; printed contributions 2.9 and 16.6 nm, second order 11.7 and 1.7 nm
    cte, u_cte, u_difference = 11.5e-6, 2e-6 / np.sqrt(3), 1e-6 / np.sqrt(6) * np.sqrt(2)
    u_cte, u_difference = 1.2e-6, 0.58e-6
    theta, u_theta, u_gap = -0.1, 0.41, 0.029
    # gauge = standard + δα, and standard = gauge − δθ, so each pair is correlated
    u_gauge, u_standard_temperature = np.hypot(u_cte, u_difference), np.hypot(u_theta, u_gap)
    length = standardised_length(
        50.0,
        Body(cte, u_gauge, 20 + theta, u_theta),
        Body(cte, u_cte, 20 + theta, u_standard_temperature),
        cte_correlation=u_cte / u_gauge,
        temperature_correlation=u_theta / u_standard_temperature,
    )
    first = [50e6 * u_difference * theta, 50e6 * cte * u_gap]
    second = [50e6 * u_difference * u_theta, 50e6 * u_cte * u_gap]
    assert np.abs(first) == pytest.approx([2.9, 16.7], abs=0.05)
    assert second == pytest.approx([11.9, 1.74], abs=0.05)
    assert length.u * 1e6 == pytest.approx(np.linalg.norm([*first, *second]), rel=1e-5)


@pytest.mark.parametrize(("temperature", "indicated", "at_20"), [(25.0, 404.259, 404.235), (30.0, 404.292, 404.244)])
def test_the_published_bar_brought_to_20_degrees(temperature, indicated, at_20):
    # Harris 2004, steel of 12 µm/(m K)
    assert standardised_length(indicated, Body(12e-6, 0, temperature)).length == pytest.approx(at_20, abs=0.6e-3)


def test_steel_scales_measure_steel_right_at_any_temperature():
    steel = Body(11.5e-6, 0, 27.0)
    assert standardised_length(500.0, steel, steel).length == 500.0


def test_the_uncertainty_is_that_of_drawn_values():
    artefact, scale = Body(23e-6, 1e-6, 24.0, 0.3), Body(8e-6, 0.5e-6, 22.5, 0.2)
    found = standardised_length(800.0, artefact, scale, u_indicated=0.7e-3, temperature_correlation=0.8)
    rng, n = np.random.default_rng(1), 400_000
    covariance = [[0.3**2, 0.8 * 0.3 * 0.2], [0.8 * 0.3 * 0.2, 0.2**2]]
    ta, ts = rng.multivariate_normal([24.0, 22.5], covariance, n).T - 20
    aa, a_s = rng.normal(23e-6, 1e-6, n), rng.normal(8e-6, 0.5e-6, n)
    drawn = rng.normal(800, 0.7e-3, n) * (1 + a_s * ts) / (1 + aa * ta)
    # a standard deviation from 400 000 draws has a relative standard uncertainty of 0.11 %
    assert found.u == pytest.approx(drawn.std(), rel=6e-3)
    assert found.length == pytest.approx(drawn.mean(), abs=5 * found.u / np.sqrt(n))


def test_without_correlations_the_lines_add_up():
    found = standardised_length(300.0, Body(23e-6, 1e-6, 21.0, 0.3), Body(8e-6, 1e-6, 20.5, 0.2), u_indicated=1e-3)
    assert len(found.contributions) == 7
    assert np.linalg.norm([u for _, u in found.contributions]) == pytest.approx(found.u, rel=1e-12)


def test_at_20_degrees_only_the_product_is_left_of_the_coefficient():
    found = dict(standardised_length(1000.0, Body(12e-6, 1e-6, 20.0, 0.5)).contributions)
    assert found["expansion coefficient of artefact"] == 0
    assert found["coefficient × temperature of artefact"] == pytest.approx(0.5e-3)


def test_a_granite_table_one_kelvin_warmer_on_top():
    # 6.5e-6/K over 200 mm: radius of curvature 30.8 km
    table = Table(6.5e-6, 200.0)
    assert table.rotation(1000.0, 1.0) / ARCSECOND == pytest.approx(6.70, abs=0.01)
    assert table.bow(1000.0, 1.0) == pytest.approx(4.06e-3, abs=1e-5)


def test_the_bow_is_the_sagitta_of_the_arc_that_the_rotation_describes():
    table, length = Table(6.5e-6, 200.0), 900.0
    x = np.linspace(0, length, 20_001)
    slope = -np.array([table.rotation(d, 1.3) for d in x])
    height = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(x))])
    chord = height[-1] * x / length
    assert (height - chord).max() == pytest.approx(table.bow(length, 1.3), rel=1e-6)


@pytest.mark.parametrize(
    "call",
    [
        lambda: standardised_length(1.0, Body(u_cte=-1e-6)),
        lambda: standardised_length(1.0, Body(), u_indicated=float("nan")),
        lambda: standardised_length(1.0, Body(), cte_correlation=1.5),
        lambda: Table(6.5e-6, 0.0),
    ],
)
def test_what_cannot_be_is_refused(call):
    with pytest.raises(CmmUqError):
        call()
