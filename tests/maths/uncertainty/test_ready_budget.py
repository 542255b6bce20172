"""Ready budgets and ready models in a file: the formula of the standard by hand, and Monte Carlo as the second way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.budget import write_budget
from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import cap_directions, fit_sphere
from cmm_uq.maths.uncertainty.budgets.machine import use_by_calibrated_workpiece
from cmm_uq.maths.uncertainty.budgets.tables import TABLES
from cmm_uq.maths.uncertainty.models.ready import READY
from tests.app.cli.process import run

READINGS = (100.0042 + 1e-3 * np.sin(7.0 * np.arange(20))).round(5)
USE = f"""
[budget]
method = "ISO 15530-3"
title = "Bore of 100 mm"
readings_mm = {READINGS.tolist()}
calibrated_mm = 100.0
u_calibration_um = 0.5
temperature_c = 22.0
u_cte_calibrated_per_k = 0.5e-6
u_cte_workpieces_per_k = 1e-6
u_form_um = 0.3
"""
SIMULATED = f"""
[budget]
method = "ISO 15530-4"
simulated_errors_um = {np.random.default_rng(2).normal(1.0, 2.0, 400).round(4).tolist()}
not_simulated = [ {{ name = "temperature of the workpiece", u_um = 1.5, source = "judgement" }} ]
"""
LENGTH = """
[budget]
method = "ISO/TS 23165 length"
error_um = 1.2
length_mm = 500.0
u_calibration_um = 0.2
temperature_c = 21.0
cte_per_k = 11.5e-6
u_cte_per_k = 1e-6
u_temperature_k = 0.05
u_alignment_um = 0.1
u_fixturing_um = 0.15
"""
PROBING = '[budget]\nmethod = "ISO/TS 23165 probing"\nerror_um = 1.9\nform_um = 0.2\nu_form_um = 0.05\n'
BALLBAR = """
[budget]
method = "ballbar length"
length_mm = 400.0
direction = [3, 4, 0]
u_centre_um = [0.3, 0.4, 1.0]
form_shift_um = 0.6
probe_um = 1.5
probe_common = 0.5
scale_um = [12, 18, 6]
u_squareness_arcsec = [1, 2, 3]
u_temperature_k = 0.1
cte_per_k = 12e-6
"""
SPHERE = """
[budget]
method = "sphere fit"
centre_mm = [1.0, 2.0, 3.0]
radius_mm = 12.7
points = 4000
cap_deg = 85.0
u_point_um = 9.0
sphericity_um = 5.08
"""


def written(folder: Path, text: str) -> dict[str, object]:
    file = folder / "task.toml"
    file.write_text(text, encoding="utf-8")
    return dict(json.loads(write_budget(file, folder / "out").results))


def stated(folder: Path, text: str, output: str) -> tuple[float, float, float]:
    """Value, u and U, mm."""
    found = written(folder, text)["outputs"][output]  # type: ignore[index]
    low, high = found["interval"]
    assert found["value"] == pytest.approx((low + high) / 2)
    return found["value"], found["u"], (high - low) / 2


def test_iso_15530_3_is_twice_the_root_of_calibration_scatter_expansion_and_form(tmp_path: Path) -> None:
    """U = 2 √(u_cal² + u_p² + u_b² + u_w²), b = mean − calibrated (ISO 15530-3:2011, 7.3)."""
    value, u, U = stated(tmp_path, USE, "systematic_error")
    u_p = np.sqrt(np.sum((READINGS - READINGS.mean()) ** 2) / 19)
    expected = np.sqrt(0.5e-3**2 + u_p**2 + (2 * 0.5e-6 * 100) ** 2 + (2 * 1e-6 * 100) ** 2 + 0.3e-3**2)
    assert value == pytest.approx(READINGS.mean() - 100.0, abs=1e-9)
    assert u == pytest.approx(expected, rel=1e-9)
    assert pytest.approx(2 * expected, rel=1e-6) == U
    told = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert told["ready"] == "ISO 15530-3"
    assert told["U_without_correction_mm"] == pytest.approx(2 * expected + value, rel=1e-6)
    page = (tmp_path / "out" / "budget.html").read_text(encoding="utf-8")
    assert "It is not the test uncertainty" in page
    assert "by the ready budget" in page


def test_corrected_results_lie_within_u_as_often_as_the_distributions_say() -> None:
    """4000 processes reading by reading, against 400 000 draws of normal and χ² distributions: 94 %.

    The mean of 20 readings adds a twentieth of the scatter's variance, which the standard leaves out.
    """
    random, n = np.random.default_rng(11), 400_000
    off = random.normal(0, 1, n) - random.normal(0, 0.5, n) - random.normal(0, 1 / np.sqrt(20), n)
    expected = np.mean(np.abs(off) < 2 * np.sqrt(0.25 + random.chisquare(19, n) / 19))
    assert expected == pytest.approx(0.941, abs=0.002)
    inside = 0
    for _ in range(4000):
        calibration, process = random.normal(0, 0.5e-3), 4e-3
        readings = 100.0 + calibration + process + random.normal(0, 1e-3, 20)
        budget = use_by_calibrated_workpiece(readings, 100.0, 0.5e-3)
        inside += abs(process + random.normal(0, 1e-3) - (budget.value or 0.0)) < budget.expanded
    assert inside / 4000 == pytest.approx(expected, abs=5 * np.sqrt(0.94 * 0.06 / 4000))


def test_iso_15530_4_adds_what_was_not_simulated(tmp_path: Path) -> None:
    errors = np.random.default_rng(2).normal(1.0, 2.0, 400).round(4) * 1e-3
    value, u, U = stated(tmp_path, SIMULATED, "error")
    assert value == pytest.approx(errors.mean())
    assert u == pytest.approx(np.hypot(errors.std(ddof=1), 1.5e-3))
    assert 1.96 * u < U < 1.98 * u


def test_the_test_uncertainty_of_a_length_is_its_five_lines(tmp_path: Path) -> None:
    value, u, U = stated(tmp_path, LENGTH, "E")
    lines = [0.2e-3, 500 * 1e-6, 500 * 11.5e-6 * 0.05, 0.1e-3, 0.15e-3]
    assert value == pytest.approx(1.2e-3)
    assert u == pytest.approx(np.sqrt(np.sum(np.square(lines))))
    assert pytest.approx(2 * u) == U


def test_the_test_uncertainty_of_probing_is_half_the_form_and_its_calibration(tmp_path: Path) -> None:
    value, u, U = stated(tmp_path, PROBING, "P")
    assert (value, u) == (pytest.approx(1.9e-3), pytest.approx(np.hypot(0.1e-3, 0.05e-3)))
    assert pytest.approx(2 * u) == U


def test_a_ballbar_s_lines_enter_by_its_direction(tmp_path: Path) -> None:
    """Along (0.6, 0.8, 0): by hand, limits as rectangular distributions."""
    value, u, _ = stated(tmp_path, BALLBAR, "length")
    scatter = 2 * ((0.6 * 0.3) ** 2 + (0.8 * 0.4) ** 2)
    limits = (2 * 0.6**2 + 2 * 1.5**2 - 2 * 0.5 * 1.5**2 + (0.36 * 12) ** 2 + (0.64 * 18) ** 2) / 3
    square = (0.48 * 400 * np.radians(1 / 3600) * 1e3) ** 2
    warm = (0.1 * 12e-6 * 400e3) ** 2
    assert value == 400.0
    assert u * 1e3 == pytest.approx(np.sqrt(scatter + limits + square + warm), rel=1e-9)
    (tmp_path / "mean").mkdir()
    _, mean_u, _ = stated(tmp_path / "mean", f"{BALLBAR}repetitions = 20\n", "length")
    assert mean_u * 1e3 == pytest.approx(np.sqrt(scatter / 20 + limits + square + warm), rel=1e-9)


@pytest.mark.long
def test_a_sphere_has_the_scatter_of_repeated_fits_and_the_form_of_its_ball(tmp_path: Path) -> None:
    """Second method: 300 fits of a cap with 9 µm of noise know u to 4 %; form along the line of sight 1.2 µm (docs)."""
    random, directions = np.random.default_rng(7), cap_directions(np.radians(85.0), 4000)
    fits = [fit_sphere((12.7 + random.normal(0, 9e-3, (4000, 1))) * directions).centre for _ in range(300)]
    budget = written(tmp_path, SPHERE)["outputs"]
    for axis, scatter in zip("xyz", np.std(fits, axis=0), strict=True):
        lines = {line["input"]: line for line in budget[axis]["budget"]}  # type: ignore[index]
        assert lines["scatter of the points"]["u"] == pytest.approx(scatter, rel=0.2)
    form = {line["input"]: line for line in budget["z"]["budget"]}["form of the ball"]  # type: ignore[index]
    assert form["u"] == pytest.approx(1.2e-3, abs=0.05e-3)
    told = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    # scatter and form both move height and radius against each other
    assert -1 < told["output_correlation"][2][3] < -0.5


def test_python_reads_the_same_file(tmp_path: Path) -> None:
    file = tmp_path / "use.toml"
    file.write_text(USE, encoding="utf-8")
    found = cmm_uq.budget(file).stated["systematic_error"]
    assert found.coverage_factor == 2.0
    assert found.reason == "U = k u with k = 2, which the standard prescribes"


def test_the_command_prints_the_result(tmp_path: Path) -> None:
    (tmp_path / "use.toml").write_text(USE, encoding="utf-8")
    done = run("budget", "use.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert "systematic_error = 0.004" in done.stdout


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (USE.replace("u_form_um", "u_from_um"), r"line 11: \[budget\] u_from_um: unknown key.*u_form_um"),
        (USE.replace("calibrated_mm = 100.0\n", ""), r"\[budget\] calibrated_mm: is missing"),
        (USE.replace("15530-3", "15530-2"), r"there is no ready budget 'ISO 15530-2'"),
        (USE.replace('method = "ISO 15530-3"\n', ""), r"\[budget\] method: is missing"),
        (
            USE.replace("u_calibration_um = 0.5", "u_calibration_um = -0.5"),
            r"u_calibration_um: input should be greater",
        ),
        ("budget = 3", r"method: is missing"),
        (BALLBAR.replace("[3, 4, 0]", "[0, 0, 0]"), "points nowhere"),
        (USE.replace(f"{READINGS.tolist()}", "[100.0, 100.1]"), "2 readings of the calibrated workpiece"),
    ],
)
def test_what_cannot_be_evaluated_is_refused_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        written(tmp_path, text)
    assert not (tmp_path / "out").exists()


def test_every_ready_budget_has_its_name_in_its_table() -> None:
    for name, table in TABLES.items():
        assert table.model_fields["method"].annotation.__args__ == (name,)  # type: ignore[union-attr]


def ready(name: str, inputs: dict[str, tuple[float, float]], more: str = "", method: str = "first") -> str:
    given = "".join(f'[inputs.{k}]\ndistribution = "normal"\nvalue = {v}\nu = {u}\n' for k, (v, u) in inputs.items())
    return f'[model]\nready = "{name}"\nmethod = "{method}"\n{more}{given}'


WARM = {"indicated_mm": (500.01, 5e-4), "workpiece_c": (21.0, 0.1), "workpiece_cte_per_k": (11.5e-6, 5e-7)}
SCALE = {"indicated_mm": (500.01, 5e-4), "reference_mm": (500.0, 1e-4), "workpiece_c": (20.0, 0.1),
         "workpiece_cte_per_k": (11.5e-6, 1e-9)}  # fmt: skip
SIDES = {"a_mm": (300.0, 1e-3), "b_mm": (400.0, 1e-3), "c_mm": (500.0, 2e-3)}
LASER = {"vacuum_mm": (400.1, 1e-5), "temperature_c": (20.3, 0.05), "pressure_pa": (99200.0, 20.0),
         "humidity_pct": (50.0, 2.0), "co2_ppm": (450.0, 50.0), "wavelength_nm": (632.9908, 1e-6)}  # fmt: skip


def test_a_warm_length_comes_to_20_degrees(tmp_path: Path) -> None:
    value, u, _ = stated(tmp_path, ready("length_at_20", WARM), "length")
    assert value == pytest.approx(500.01 / (1 + 11.5e-6), abs=1e-6)
    assert u == pytest.approx(np.sqrt(5e-4**2 + (500 * 11.5e-6 * 0.1) ** 2 + (500 * 5e-7) ** 2), rel=1e-4)


@pytest.mark.parametrize(("temperature", "indicated", "at_20"), [(25.0, 404.259, 404.235), (30.0, 404.292, 404.244)])
def test_the_published_bar_comes_to_20_degrees(
    tmp_path: Path, temperature: float, indicated: float, at_20: float
) -> None:
    """Harris 2004, steel of 12 µm/(m K)."""
    inputs = {
        "indicated_mm": (indicated, 1e-6),
        "workpiece_c": (temperature, 1e-6),
        "workpiece_cte_per_k": (12e-6, 1e-12),
    }
    assert stated(tmp_path, ready("length_at_20", inputs), "length")[0] == pytest.approx(at_20, abs=0.6e-3)


def test_scale_and_workpiece_each_bring_their_expansion(tmp_path: Path) -> None:
    """Second method: 400 000 draws, whose standard deviation has a relative standard uncertainty of 0.11 %."""
    inputs = {"indicated_mm": (800.0, 0.7e-3), "workpiece_c": (24.0, 0.3), "workpiece_cte_per_k": (23e-6, 1e-6),
              "scale_c": (22.5, 0.2), "scale_cte_per_k": (8e-6, 0.5e-6)}  # fmt: skip
    text = ready("length_at_20", inputs, method="second") + '[correlation]\n"workpiece_c,scale_c" = 0.8\n'
    value, u, _ = stated(tmp_path, text, "length")
    random, n = np.random.default_rng(1), 400_000
    ta, ts = random.multivariate_normal([4.0, 2.5], [[0.09, 0.048], [0.048, 0.04]], n).T
    grown = (1 + random.normal(8e-6, 0.5e-6, n) * ts) / (1 + random.normal(23e-6, 1e-6, n) * ta)
    drawn = random.normal(800, 0.7e-3, n) * grown
    assert u == pytest.approx(drawn.std(), rel=6e-3)
    assert value == pytest.approx(drawn.mean(), abs=5 * u / np.sqrt(n))


def test_a_scale_is_held_against_a_reference(tmp_path: Path) -> None:
    found = written(tmp_path, ready("scale_error", SCALE))["outputs"]["scale_error"]  # type: ignore[index]
    assert found["value"] == pytest.approx(-20e-6, rel=1e-4)
    assert found["u"] == pytest.approx(np.sqrt(1e-6**2 + 0.2e-6**2 + 1.15e-6**2), rel=1e-3)


def test_angles_of_a_triangle_have_their_correlation(tmp_path: Path) -> None:
    found = written(tmp_path, ready("triangle_angles", SIDES, more=""))
    gamma = found["outputs"]["gamma"]  # type: ignore[index]
    assert gamma["value"] == pytest.approx(np.pi / 2)
    assert gamma["unit"] == "rad"
    u = [found["outputs"][name]["u"] for name in ("alpha", "beta", "gamma")]  # type: ignore[index]
    # their sum is π whatever the sides, so its variance is zero
    assert np.asarray(u) @ np.array(found["output_correlation"]) @ np.asarray(u) == pytest.approx(0, abs=1e-15)


def test_a_laser_s_length_is_shortened_by_the_air(tmp_path: Path) -> None:
    """Against the refractive index by itself: 400.1 mm over n."""
    from cmm_uq.maths.uncertainty.air.state import Air, refractive_index
    from cmm_uq.maths.uncertainty.distributions import normal

    n, _ = refractive_index(Air(**{k: normal(*v) for k, v in LASER.items() if k != "vacuum_mm"}))
    value, u, _ = stated(tmp_path, ready("interferometer", LASER), "length")
    assert value == pytest.approx(400.1 / n, abs=1e-6)
    assert u == pytest.approx(
        np.sqrt((0.05 * 0.957e-6) ** 2 + (20 * 2.68e-9) ** 2 + (2 * 0.0086e-6) ** 2) * 400.1, rel=0.1
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (ready("length_at_21", WARM), "length_at_21.*Did you mean 'length_at_20'"),
        (ready("length_at_20", {**WARM, "workpiece_k": (1.0, 0.1)}), "'workpiece_k' is no input of this model"),
        (ready("length_at_20", {"indicated_mm": (1.0, 0.1)}), "the input 'workpiece_c' is missing"),
        (ready("length_at_20", WARM, 'outputs = { y = "1" }\n'), "outputs is given, and the ready model has its own"),
        (ready("length_at_20", WARM) + 'unit = "1/degF"\n', "workpiece_cte_per_k is taken in 1/K"),
        (ready("triangle_angles", {**SIDES, "c_mm": (800.0, 1.0)}), "close to no triangle"),
    ],
)
def test_a_ready_model_refuses_what_is_not_its(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        written(tmp_path, text)


def test_correlations_of_a_ready_model_are_the_file_s(tmp_path: Path) -> None:
    """Equal errors of a and b, 300 and 400 mm: dγ = −(300 + 400) · 1 µm / 120 000 mm, with c exact."""
    sides = {**SIDES, "c_mm": (500.0, 1e-9)}
    text = ready("triangle_angles", sides) + '[correlation]\n"a_mm,b_mm" = 1.0\n'
    found = written(tmp_path, text)["outputs"]["gamma"]  # type: ignore[index]
    assert found["u"] == pytest.approx(700 * 1e-3 / 120_000, rel=1e-5)


def test_every_ready_model_says_what_it_gives() -> None:
    assert set(READY) == {"length_at_20", "scale_error", "triangle_angles", "interferometer"}
    assert all(model.title[0].isupper() for model in READY.values())
