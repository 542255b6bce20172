"""What a test asks of artefact, probe and temperature, and what the keys of a job say of them."""

from __future__ import annotations

import datetime as dt
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.conformity.own_rule import NAME as OWN_RULE
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import NOT_CONVERGED, Statement
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.certificate.clauses import formal_warnings
from cmm_uq.jobs.tables.conformity import (
    Circumstances,
    ConformityFacts,
    ProbeFacts,
    RatedConditions,
    TestUncertainty,
)
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity.recorded import STATED, bars, gauge, sphere
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT
from tests.recordings import with_columns

E0 = "ISO 10360-2:2009"


def judged(artefact: Artefact, under: Circumstances | None = None, standard: str = E0, **wish: object) -> Statement:
    facts = ConformityFacts(standard=standard, **({"limit_um": 60.0} | wish))
    span = {"b89_range_um": Quantity(5.0, 3.0, (0.0, 9.0), "µm")}
    return statement(facts, artefact, span, "[[conformity]] 1", (BARS, FORMS, LENGTHS), None, under or STATED)


# --- limits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mpe", "at_20", "at_800"), [
    ({"a_um": 2.5, "k": 300.0}, 2.5 + 20 / 300, 2.5 + 800 / 300),
    ({"a_um": 2.5, "k": 300.0, "b_um": 4.0}, 2.5 + 20 / 300, 4.0),
    ({"b_um": 4.0}, 4.0, 4.0),
])  # fmt: skip
def test_a_maximum_permissible_error_has_three_forms(mpe: dict[str, float], at_20: float, at_800: float) -> None:
    found = judged(gauge([np.eye(3)[0]], [[20.0, 800.0]]), limit_um=None, mpe=MaximumPermissibleError(**mpe))
    assert {item.length_mm: item.limit_um for item in found.errors} == pytest.approx({20.0: at_20, 800.0: at_800})


@pytest.mark.parametrize("mpe", [{}, {"a_um": 1.0}, {"k": 300.0}, {"k": 300.0, "b_um": 3.0}])
def test_half_a_formula_is_none(mpe: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="mpe"):
        MaximumPermissibleError(**mpe)


# --- the probe -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("standard", "sensing"), [
    (E0, "optical"), ("ISO 10360-5:2010", "optical"), ("ISO 10360-8:2013", "contacting"), ("VDI/VDE 2617-2.1", "optical"),
])  # fmt: skip
def test_a_standard_of_other_probes_is_refused(standard: str, sensing: str) -> None:
    under = replace(STATED, probe=ProbeFacts(sensing=sensing))
    artefact = gauge() if standard.startswith(("ISO 10360-2", "VDI")) else sphere()
    with pytest.raises(
        CmmUqError, match=rf"{re.escape(standard)} is for (contacting|optical) probes.*ISO 10360-8:2013"
    ):
        judged(artefact, under, standard)


def test_b89_takes_any_probe() -> None:
    assert judged(bars(), replace(STATED, probe=ProbeFacts(sensing="optical")), "ASME B89.4.1-1997").scope == "complete"


def test_a_probe_of_unknown_sort_shows_no_optical_test() -> None:
    assert 'an optical probe ([probe] sensing = "optical")' in judged(sphere(), None, "ISO 10360-8:2013").missing


# --- the artefact ----------------------------------------------------------------------------------------------------


def there_and_back(senses: tuple[float, float]) -> StepGauge:
    """Seven lines, the first face met in one sense of travel and the others in another."""
    artefact = gauge()
    direction = artefact.directions()
    sense = np.where(artefact.points.point == 1, *senses)[:, None] * np.sign(
        np.where(abs(direction) > 1e-9, direction, 0.0)
    )
    columns = {f"approach_{a}": sense[:, i] for i, a in enumerate("xyz")}
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
    return StepGauge(facts, with_columns(artefact.points, **columns))


def test_lengths_are_bidirectional_where_their_ends_are_met_from_opposite_sides() -> None:
    assert judged(there_and_back((1.0, -1.0))).missing == ()
    (told,) = judged(there_and_back((1.0, 1.0))).missing
    assert told.startswith("bidirectional lengths: these are not, and no short gauge")


def test_a_ballbar_measures_no_bidirectional_length() -> None:
    assert any(text.startswith("bidirectional lengths") for text in judged(bars()).missing)


@pytest.mark.parametrize(
    ("cte", "enough"), [(None, True), (11.5e-6, True), (8e-6, True), (7.9e-6, False), (0.5e-6, False), (23e-6, False)]
)
def test_a_gauge_of_another_expansion_wants_a_length_of_normal_expansion(cte: float | None, enough: bool) -> None:
    found = judged(gauge(), Circumstances(cte_per_k=cte))
    assert any("normal expansion" in text for text in found.missing) != enough


def test_a_warm_gauge_of_unknown_expansion_is_remarked() -> None:
    """23 °C: 3 K of 11.5 µm/m are 34.5 µm in a metre."""
    warm = gauge()
    warm.points = with_columns(warm.points, temp_artefact_c=np.full(len(warm.points), 23.0))
    unknown = judged(warm, replace(STATED, cte_per_k=None))
    assert any("up to 3 K from 20 °C" in text and "34 µm wrong in a metre" in text for text in unknown.remarks)
    assert not any("from 20 °C" in text for text in judged(warm, Circumstances(cte_per_k=11.5e-6)).remarks)


@pytest.mark.parametrize(("diameter", "enough"), [(9.9, False), (10.0, True), (50.0, True), (50.1, False)])
def test_a_test_sphere_has_ten_to_fifty_millimetres(diameter: float, enough: bool) -> None:
    artefact = sphere()
    artefact.sizes = (
        type(artefact.sizes[0])("length_mm", artefact.sizes[0].title, artefact.sizes[0].unit, diameter, 1e-4),
    )
    assert (judged(artefact, None, "ISO 10360-5:2020").scope == "complete") == enough


def test_rated_conditions_that_were_not_kept_make_no_pass() -> None:
    artefact = gauge()
    artefact.points = with_columns(artefact.points, temp_artefact_c=np.full(len(artefact.points), 17.0))
    kept, broken = (replace(STATED, rated=RatedConditions(temperature_c=[low, 22.0])) for low in (16.0, 18.0))
    assert judged(artefact, kept).outcome == "pass"
    found = judged(artefact, broken)
    assert (found.outcome, found.missing) == ("incomplete", ("rated temperature 18 to 22 °C (17 to 17 °C)",))


# --- u ---------------------------------------------------------------------------------------------------------------


def test_the_whole_budget_decides_and_not_the_calibration_alone() -> None:
    """820 mm, 1 K off, u(α) 1.2e-6, u(t) 0.04 K, fixturing 0.1: √(0.4² + 0.984² + 0.3772² + 0.1²) = 1.1308 µm, not 0.40."""
    artefact = gauge([np.eye(3)[0]], [[20.0, 820.0]], length_mm=820.0, u_um=0.4)
    artefact.points = with_columns(artefact.points, temp_artefact_c=np.full(len(artefact.points), 21.0))
    stated = TestUncertainty(u_cte_per_k=1.2e-6, u_temperature_k=0.04, u_fixturing_um=0.1)
    found = judged(artefact, Circumstances(stated, cte_per_k=11.5e-6))
    assert max(item.u_um for item in found.errors) == pytest.approx(np.sqrt(0.4**2 + 0.984**2 + 0.3772**2 + 0.1**2))
    assert found.budget is not None
    assert found.budget.u * 1e3 == pytest.approx(found.u_um)


def test_the_form_of_a_sphere_is_uncertain_by_half_of_it_and_by_its_calibration() -> None:
    """√(0.1² + 0.05²) µm."""
    found = judged(sphere(form_um=0.2), Circumstances(TestUncertainty(u_form_um=0.05)), "ISO 10360-5:2010")
    assert found.u_um == pytest.approx(np.hypot(0.1, 0.05))


def test_a_bar_is_uncertain_by_what_changes_between_its_positions() -> None:
    """300 mm of steel, 0.1 K: 0.345 µm; fixturing 0.2 µm; each twice. Its certificate cancels."""
    stated = TestUncertainty(u_temperature_k=0.1, u_fixturing_um=0.2)
    found = judged(bars(), Circumstances(stated, cte_per_k=11.5e-6), "ASME B89.4.1-1997")
    assert found.u_um == pytest.approx(np.sqrt(2) * np.hypot(0.345, 0.2))


# --- keys of a job ---------------------------------------------------------------------------------------------------

EXAMPLE = ROOT / "examples" / "step-gauge-simulated"


def job(folder: Path, change: dict[str, str] | None = None, more: str = "") -> Path:
    text = (EXAMPLE / "job.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?ms)^\[test_uncertainty\.negligible\].*?(?=^\[\[conformity)", "", text)
    for old, new in (change or {}).items():
        assert old in text
        text = text.replace(old, new)
    (folder / "job.toml").write_text(text + more, encoding="utf-8")
    (folder / "recording.csv").write_bytes((EXAMPLE / "recording.csv").read_bytes())
    return folder


def test_an_expanded_uncertainty_stands_for_a_standard_one(tmp_path: Path) -> None:
    found = read_job(job(tmp_path, {"u_um = 0.4": "U_um = 0.8\nk = 2.0"}))
    assert found.facts.artefact.u_um == pytest.approx(0.4)


@pytest.mark.parametrize(
    "keys",
    [
        "U_um = 0.8",
        "u_um = 0.4\nU_um = 0.8\nk = 2.0",
        "U_um = 0.8\nk = 0.5",
        'U_um = "x"\nk = 2.0',
        "U_um = true\nk = 2.0",
    ],
)
def test_half_an_expanded_uncertainty_is_refused(tmp_path: Path, keys: str) -> None:
    with pytest.raises(CmmUqError, match=r"U_um|is no uncertainty of a length: write it as"):
        read_job(job(tmp_path, {"u_um = 0.4": keys}))


def test_the_tables_of_a_test_are_read(tmp_path: Path) -> None:
    more = """
[test_uncertainty]
u_cte_per_k = 6e-7
[rated_conditions]
temperature_c = [18.0, 22.0]
[probe]
sensing = "contacting"
"""
    found = read_job(job(tmp_path, None, more))
    under = found.facts.circumstances
    assert (under.uncertainty.u_cte_per_k, under.rated.temperature_c, under.probe.sensing) == (
        6e-7,
        [18.0, 22.0],
        "contacting",
    )
    assert under.cte_per_k == pytest.approx(1.15e-5)


@pytest.mark.parametrize(("more", "told"), [
    ("[test_uncertainty]\nu_cte = 1e-6\n", r"\[test_uncertainty\] u_cte: unknown key"),
    ("[rated_conditions]\ntemperature_c = [22.0, 18.0]\n", "first number must be the lower one"),
    ('[probe]\nsensing = "laser"\n', r"\[probe\] sensing"),
])  # fmt: skip
def test_what_they_cannot_say_is_refused_by_key(tmp_path: Path, more: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        read_job(job(tmp_path, None, "\n" + more))


@pytest.mark.parametrize(("more", "change"), [
    ('\n[probe]\nsensing = "optical"\n', {}),
    ("", {'chain = "XYZ"': 'chain = "XYZ"\ndigitizer = { offset_mm = [0.0, 0.0, 1.0], poses = [ { alpha_deg = 0.0, '
          "beta_deg = 0.0, gamma_deg = 0.0 } ] }"}),
])  # fmt: skip
def test_a_recording_with_an_optical_probe_is_refused_before_anything_is_computed(
    tmp_path: Path, more: str, change: dict[str, str]
) -> None:
    told = r"\[conformity\].*ISO 10360-2:2009 is for contacting probes.*State ISO 10360-8:2013"
    with pytest.raises(CmmUqError, match=told):
        read_job(job(tmp_path, change, more))


@pytest.mark.long
def test_a_certificate_warns_of_a_warm_gauge_of_unknown_expansion(tmp_path: Path) -> None:
    """Recorded at 23 °C; the example states 11.5e-6 /K."""
    folder = job(tmp_path, {"cte_per_k = 1.15e-05\n": ""})
    head, *rows = (folder / "recording.csv").read_text(encoding="utf-8").splitlines()
    text = "\n".join([f"{head},temp_artefact_c", *(f"{row},23" for row in rows)])
    (folder / "recording.csv").write_text(text, encoding="utf-8")
    (warned,) = [text for text in cmm_uq.report(folder).warnings if "its expansion is not stated" in text]
    assert warned.startswith("The artefact was up to 3 K from 20 °C")


# --- calibrations ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("certificate", "key"), [
    ("date = 2003-09-01\ndue = 2004-08-31", "due"), ("date = 2003-08-31\ninterval_months = 12", "due"),
    ("date = 2004-09-02\ndue = 2005-09-02", "date"), ("date = 2004-08-01\ndue = 2004-07-31", "due"),
    ("date = 2003-09-01\ndue = 2004-09-01", None), ("date = 2004-09-01", None), ("due = 2004-09-01", None), ("", None),
])  # fmt: skip
def test_a_certificate_of_lengths_holds_on_the_day_unless_its_dates_deny_it(
    certificate: str, key: str | None, iota: Path, tmp_path: Path
) -> None:
    """Measured on 2004-09-01; both days at the ends count."""
    text = (
        (iota / "job.toml")
        .read_text(encoding="utf-8")
        .replace("[artefact.certificate]\n", "[artefact.certificate]\n" + certificate + "\n")
    )
    shutil.copytree(iota, tmp_path / "job")
    (tmp_path / "job" / "job.toml").write_text(text, encoding="utf-8")
    found = read_job(tmp_path / "job").circumstances.lapsed
    keys = {at for _, at in found} - {"[artefact.certificate] machine"}  # of the iota's own machine, by the example
    assert keys == (set() if key is None else {f"[artefact.certificate] {key}"}), found


@pytest.mark.parametrize(("limit_um", "outcome"), [(60.0, "incomplete"), (0.01, "remeasure")])
def test_a_calibration_that_did_not_hold_makes_no_pass_and_hides_nothing_worse(limit_um: float, outcome: str) -> None:
    lack = say("traceability (artefact: it was due)")
    under = replace(STATED, lapsed=((lack, "[artefact.certificate] due"),))
    found = judged(gauge(errors={(2, 1, 20.0): 1.25}), under, limit_um=limit_um)
    assert judged(gauge(errors={(2, 1, 20.0): 1.25}), limit_um=limit_um).outcome == (
        "pass" if limit_um > 1 else "remeasure"
    )
    assert (found.outcome, lack in found.missing) == (outcome, True)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize(("example", "u", "tolerances", "undecided"), [
    # 79 ± 40 ppm, 80 ± 33 with an exact length; a squareness comes from comparing bars with each other
    ("iota-1102-20C", "u_um", {"scale_x": 115.0, "squareness_xy": 300.0}, {"scale_x.ppm"}),
    # places of balls: 11.91 ± 0.65″, 11.91 ± 0.58″ with exact ones
    ("plate-simulated", "u_um", {"scale_x": 60.0, "squareness_xy": 300.0}, {"scale_x.ppm", "squareness_xy.angle_arcsec"}),
    ("sphere-simulated", "u_um", {"probe_radius": 5.0, "probe_lobing": 5.0}, {"probe_radius.um"}),
])  # fmt: skip
def test_a_tolerance_on_what_rests_on_a_size_without_uncertainty_is_no_pass(
    example: str, u: str, tolerances: dict[str, float], undecided: set[str], tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "examples" / example, tmp_path / "job")
    text = re.sub(r"(?m)^machine = .*$", "", (tmp_path / "job" / "job.toml").read_text(encoding="utf-8"))
    for stated in ("", rf"(?m)^{u} = .*\n"):
        text = re.sub(stated, "", text) if stated else text
        asked = ", ".join(f"{name} = {limit}" for name, limit in tolerances.items())
        job = re.sub(r"(?m)^effects = .*$", rf"\g<0>\ntolerances = {{ {asked} }}", text)
        job = re.sub(r"(?s)\[\[conformity\]\].*", "", job)
        (tmp_path / "job" / "job.toml").write_text(job, encoding="utf-8")
        found = {one.name: one for one in analyse(tmp_path / "job").verdicts}
        withheld = {
            name for name, one in found.items() if any("given without an uncertainty" in text for text in one.missing)
        }
        assert withheld == (undecided if stated else set())
        assert all(found[name].outcome == "undecided" for name in withheld)
        assert len(found) == len(tolerances)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize(("changed", "lack"), [
    ("[[thermometer]]\ncolumns = ['temp_x_c']\ncertificate = { due = 2004-08-31 }", "the calibration was due on 2004-08-31"),
    ("[[thermometer]]\ncolumns = ['temp_x_c']\ncertificate = { due = 2004-09-01 }", None),
    ("[[thermometer]]\ncolumns = ['temp_artefact_c']\ncertificate = { due = 2004-08-31 }", None),  # which is not recorded
    ("[artefact.certificate]\nmachine = 'DEA Iota 1102'", "artefact: a certificate from another machine"),
])  # fmt: skip
def test_thermometers_out_of_calibration_and_the_machine_as_its_own_reference_make_no_pass(
    changed: str, lack: str | None, iota: Path, tmp_path: Path
) -> None:
    """Measured on 2004-09-01: 79 ± 40 ppm pass 150 ppm."""
    shutil.copytree(iota, tmp_path / "job")
    text = re.sub(r"(?m)^machine = .*$", "", (tmp_path / "job" / "job.toml").read_text(encoding="utf-8"))
    head, _, rest = changed.partition("\n")
    text = text.replace(head, f"{head}\n{rest}") if head in text else f"{text}\n{changed}\n"
    text = re.sub(r"(?m)^effects = .*$", r"\g<0>\ntolerances = { scale_x = 150.0 }", text)
    (tmp_path / "job" / "job.toml").write_text(text, encoding="utf-8")
    rows = (tmp_path / "job" / "ballbar.csv").read_text(encoding="utf-8").splitlines()
    rows = [rows[0] + ",temp_x_c", *(f"{row},20.0" for row in rows[1:])]
    (tmp_path / "job" / "ballbar.csv").write_text("\n".join(rows), encoding="utf-8")
    found = analyse(tmp_path / "job").verdicts[-1]
    assert found.outcome == ("pass" if lack is None else "undecided")
    assert [lack in str(text) for text in found.missing] == ([] if lack is None else [True])
    out_of_order = [str(text) for text in formal_warnings(read_job(tmp_path / "job")) if "Dates out" in text]
    assert len(out_of_order) == (lack is not None and "calibration" in lack)


def test_a_job_without_a_date_beside_dated_certificates_says_that_the_day_is_missing() -> None:
    frame = pd.read_csv(ROOT / "examples" / "iota-1102-20C" / "ballbar.csv")
    artefact = {"kind": "ballbar", "length_mm": 404.2357, "u_um": 1.5, "certificate": {"date": dt.date(2003, 9, 1)}}
    job = cmm_uq.job(frame, machine="DEA Iota 1102", artefact=artefact, effects=["scale_x"])
    (lapsed,) = job.circumstances.lapsed
    assert lapsed == ("traceability (artefact: the day of the measurement is not stated)", "[job] date")
    assert not [text for text in formal_warnings(job) if "1970" in text]


def test_figures_of_draws_that_did_not_converge_pass_nothing() -> None:
    """The page says that they must not be used."""
    found = analysed("sphere-simulated")
    model = found.job.facts.model.model_copy(update={"tolerances": {"probe_lobing": 2.0}})
    job = replace(found.job, facts=found.job.facts.model_copy(update={"model": model}))
    for rhat_max, outcome in ((1.0, "pass"), (1.5, "undecided")):
        posterior = replace(found.posterior, rhat_max=rhat_max)
        assert replace(found, job=job, posterior=posterior).verdicts[-1].outcome == outcome
    axis = cast("ShiftResult", analysed("shift-source-simulated"))
    facts = ConformityFacts(
        standard=OWN_RULE,
        characteristic="linearity",
        limit_um=1000.0,
        rule="simple",
        complete=CompleteTest(measurements=1, repeats=1, points=1),
    )
    wished = replace(axis.job, facts=axis.job.facts.model_copy(update={"conformity": [facts]}))
    for rhat_max in (1.0, 1.5):
        chains = replace(axis.estimate.chains, rhat_max=rhat_max)
        (one,) = replace(axis, job=wished, estimate=replace(axis.estimate, chains=chains)).statements
        assert (NOT_CONVERGED in one.missing) == (rhat_max > 1.01)
