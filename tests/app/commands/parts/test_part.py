"""A part from its job to what is found: the machine verified and refused, values, decisions, and what nobody saw."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq import __version__
from cmm_uq.analysis.machine.state import MachineState
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.setup import plan_of, refuse_unfit
from cmm_uq.app.commands.certificates.further import GivenRecordings, given_recordings
from cmm_uq.app.commands.parts.machine import standing_of, state_machine, verified
from cmm_uq.app.commands.parts.part import PartOptions, affordable, decide_limits, evaluate_part
from cmm_uq.app.commands.reading import job_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.part.measurement import PartMeasurement, part_results
from cmm_uq.certificate.part.method import decided_without
from cmm_uq.certificate.verify.decisions import check_part_decisions
from cmm_uq.certificate.verify.figures import check_verdicts
from cmm_uq.certificate.verify.given import Inquiry, given_of
from cmm_uq.jobs.part.job import TABLES, read_part
from cmm_uq.machine.physics.catalogue import effects
from tests.conftest import ROOT
from tests.jobs.part.parts import NOBODY, plate, tables
from tests.part_machines import MACHINE, THERE, by_certificate, by_results, plate_of, report, results_keys
from tests.part_reports import nothing_foreseen
from tests.result_keys import PART_RESULTS

once = pytest.fixture(autouse=True)(nothing_foreseen)
TRIALS = 4000


def test_features_that_are_found_anew_each_time_have_fewer_virtual_measurements_by_default() -> None:
    """The plate has 60 points, of its bore 24: one zone of it counts as 1200 more, so that 158 730 are made; two as 2400."""
    plan = plan_of(plate_of(by_results(), **THERE))
    assert affordable(200_000, plan) == 200_000
    bore = next(one for one in plan.characteristics if "bore" in one.features)
    others = tuple(one for one in plan.characteristics if one is not bore)
    one = replace(plan, characteristics=(*others, replace(bore, association="maximum_inscribed")))
    assert affordable(200_000, one) == 200_000 * 1000 // (60 + 50 * 24)
    both = replace(
        one, characteristics=(*one.characteristics, replace(bore, name="by zone", association="minimum_zone"))
    )
    assert affordable(200_000, both) == 200_000 * 1000 // (60 + 2 * 50 * 24)


@cache
def plain() -> PartMeasurement:
    """The plate with its nominal points, by the machine's certificate."""
    return evaluate_part(plate_of(by_certificate()), PartOptions(trials=TRIALS))


@cache
def shifted() -> PartMeasurement:
    """The plate with its bore measured 20 µm off along x, by figures and draws of the machine alone."""
    off = np.zeros((60, 3))
    off[36:, 0] = 0.02
    return evaluate_part(plate_of(by_results(), off, **THERE), PartOptions(trials=TRIALS))


@pytest.mark.long
def test_a_certificate_is_verified_and_its_recording_conditions_the_errors() -> None:
    standing = plain().standing
    assert (standing.source, standing.verdict, standing.given_recording) == ("certificate", "NOT WHOLLY CHECKED", True)
    assert [one.what.partition(" of ")[0] for one in standing.checked if one.why] == [
        "computing again",
        "texts and layout",
    ]
    assert (standing.date, standing.age) == (dt.date(2026, 1, 1), dt.timedelta(days=150))
    assert standing.origin == "simulated"
    assert "150 days" in standing.drift
    assert not [one for one in plain().given.machine.unmodelled if one.effect.name == "rotation_x_x"]  # drawn together


@pytest.mark.long
def test_what_is_stated_to_be_in_doubt_at_the_calibration_is_in_the_machine_given_its_recording() -> None:
    """0.5 K of a steel gauge are 5.75 ppm of every scale; nothing moves where that is declared negligible."""
    folder = ROOT / "examples" / "step-gauge-simulated"
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    declared = b'temperature = { by = "the simulation", reason = "the gauge was simulated at 20 \xc2\xb0C" }\n'
    assert declared in files["job.toml"]
    stated = (
        files["job.toml"]
        .replace(declared, b"")
        .replace(
            b"[test_uncertainty.negligible]",
            b"[test_uncertainty]\nu_temperature_k = 0.5\n[test_uncertainty.negligible]",
        )
    )
    found = []
    for toml in (files["job.toml"], stated):
        job = job_of({**files, "job.toml": toml})
        own = effects(job.facts.model.effects)
        state = MachineState(job.points.machine, own, np.zeros((1, sum(len(one.coefficients) for one in own))))
        machine = given_recordings(state, job, (), (), None, 1)
        assert machine.given
        found.append(machine.state.draws[:, :3].std(axis=0))
    np.testing.assert_allclose(found[1], np.hypot(found[0], 5.75), rtol=0.03)


@pytest.mark.long
def test_figures_and_draws_alone_are_taken_too_and_said_to_be_less() -> None:
    standing = shifted().standing
    assert (standing.source, standing.given_recording) == ("results", False)
    assert any("recording is not at hand" in text for text in shifted().warnings)
    assert {one.effect.name for one in shifted().given.machine.unmodelled} >= {"rotation_x_x", "hysteresis_x"}


@pytest.mark.long
def test_chain_travel_and_place_are_the_certificates_where_the_job_leaves_them_out() -> None:
    machine = plain().given.machine.machine
    np.testing.assert_array_equal(machine.travel_mm, [[0, 900], [0, 1200], [-600, 0]])
    read = plain().origin_mm + plain().plan.points - [0, 0, -150] + machine.origin_mm + 2 * plain().plan.normals
    np.testing.assert_allclose((read.min(axis=0) + read.max(axis=0)) / 2, [450, 600, -300], atol=0.5)


@pytest.mark.long
def test_a_machines_job_states_the_same_as_its_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Draws of one posterior, of which a file has some in single precision: means and spreads agree to a few of a hundred."""
    unchanged = "cmm_uq.app.commands.parts.machine.given_recordings"
    monkeypatch.setattr(unchanged, lambda state, *_: GivenRecordings(state, say("")))
    from cmm_uq.jobs.part.job import read_part
    from tests.part_machines import plate_files

    (tmp_path / "plate").mkdir()
    (tmp_path / "machine").symlink_to(ROOT / "examples" / MACHINE)
    files = plate_files({}, machine_state={"job": "../machine"})
    (tmp_path / "plate" / "job.toml").write_bytes(files["job.toml"])
    found = state_machine(read_part(tmp_path / "plate"))
    state, stated = found.state, shifted().given.machine
    assert (found.standing.source, found.standing.verdict) == ("job", "ANALYSED")
    assert [one.name for one in state.effects] == [one.name for one in stated.effects]
    spread = stated.draws.std(axis=0)
    assert np.all(np.abs(state.mean - stated.mean) < 0.1 * spread)
    np.testing.assert_allclose(state.draws.std(axis=0), spread, rtol=0.1)
    np.testing.assert_allclose(state.noise.usual_mm, stated.noise.usual_mm, rtol=0.05)


@pytest.mark.long
def test_a_value_is_what_was_measured_less_the_mean_error_and_of_a_zone_zero_at_least() -> None:
    found = shifted()
    assert found.measured is not None
    assert found.job.measured is not None
    np.testing.assert_allclose(found.measured, evaluated(found.plan, found.job.measured))
    assert found.measured[0] == pytest.approx(30.0, abs=1e-6)
    assert found.measured[1] == pytest.approx(2 * 0.02, rel=1e-3)  # a position is twice the distance
    for stated, value, zone in zip(found.stated, found.measured, never_negative(found.plan), strict=True):
        assert stated.value is not None
        if zone:
            assert 0 <= max(stated.value, stated.interval[0]) <= stated.interval[1]
        else:
            assert stated.value == pytest.approx(value - stated.error)


def test_without_measured_points_nothing_is_decided_but_what_would_be_accepted_is_told() -> None:
    found = plain()
    assert found.outcome is None
    assert found.together is None
    assert all(one is not None and one.outcome is None and one.probability is None for one in found.judged)
    squareness = found.judged[2]
    assert squareness is not None
    assert squareness.accepted is not None
    assert 0 < float(squareness.accepted[1] or 0) < 0.05


def test_of_a_perfect_zone_acceptance_goes_by_all_errors_about_zero() -> None:
    """A position is accepted up to its tolerance less 1.645 root mean squares of what a perfect one is found as."""
    random = np.random.default_rng(5)
    job = plate_of(by_results(), characteristic=[TABLES["characteristic"][1]])
    errors = 2e-3 * np.abs(random.standard_normal((20_000, 1)))
    (found,) = decide_limits(job, plan_of(job), errors, None)
    assert found is not None
    assert found.accepted == (None, pytest.approx(0.1 - 1.645 * 2e-3, abs=1e-4))


def test_the_whole_part_conforms_no_more_probably_than_any_of_its_characteristics() -> None:
    found = shifted()
    chances = [one.probability for one in found.judged if one is not None and one.probability is not None]
    assert len(chances) == 5
    assert found.together is not None
    assert max(0.0, sum(chances) - len(chances) + 1) - 1e-3 <= found.together <= min(chances) + 1e-3


def test_margins_are_in_standard_uncertainties_from_the_nearest_limit() -> None:
    found = shifted()
    assert found.margins[0] == pytest.approx((0.05 - abs((found.stated[0].value or 0) - 30)) / found.stated[0].u)
    assert found.nearest == int(np.argmin(found.margins))


def test_a_correlation_is_one_with_itself_and_symmetric() -> None:
    found = plain().correlation
    np.testing.assert_allclose(np.diagonal(found), 1)
    np.testing.assert_allclose(found, found.T)
    drawn = np.corrcoef(plain().virtual.errors(np.random.default_rng(9), 20_000).T)
    np.testing.assert_allclose(found, drawn, atol=6 / np.sqrt(TRIALS))


def test_what_the_calibration_did_not_see_is_named_with_its_share() -> None:
    """Play shows in no measurement of balls' centres, and is as large as physics allows."""
    first = next(one for one in plain().unseen if one.characteristic == "1")
    assert first.effect in ("hysteresis_x", "hysteresis_y")
    shares = dict(zip(plain().budget.causes, plain().budget.total[:, 0].tolist(), strict=True))
    assert first.share == pytest.approx(shares[first.line])
    assert all(one.share >= 0.05 for one in plain().unseen)


def test_results_say_what_was_found_with_hashes_of_all_inputs() -> None:
    found = shifted()
    data = json.loads(as_json(part_results(found)))
    assert data["schema"] == "cmm-uq/part/1"
    assert set(data["job"]["inputs_sha256"]) == {"job.toml", "points.csv", *by_results()}
    one, stated = data["characteristics"][1], found.stated[1]
    assert (one["unit"], one["value"], one["u"]) == ("mm", pytest.approx(stated.value), pytest.approx(stated.u))
    size = data["characteristics"][0]
    assert size["measured"] - size["mean_error"] == pytest.approx(size["value"])
    low, high = found.simulated.interval[found.stated.index(stated)]
    wide = stated.interval[1] if stated.value == 0 else 0.0  # of a zone that is stated as zero U reaches to the end
    assert one["U"] == pytest.approx(max((high - low) / 2, wide))  # of the errors; the interval of a zone ends at zero
    assert one["interval95"] == pytest.approx(stated.interval)
    assert data["decision"]["outcome"] == found.outcome
    assert data["simulation"]["virtual_measurements"] == TRIALS
    matrix = np.array(data["covariance"]["matrix"])
    np.testing.assert_allclose(np.sqrt(np.diagonal(matrix)), [each["u"] for each in data["characteristics"]])


def test_every_key_of_results_is_told_in_the_reference_and_no_other() -> None:
    told, there = set(PART_RESULTS), set(results_keys(json.loads(as_json(part_results(shifted())))))
    empty = {"further", "simulation.not_drawn", "machine.changes", "machine.families", "machine.bounds", "machine.axes"}
    assert there - told - empty == set()
    sometimes = (
        "job.number",
        "job.language",
        "simulation.not_drawn[]",
        "further",
        "machine.changes[]",
        "machine.families[]",
        "machine.bounds[]",
        "machine.passed[]",
        "machine.axes[]",
        "machine.further[]",
        "machine.against[]",
        "other_methods.",
        "reported.",
        "decision.withheld",
        "iso17025[]",  # of what was measured
        "records",  # of what was written
    )
    assert {key for key in told - there if not key.startswith(sometimes)} == set()


def test_angles_are_in_degrees_in_results() -> None:
    asked = {"name": "a", "what": "angle", "features": ["A", "B"], "lower_deg": 89.0, "upper_deg": 91.0}
    job = plate_of(by_results(), np.zeros((60, 3)), characteristic=[asked], **THERE)
    found = evaluate_part(job, PartOptions(trials=1000))
    data = part_results(found)["characteristics"][0]
    assert data["unit"] == "°"
    assert data["measured"] == pytest.approx(90.0, abs=1e-6)
    assert data["u"] == pytest.approx(np.degrees(found.stated[0].u))
    assert data["limits"]["upper"] == pytest.approx(91.0)


def tampered() -> dict[str, bytes]:
    """A figure that is another than that of the estimate's own interval, and no longer as the hash of the manifest."""
    files = by_certificate()
    data = json.loads(report()["results.json"])
    data["job"]["date"] = "2026-02-01"
    return {
        **files,
        "machine/results.json": as_json(data),
        "machine/posterior-simulated.npz": report()["posterior-simulated.npz"],
    }


def other_draws() -> dict[str, bytes]:
    files = by_results()
    content = bytearray(files["machine/posterior-simulated.npz"])
    content[2000] ^= 1
    return {**files, "machine/posterior-simulated.npz": bytes(content)}


def without_posterior() -> dict[str, bytes]:
    data = json.loads(report()["results.json"])
    data["posterior"] = None
    return {**by_results(), "machine/posterior.npz": b"", "machine/results.json": as_json(data)}


REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (tampered, {}, "the machine's certificate does not verify: "),
    (other_draws, {}, "does not verify: posterior-simulated.npz: is not the file whose hash results.json has"),
    (without_posterior, {}, "states too little: it has no draws"),
    (lambda: {"machine/certificate.xml": report()["certificate-simulated.xml"]},
     {"machine_state": {"certificate": "machine/certificate.xml"}}, "states too little: neither draws"),
    (by_results, {"machine_state": {"certificate": "machine", "valid_until": dt.date(2026, 5, 30)}},
     "has expired: it held until 2026-05-30, and the part was measured on 2026-05-31"),
    (by_results, {"job": {"id": "plate", "date": dt.date(2025, 12, 31), "origin": "simulated"}},
     "was calibrated on 2026-01-01, after the part was measured on 2025-12-31"),
    (by_certificate, {"machine_state": {"certificate": "machine", "chain": "FXYZ"}}, "is of chain XYZ, and the job says FXYZ"),
    (by_certificate, {"machine_state": {"certificate": "machine", "travel_mm": {"x": [0.0, 500.0]}}},
     "has a travel of x of 0 to 900 mm, and the job says 0 to 500 mm"),
    (by_certificate, {"placing": {"origin_mm": [850.0, 300.0, -500.0]}}, "beyond its travel of 0 to 900 mm"),
    (by_results, {}, "nothing says how far axis x goes"),
    (by_results, {"machine_state": {"job": "../machine"}}, "a part's job in memory has no other job beside it"),
]  # fmt: skip


@pytest.mark.parametrize(("machine", "changes", "words"), REFUSED, ids=[words[:40] for _, _, words in REFUSED])
def test_a_machine_whose_certificate_does_not_hold_is_refused(
    machine: Any, changes: dict[str, Any], words: str
) -> None:
    placed = THERE if machine in (by_results, other_draws) and "nothing says" not in words else {}
    with pytest.raises(CmmUqError, match=words.replace("(", r"\(")) as raised:
        evaluate_part(plate_of(machine(), **{**placed, **changes}), PartOptions(trials=1000))
    assert raised.value.fix


@pytest.mark.parametrize("last", [dt.date(2026, 5, 31), dt.date(2026, 6, 1)])
def test_a_certificate_holds_until_its_last_day(last: dt.date) -> None:
    state = {**THERE["machine_state"], "valid_until": last}
    found = state_machine(plate_of(by_results(), machine_state=state))
    assert found.standing.valid_until == last


@pytest.mark.long
def test_a_certificate_of_another_version_is_computed_again_but_where_a_correction_touches_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """This version may compute what an earlier one did, not what one after it may have corrected."""
    for module in ("certificates.verification", "certificates.again", "parts.machine"):
        monkeypatch.setattr(f"cmm_uq.app.commands.{module}.__version__", "99.0.0")
    job = plate_of(by_certificate())
    after = state_machine(job, rerun=True)
    assert not any("computed again" in one for one in after.warnings)
    assert any(one.count and one.what.startswith("computed again") for one in after.standing.checked)
    for module in ("certificates.verification", "certificates.again", "parts.machine"):
        monkeypatch.setattr(f"cmm_uq.app.commands.{module}.__version__", "0.1.0")
    (first, *_) = state_machine(job, rerun=True).warnings
    assert "was to be computed again and was not: version " in first
    assert __version__ in first
    assert "0.1.0" in first
    assert not any("computed again" in one for one in state_machine(job).warnings)


def test_temperatures_outside_of_the_calibrations_are_told() -> None:
    warm = {"scales_c": [23.0, 23.0, 23.0]}
    told = state_machine(plate_of(by_results(), environment=warm, **THERE)).warnings
    assert any("23 to 23 °C; the temperature of the calibration is not known" in text for text in told)


@pytest.mark.parametrize(("table", "changes", "lacks"), [
    ("environment", {}, ""),
    ("environment", {"u_part_k": 0.0}, "temperatures"),
    ("part", {"cte_per_k": 0.0}, "expansion of the part"),
    ("part", {"u_cte_per_k": 0.0}, ""),  # at 20 °C it acts on nothing
    ("stylus", {"u_diameter_um": 0.0, "lobing_um": 0.0},
     "qualification of the styli and pre-travel of the probe by direction"),
    ("stylus", {"lobing_um": 0.0}, "pre-travel of the probe by direction"),
    ("negligible", {"clamping": None}, "clamping"),
    ("negligible", {"operators": None, "gradients": None}, "operators and uneven and drifting temperatures"),
    ("stylus", {"u_diameter_um": 0.0}, "qualification of the styli"),
    ("stylus", {"u_diameter_um": 0.0, "lobing_um": 0.0, "diameter_mm": 0.0}, ""),
])  # fmt: skip
def test_a_decision_says_of_what_no_uncertainty_is_stated(table: str, changes: dict[str, float], lacks: str) -> None:
    found = shifted()
    facts, own = found.job.facts, getattr(found.job.facts, table)
    other = [one.model_copy(update=changes) for one in own] if table == "stylus" else own.model_copy(update=changes)
    there = replace(found, job=replace(found.job, facts=facts.model_copy(update={table: other})))
    assert [str(text).rpartition(": ")[2] for text in decided_without(there)] == ([f"{lacks}."] if lacks else [])
    assert not decided_without(replace(there, measured=None))


def stating(**changes: Any) -> PartMeasurement:
    """The plate, had its job stated these tables."""
    found = shifted()
    return replace(
        found, job=replace(found.job, facts=plate(job=tables()["job"] | {"origin": "simulated"}, **changes).facts)
    )


@pytest.mark.parametrize(("changes", "lacks"), [
    ({}, ""),
    ({"placing": {"u_fixture_um": 0.1}, "probing": {"u_operator_um": 0.1}, "negligible": None},
     "uneven and drifting temperatures"),
    ({"environment": {"u_part_k": 0.1, "u_scales_k": 0.1}}, "temperatures"),  # of the scales' expansion not a word
    ({"environment": {"u_part_k": 0.1, "scales_cte_per_k": 0.0, "u_gradient_k_per_m": [0.1, 0.1, 0.1], "u_drift_k": 0.1},
      "negligible": {"clamping": NOBODY, "operators": NOBODY}}, ""),
    ({"negligible": None}, "clamping, operators and uneven and drifting temperatures"),
])  # fmt: skip
def test_what_may_be_declared_negligible_is_stated_or_declared(changes: dict[str, Any], lacks: str) -> None:
    there = stating(**changes)
    assert [str(text).rpartition(": ")[2] for text in decided_without(there)] == ([f"{lacks}."] if lacks else [])


@pytest.mark.parametrize(("offsets", "lacks"), [
    ([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], False), ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], True),
])  # fmt: skip
def test_tips_whose_places_to_each_other_nobody_states_pass_nothing(offsets: list[list[float]], lacks: bool) -> None:
    (down,), features = tables()["stylus"], tables()["feature"]
    styli = [down | {"name": name, "u_offset_um": u} for name, u in zip(("down", "side"), offsets, strict=True)]
    probed = [one | {"stylus": "side" if one["name"] == "bore" else "down"} for one in features]
    assert bool(decided_without(stating(stylus=styli, feature=probed))) == lacks


@pytest.mark.parametrize(("standing", "lack"), [
    ({}, ""), ({"origin": "measured"}, ""), ({"origin": "measured", "circular": True}, "certified on that machine."),
    ({"origin": "measured", "interim": True}, "and no calibration."),
    ({"origin": "measured", "against": (say("…"),)}, "statements of the machine contradict each other."),
    ({"origin": "simulated"}, "its calibration is no measurement."),
    ({"origin": "compensated"}, "its calibration is no measurement."),
])  # fmt: skip
def test_a_measured_part_conforms_by_a_machine_that_somebody_measured_independently(
    standing: dict[str, Any], lack: str
) -> None:
    """A part measured on a machine that is simulated passed, with a warning beside it."""
    found = shifted()
    if standing:
        facts = found.job.facts.model_copy(
            update={"job": found.job.facts.job.model_copy(update={"origin": "measured"})}
        )
        found = replace(found, job=replace(found.job, facts=facts), standing=replace(found.standing, **standing))
    assert [str(text).endswith(lack) for text in decided_without(found)] == ([True] if lack else [])


def test_the_iotas_certificate_says_that_its_artefact_was_certified_on_it() -> None:
    """By the inputs inside the PDF, and by what results.json alone says is missing."""
    folder = ROOT / "examples" / "part-iota"
    whole = read_part(folder)
    assert standing_of(whole, verified(whole)).circular
    inside = given_of(whole.machine_files).files
    figures = plate_of({f"machine/{name}": inside[name] for name in ("results.json", "posterior.npz")}, **THERE)
    assert standing_of(figures, verified(figures)).circular
    assert not standing_of(plate_of(by_certificate()), verified(plate_of(by_certificate()))).circular


def test_the_report_of_an_interim_check_is_known_as_one() -> None:
    files = by_results()
    results = next(name for name in files if name.endswith("results.json"))
    said = json.loads(files[results])
    for interim in (None, True):
        said["job"]["interim"] = interim
        part = plate_of({**files, results: as_json(said)}, **THERE)
        assert standing_of(part, verified(part)).interim == bool(interim)


def test_what_is_stated_and_declared_is_refused() -> None:
    with pytest.raises(CmmUqError, match="has a figure, and is declared negligible") as raised:
        plate(placing={"u_fixture_um": 0.1})
    assert "[negligible] clamping" in str(raised.value.where)


@pytest.mark.parametrize(("environment", "form", "lacks"), [
    ({}, {}, ""), ({"scales_cte_per_k": 1e-5}, {}, ""), ({"scales_cte_per_k": 1e-5, "u_scales_k": 0.0}, {}, "temperatures"),
    ({"u_part_k": 0.0}, {"field_um": 0.0, "roughness_um": 0.0}, "temperatures and form and roughness of the part"),
])  # fmt: skip
def test_nothing_conforms_by_an_uncertainty_that_lacks_what_the_job_does_not_state(
    environment: dict[str, float], form: dict[str, float], lacks: str
) -> None:
    """A plate measured without an error, which passed with a warning."""
    plain = tables()
    asked = {"form": plain["form"] | form, "characteristic": plain["characteristic"][:2]}
    changes = {"environment": plain["environment"] | environment, **asked}
    found = evaluate_part(plate_of(by_results(), np.zeros((60, 3)), **changes, **THERE), PartOptions(trials=1000))
    told = [f"Nothing is called conforming, for the job states no uncertainty of these: {lacks}."] if lacks else []
    assert [str(text) for text in found.withheld] == told == [str(one) for one in found.warnings if str(one) in told]
    assert {*found.outcomes} == ({"undecided"} if lacks else {"pass", "undecided"})
    data = json.loads(as_json(part_results(found)))
    assert data["decision"]["outcome"] == data["verdicts"]["overall"] == "undecided"
    assert {text for one in data["verdicts"]["statements"] for text in one["missing"]} == {*told}
    inquiry = Inquiry()
    check_part_decisions(inquiry, data, "results.json")
    check_verdicts(inquiry, data, "results.json")
    assert not inquiry.findings


def test_a_check_says_what_would_stop_the_command(tmp_path: Path) -> None:
    """Of the machine's certificate too, without drawing anything."""
    from cmm_uq.app.commands.jobs.check import check_job
    from tests.part_machines import plate_files

    for name, content in plate_files(other_draws(), **THERE).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    found = check_job(tmp_path)
    assert ["does not verify" in one.problem for one in found.problems] == [True]
    (tmp_path / "machine" / "posterior-simulated.npz").write_bytes(report()["posterior-simulated.npz"])
    assert (check_job(tmp_path).sound, check_job(tmp_path).command) == (True, "part")


def test_a_check_reaches_as_far_as_the_axes_of_the_certificate(tmp_path: Path) -> None:
    from cmm_uq.app.commands.jobs.check import check_job
    from tests.part_machines import plate_files

    for name, content in plate_files(by_certificate(), placing={"origin_mm": [850.0, 300.0, -500.0]}).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    assert ["beyond its travel of 0 to 900 mm" in one.problem for one in check_job(tmp_path).problems] == [True]


def test_a_machine_s_job_that_is_not_there_stops_the_check(tmp_path: Path) -> None:
    from cmm_uq.app.commands.jobs.check import check_job
    from tests.part_machines import plate_files

    for job, words in (("../nowhere", "no such file"), (".", "is the part's own job")):
        for name, content in plate_files({}, machine_state={"job": job}).items():
            (tmp_path / name).write_bytes(content)
        assert [words in one.problem for one in check_job(tmp_path).problems] == [True]


def test_limits_of_a_distance_that_are_deviations_from_it_are_refused() -> None:
    said = [{"name": "1", "what": "distance", "features": ["bore", "B"], "lower_mm": -0.05, "upper_mm": 0.05}]
    with pytest.raises(CmmUqError, match=r"limits of -0\.05 to 0\.05 mm, where the distance is 40 mm") as raised:
        refuse_unfit(plate_of(by_certificate(), characteristic=said))
    assert raised.value.where == "job.toml: [[characteristic]] 1"
