"""A certificate that replaces another says itself what differs, and no word says that nothing does where something does."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.certificates.release import compared, refuse_denied
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.identification import ReplacedCertificate as Replaced, denies_a_change
from tests.app.cli.laboratory import PLACE, reported
from tests.app.cli.process import run


def quantity(value: float, U: float) -> dict[str, Any]:
    return {"value": value, "u": U / 2, "interval95": [value - U, value + U], "U": U, "k": 2.0}


def decided(decision: str, value: float, *errors: float) -> dict[str, Any]:
    return {
        "standard": "ISO 10360-2:2009", "characteristic": "E0", "quantity": "largest error", "value_um": value, "u_um": 0.1,
        "limit_um": 2.5, "decision": decision,
        "errors": [{"measurement": 1, "repeat": i, "length_mm": 20.0, "error_um": error, "U_um": 0.2}
                   for i, error in enumerate(errors, 1)],
    }  # fmt: skip


def results(**parts: Any) -> dict[str, Any]:
    """A results.json of two figures and a decision, with other parts."""
    return {
        "schema": "cmm-uq/results/1", "estimates": {"scale_x": {"ppm": quantity(5.123, 1.0)}},
        "accuracy_uncertainty": {"b89_range_um": quantity(7.0, 0.5)}, "conformity": [decided("pass", 2.17, 2.17, -0.3)],
    } | parts  # fmt: skip


def sentences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    return [str(one.sentence) for one in compared("K-1", before, after).differences]


def test_the_same_result_in_a_new_layout_is_equal_and_what_is_new_is_no_difference() -> None:
    laid_out = json.loads(json.dumps(results(), sort_keys=True))
    laid_out |= {"software": {"version": "9"}, "further": {"deep": [{"um": quantity(1.0, 0.1)}]}}
    found = compared("K-1", results(), laid_out)
    assert found.differences == ()
    assert [(one.what, one.before, one.after) for one in found.added] == [("further.deep[0].um", "", "1.00 ± 0.10")]
    assert found.compared == 8  # conformity, E0, its limit; scale, range, E0's value, two errors


def test_a_decision_stands_first_and_each_difference_has_its_unit() -> None:
    after = results(conformity=[decided("undecided", 2.32, 2.32, -0.3)])
    assert sentences(results(), after) == [
        "conformity: pass → undecided", "ISO 10360-2:2009 E0: pass → undecided",
        "E0: largest error: 2.17 ± 0.20 µm → 2.32 ± 0.20 µm",
        "ISO 10360-2:2009 E0, 20 mm, measurement 1, repeat 1: 2.17 µm → 2.32 µm",
    ]  # fmt: skip


@pytest.mark.parametrize(("value", "U", "differs"), [
    (5.123, 1.0, False), (5.1499, 1.0, False), (5.051, 1.0, False), (5.151, 1.0, True), (5.123, 1.04, False),
    (5.123, 1.06, True),
])  # fmt: skip
def test_figures_are_compared_as_they_are_printed(value: float, U: float, differs: bool) -> None:
    """5.123 ± 1.0 is printed 5.1 ± 1.0."""
    found = sentences(results(), results(estimates={"scale_x": {"ppm": quantity(value, U)}}))
    assert bool(found) == differs


def test_what_the_new_certificate_does_not_have_any_more_is_a_difference() -> None:
    assert sentences(results(), results(accuracy_uncertainty={})) == ["B89 range: 7.00 ± 0.50 µm → none"]
    gone = sentences(results(), results(conformity=[]))
    assert gone[:2] == ["conformity: pass → none", "ISO 10360-2:2009 E0: pass → none"]
    free = {"undetermined": [{"scale_x.ppm": 1.0}]}
    assert sentences(results(), results(identifiability=free)) == ["Scale error of X: 5.1 ± 1.0 ppm → none"]


def test_a_tolerance_that_is_exceeded_now_is_a_difference() -> None:
    before, after = ({"scale_x": {"ppm": 25.0, "verdict": verdict}} for verdict in ("in", "out"))
    assert sentences(results(tolerances=before), results(tolerances=after)) == [
        "conformity: pass → fail", "scale_x.ppm: pass → fail",
    ]  # fmt: skip


def test_points_of_a_curve_are_figures() -> None:
    curve = {"position_mm": [0.0, 10.0], "error_um": [0.0, 1.234], "U_um": [0.0, 0.5]}
    moved = {"curves": {"x": {**curve, "error_um": [0.0, 1.334]}}}
    assert sentences(results(curves={"x": curve}), results(**moved)) == ["curves.x.error_um[1]: 1.23 µm → 1.33 µm"]


@pytest.mark.parametrize("words", [
    "no figure changed", "Serial number of the artefact; no figure", "Figures are unchanged", "the results remain the same",
    "address only; no changes of results", "None of the figures changed", "without change of the results",
    "keine Zahl geändert", "Kein Wert wurde geändert",
    "Die Werte bleiben unverändert", "ohne Änderung der Ergebnisse",
    "aucun chiffre n'a changé", "les résultats sont inchangés", "sans modification des valeurs",
    "数値の変更なし", "数値に変更はありません", "結果は変わりません",
])  # fmt: skip
def test_words_that_deny_a_change_are_recognised_in_every_language_of_certificates(words: str) -> None:
    assert denies_a_change(words)
    with pytest.raises(ValueError, match="figures_changed = true"):
        Replaced(number="K", date=dt.date(2026, 1, 1), reason="r", changed=words, figures_changed=True)


@pytest.mark.parametrize("words", [
    "name of the bar", "E0: 2.17 → 2.32 µm", "Seriennummer des Normals", "Werte neu berechnet", "numéro de série",
    "シリアル番号の変更", "値を再計算した", "no longer states a scale", "the number of the order",
])  # fmt: skip
def test_words_that_say_what_is_changed_deny_nothing(words: str) -> None:
    assert not denies_a_change(words)


def test_a_denial_is_refused_where_anything_differs_and_only_there() -> None:
    refuse_denied(compared("K-1", results(), results()), "here")
    with pytest.raises(
        CmmUqError, match=r"no figure is changed against certificate K-1, and 2 differ: E0.* → 2\.32 ± 0\.20 µm"
    ):
        refuse_denied(compared("K-1", results(), results(conformity=[decided("pass", 2.32, 2.32, -0.3)])), "here")


REPLACES = """
[job.replaces]
number = "K-1"
date = 2026-01-02
reason = "the diameter was typed wrongly"
"""


def replacing(folder: Path, further: str, **exchanged: str) -> Path:
    """The laboratory's job anew as K-2, that replaces K-1."""
    job = Path(shutil.copytree(folder / "job", folder / "again"))
    toml = (job / "job.toml").read_text(encoding="utf-8").replace('number = "K-1"', 'number = "K-2"')
    toml = toml.replace("\n[laboratory]", f"{REPLACES}{further}\n\n[laboratory]", 1)
    for old, new in exchanged.items():
        assert old in toml
        toml = toml.replace(old, new)
    (job / "job.toml").write_text(toml, encoding="utf-8")
    return job


def again(folder: Path, *options: str, out: str = "again") -> Any:
    return run(
        "report", folder / "again", "--out", folder / "reports" / out, "--records", folder / PLACE, "--quiet", *options
    )


@pytest.fixture
def laboratory(tmp_path: Path) -> Path:
    return reported(tmp_path)


@pytest.mark.long
def test_the_same_figures_with_another_address_are_compared_and_none_differs(laboratory: Path) -> None:
    replacing(laboratory, 'changed = "address of the customer; no figure"\nfigures_changed = false')
    done = again(laboratory)
    assert done.returncode == 0, done.stderr
    found = json.loads((laboratory / "reports/again/results.json").read_bytes())
    assert found["replaced"]["differences"] == []
    assert found["replaced"]["compared"] > 5
    page = (laboratory / "reports/again/certificate.html").read_text(encoding="utf-8")
    assert "decisions and figures none differs" in page
    verified = run("verify", laboratory / "reports/again/certificate.pdf")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    released = run("release", "K-2", "--by", "A. Huber", "--records", laboratory / PLACE)
    assert released.returncode == 0, released.stderr


@pytest.mark.long
def test_another_diameter_is_printed_before_and_after_and_no_figure_is_refused(laboratory: Path) -> None:
    (recording,) = (laboratory / "job").glob("*.csv")
    job = replacing(laboratory, 'changed = "no figure changed"')
    rows = recording.read_text(encoding="utf-8").splitlines()
    (job / recording.name).write_text("\n".join([*rows[:-1], ""]), encoding="utf-8")
    done = again(laboratory)
    assert done.returncode == 2
    assert "says that no figure is changed against certificate K-1, and" in done.stderr
    assert not (laboratory / "reports/again").exists()
    text = (
        (job / "job.toml")
        .read_text(encoding="utf-8")
        .replace("no figure changed", "the last row was of another machine")
    )
    (job / "job.toml").write_text(text, encoding="utf-8")
    assert (done := again(laboratory)).returncode == 0, done.stderr
    page = (laboratory / "reports/again/certificate.html").read_text(encoding="utf-8")
    found = json.loads((laboratory / "reports/again/results.json").read_bytes())["replaced"]
    assert "Differences from certificate K-1" in page
    assert all(one["before"] in page and one["after"] in page for one in found["differences"])
    digital = (laboratory / "reports/again/certificate.xml").read_text(encoding="utf-8")
    assert f"{found['differences'][0]['before']}" in digital


@pytest.mark.long
def test_results_that_are_gone_are_compared_with_what_the_records_have_of_them(laboratory: Path) -> None:
    replacing(laboratory, 'changed = "address of the customer"')
    shutil.rmtree(laboratory / "reports" / "mount")
    assert (done := again(laboratory)).returncode == 0, done.stderr
    found = json.loads((laboratory / "reports/again/results.json").read_bytes())["replaced"]
    assert (found["differences"], found["added"]) == ([], [])
    assert found["compared"] > 5


@pytest.mark.long
def test_without_records_the_certificate_says_that_nothing_was_compared_and_is_not_released_where_it_can_be(
    laboratory: Path,
) -> None:
    replacing(laboratory, 'changed = "address of the customer"')
    done = run(
        "report", laboratory / "again", "--out", laboratory / "reports" / "again", "--records", "none", "--quiet"
    )
    assert done.returncode == 0, done.stderr
    page = (laboratory / "reports/again/certificate.html").read_text(encoding="utf-8")
    assert "No comparison of the results was made: those of the replaced certificate were not at hand." in page
    added = run("records", "import", laboratory / "reports" / "again", "--records", laboratory / PLACE)
    assert added.returncode == 0, added.stderr
    refused = run("release", "K-2", "--by", "A. Huber", "--records", laboratory / PLACE)
    assert refused.returncode == 2
    assert "K-2 replaces K-1, which these records have, and does not say what differs" in refused.stderr


@pytest.mark.long
def test_a_named_file_of_another_machine_is_refused(laboratory: Path) -> None:
    job = replacing(laboratory, 'changed = "address"\nresults = "before.json"')
    data = json.loads((laboratory / "reports/mount/results.json").read_bytes())
    for text, code in (
        (data, 0),
        ({**data, "job": {**data["job"], "serial": "78", "machine": "Other"}}, 2),
        ({"schema": 1}, 2),
    ):
        (job / "before.json").write_text(json.dumps(text), encoding="utf-8")
        done = again(laboratory, "--force")
        assert done.returncode == code, done.stderr
