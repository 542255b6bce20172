"""A part by the values of another program: as by its points where both know as much, never better, and computed again."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.part.measurement import PartMeasurement, part_results
from cmm_uq.jobs.part.job import TABLES, part_of, read_part
from cmm_uq.jobs.verdicts import gravest
from tests.jobs.part.test_qif import document
from tests.part_machines import by_certificate, plate_files, plate_of
from tests.part_reports import nothing_foreseen
from tests.shared import put

once = pytest.fixture(autouse=True)(nothing_foreseen)
TRIALS = 4000
# the bore is off by 20 µm along x, and all else is nominal: worked out by hand, as another program may print it
VALUES = "characteristic,value_mm\n1,30.000000\n2,0.040000\n3,0.000000\n5,40.000000\n"


def job_files(values: str = VALUES, **changes: Any) -> dict[str, bytes]:
    files = plate_files(by_certificate(), recording={"values": "report.csv"}, **changes)
    return {**files, "report.csv": values.encode()}


@cache
def by_values() -> PartMeasurement:
    return evaluate_part(part_of(job_files()), PartOptions(trials=TRIALS))


@cache
def by_points() -> PartMeasurement:
    off = np.zeros((60, 3))
    off[36:, 0] = 0.02
    return evaluate_part(plate_of(by_certificate(), off), PartOptions(trials=TRIALS))


def test_values_have_the_uncertainty_of_the_points_that_they_come_from() -> None:
    """u of so many draws scatters by 1/√(2N), and both have as many; the mean error by u/√N."""
    stated, of_points = ({one.name: one for one in found.stated} for found in (by_values(), by_points()))
    for name in ("1", "5"):
        one, other = stated[name], of_points[name]
        assert one.u == pytest.approx(other.u, rel=4 / np.sqrt(TRIALS))
        assert one.value == pytest.approx(other.value, abs=4 * one.u * np.sqrt(2 / TRIALS))
        assert one.k == pytest.approx(other.k, rel=0.05)


def test_a_width_alone_is_never_known_better_than_by_points() -> None:
    stated, of_points = ({one.name: one for one in found.stated} for found in (by_values(), by_points()))
    for name in ("2", "3"):
        low, high = of_points[name].interval
        assert 0.5 * (high - low) <= stated[name].U
    assert stated["2"].value == 0.04  # as stated: which way the mean error moved it is not known
    assert stated["2"].interval == pytest.approx((max(0.0, 0.04 - stated["2"].U), 0.04 + stated["2"].U))
    assert stated["3"].interval[0] == 0.0


def test_the_report_says_whose_values_these_are_and_what_was_not_in_them() -> None:
    found = by_values()
    data = json.loads(as_json(part_results(found)))
    assert data["reported"] == {
        "file": "report.csv", "program": "CSV", "by_features": [],
        "values": [{"name": name, "where": f"report.csv line {line}"} for line, name in enumerate("1235", 2)],
    }  # fmt: skip
    assert data["part"]["not_measured"] == ["4"]
    whole, last = data["decision"]["outcome"], data["verdicts"]["statements"][-1]
    assert (last["name"], last["outcome"], last["missing"]) == ("4", "incomplete", ["it was not measured"])
    assert whole == data["verdicts"]["overall"] == gravest([*found.outcomes, "incomplete"])
    assert [one["name"] for one in data["characteristics"]] == ["1", "2", "3", "5"]
    assert [one["value_is"] for one in data["characteristics"]] == ["mean", "stated", "stated", "mean"]
    assert any(text.startswith("Values are those of the report report.csv (CSV)") for text in data["warnings"])
    assert "reported" not in part_results(by_points())


def test_the_last_printed_digit_is_part_of_the_uncertainty() -> None:
    """Printed to a tenth of a millimetre, u² is larger by 0.1²/12 than with six digits."""
    files = job_files("characteristic,value_mm\n1,30.0\n", characteristic=TABLES["characteristic"][:1])
    (one,) = evaluate_part(part_of(files), PartOptions(trials=TRIALS)).stated
    assert one.u == pytest.approx(np.hypot(by_values().stated[0].u, 0.1 / np.sqrt(12)), rel=4 / np.sqrt(TRIALS))


def test_check_tells_what_part_will_warn_of(tmp_path: Path) -> None:
    put(tmp_path, job_files())
    found = check_job(tmp_path)
    assert found.sound
    assert any("Not in the report, and so not measured: 4." in str(one) for one in found.warnings)
    put(tmp_path, {"report.csv": b"characteristic,value_mm\n1,1.1811\n"})
    (problem,) = check_job(tmp_path).problems
    assert "as if it were in inches" in str(problem)


@pytest.mark.parametrize(("diameter", "taken"), [(["9.51"], True), (["9.51", "9.52"], False)])
def test_a_job_begins_from_a_plan_with_its_results(diameter: list[str], taken: bool, tmp_path: Path) -> None:
    """Of several parts nobody knows which is meant: then only the plan is taken."""
    kind = "DiameterCharacteristicMeasurement"
    results = "".join(
        f'<{kind} id="{900 + i}"><CharacteristicItemId>241</CharacteristicItemId><Value>{one}</Value></{kind}>'
        for i, one in enumerate(diameter)
    )
    (tmp_path / "p.qif").write_bytes(document().replace(b"</QIFDocument>", results.encode() + b"</QIFDocument>"))
    write_new("part", tmp_path / "plate", {"part": {"not_measured": ["*"]}}, drawing=tmp_path / "p.qif")
    job = read_part(tmp_path / "plate", machine=False)
    assert (job.reported is not None) == taken
    if job.reported is not None:
        assert {name: one.value for name, one in job.reported.values.items()} == {"2": 9.51}


@pytest.mark.long
def test_a_report_by_values_is_computed_again_to_the_byte(tmp_path: Path) -> None:
    put(tmp_path / "out", contents_of(by_values()))
    found = verify([tmp_path / "out"], rerun=True)
    assert not found.inquiry.findings, "\n".join(map(str, found.inquiry.findings))
    assert found.inquiry.done["again"] > 400
