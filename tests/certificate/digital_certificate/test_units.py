"""Units of figures by their keys, their products and ratios in D-SI."""

from __future__ import annotations

from math import isclose

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.units import UNITS, unit
from cmm_uq.certificate.digital_certificate.figures import dsi_of, product, ratio, unit_of

UNIT = st.sampled_from(sorted(UNITS))


@pytest.mark.parametrize(("key", "above", "symbol"), [
    ("error_um", None, "µm"), ("rms_um", unit("mm"), "µm"), ("U1", unit("mm"), "mm"), ("points", unit("mm"), "1"),
    ("probability", unit("µm"), "1"), ("axes_differ_probability", unit("µm"), "1"), ("k", unit("µm"), "1"),
    ("slope_ppm", None, "ppm"), ("arcsec_per_m", None, "″/m"), ("turned_deg", None, "°"), ("covariance_mm2", None, "mm²"),
    ("normal", None, "1"), ("warmer_by_k", None, "K"),
])  # fmt: skip
def test_a_key_names_its_unit_or_has_that_above_or_none(key: str, above: object, symbol: str) -> None:
    assert unit_of(key, above) is UNITS[symbol]  # type: ignore[arg-type]


@pytest.mark.filterwarnings("ignore")  # PTB's parser warns of its own tables when it is loaded
@given(UNIT, UNIT)
def test_products_and_ratios_are_valid_and_of_the_right_size(one: str, other: str) -> None:
    """By PTB's parser of D-SI."""
    dsi = pytest.importorskip("dsi_unit")
    a, b = UNITS[one], UNITS[other]
    for made, size in ((product(a.dsi, b.dsi), a.si * b.si), (ratio(a.dsi, b.dsi), a.si / b.si)):
        found = dsi.DsiUnit(made)
        assert found.valid
        assert not found.warnings
        assert isclose(found.to_base_unit_tree().scale_factor, size, rel_tol=1e-9), made


def test_a_unit_that_d_si_does_not_know_is_marked_as_such() -> None:
    assert dsi_of("turns a day") == "|turns_a_day"
    assert ratio("|furlong", r"\metre") == r"|furlong/(\metre)"
    assert product(r"\metre", "|furlong") == r"|\metre·furlong"
