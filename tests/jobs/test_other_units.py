"""Keys and columns in another unit are refused with the right conversion."""

from __future__ import annotations

import pytest

from cmm_uq.base.files.numbers import conversion

KEYS = (
    "length_mm",
    "u_um",
    "cte_per_k",
    "temperature_c",
    "u_temperature_k",
    "squareness_arcsec",
    "time_s",
    "pressure_hpa",
)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("U_um", "Give u_um = U/k, the standard uncertainty: U is k times as large"),
        ("u_ppm", "Give u_um = u_ppm · L / 1000, with the length L in mm"),
        ("u_um_per_m", "Give u_um = u_um_per_m · L / 1000, with the length L in mm"),
        ("u_mm", "Give u_um = 1000 · u_mm"),
        ("u_inch", "Give u_um = 25400 · u_inch"),
        ("length_in", "Give length_mm = 25.4 · length_in"),
        ("length_m", "Give length_mm = 1000 · length_m"),
        ("cte_ppm_per_k", "Give cte_per_k = 1e-6 · cte_ppm_per_k"),
        ("cte_per_f", "Give cte_per_k = 1.8 · cte_per_f"),
        ("temperature_f", "Give temperature_c = (temperature_f − 32) / 1.8"),
        ("temperature_k", "Give temperature_c = temperature_k − 273.15"),
        ("u_temperature_f", "Give u_temperature_k = u_temperature_f / 1.8"),
        ("squareness_deg", "Give squareness_arcsec = 3600 · squareness_deg"),
        ("dof", "Give u_um = u · √(ν/(ν − 2)), the standard deviation of a t distribution with ν degrees of freedom"),
        ("u", None), ("length", None), ("colour", None),
    ],
)  # fmt: skip
def test_the_fix_is_the_conversion(given: str, told: str | None) -> None:
    assert conversion(given, KEYS) == told


@pytest.mark.parametrize(
    ("given", "value", "known", "converted"),
    [
        ("u_ppm", 2.0, "u_um", 2.0 * 500 / 1000),
        ("temperature_f", 68.0, "temperature_c", 20.0),
        ("length_in", 1.0, "length_mm", 25.4),
    ],
)
def test_the_formulas_are_right_for_known_figures(given: str, value: float, known: str, converted: float) -> None:
    """2 ppm of half a metre are a micrometre; 68 °F are 20 °C; an inch is 25.4 mm."""
    told = conversion(given, [known])
    assert told is not None
    formula = told.partition(" = ")[2].partition(",")[0].replace("−", "-").replace("·", "*").replace(given, repr(value))
    assert eval(formula, {"L": 500}) == pytest.approx(converted)
