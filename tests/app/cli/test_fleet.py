"""``cmm-uq fleet`` from records to its page."""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any, cast

import numpy as np
import pytest

from cmm_uq.app.commands.laboratory.due import fleet, what_is_due
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.crossing import crossing
from cmm_uq.laboratory.due.drift import DriftPrior, history
from cmm_uq.laboratory.due.fleet_model import FleetPrior
from cmm_uq.laboratory.records import open_records
from tests.app.cli.process import run
from tests.app.cli.test_due import recorded
from tests.certificate.fleets import alone
from tests.laboratory.records.histories import certificate, made

NAME = "squareness_xy.angle_arcsec"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("lab") / "records.db"
    made(place, 5, 3, models=2, places=2, artefacts=2).close()
    return place


@pytest.fixture(scope="module")
def written(lab: Path) -> tuple[CompletedProcess[str], Path]:
    return run("fleet", "--records", lab, "--name", NAME, "--out", lab.parent / "out"), lab.parent / "out"


@pytest.mark.long
def test_it_says_what_is_usual_and_writes_page_and_data(written: tuple[CompletedProcess[str], Path]) -> None:
    done, out = written
    assert (done.returncode, done.stderr) == (0, "")
    assert "No machine drifts unlike its fleet" in done.stdout
    assert "Squareness of x and y: average machine" in done.stdout
    assert {path.name for path in out.iterdir()} >= {"fleet.html", "fleet.json", "fleet.csv"}
    assert "Usual drift" in (out / "fleet.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_data_have_every_machine_and_a_prior_that_is_the_fleet_s(
    written: tuple[CompletedProcess[str], Path], lab: Path
) -> None:
    """A day of crossing from the prior in the file is near that of the file, whose prior is what the others say."""
    data = json.loads((written[1] / "fleet.json").read_text(encoding="utf-8"))
    value = data["values"][0]
    assert (data["schema"], value["name"], len(value["machines"])) == ("cmm-uq/fleet/1", NAME, 5)
    assert value["convergence"]["converged"]
    one = value["machines"][1]
    with open_records(lab, read_only=True) as records:
        series = records.series(one["machine"], [NAME])[NAME]
    found = fleet(lab, [NAME]).values[0].fleet
    kept = FleetPrior.from_data(value["prior"])
    np.testing.assert_allclose(kept.covariance, found.covariance, rtol=1e-8)
    again = crossing(history(series), one["limit"], kept.prior(one["model"], one["place"]))
    assert again.rate == pytest.approx(one["rate"], abs=one["u"])
    assert one["crossing"]["last"] == again.last.isoformat()


def test_due_and_history_take_the_fleets_prior_where_its_file_is_named(
    written: tuple[CompletedProcess[str], Path], tmp_path: Path
) -> None:
    """A machine new to the fleet, of its model and place: both name the day that the model finds from the file's prior."""
    file = written[1] / "fleet.json"
    value = json.loads(file.read_text(encoding="utf-8"))["values"][0]
    of = {key: value["machines"][0][key] for key in ("model", "place")}
    limit = value["machines"][0]["limit"]
    new = {"serial": "new", "name": "New", "manufacturer": "DEA", "calibrate": {"method": "drift"}} | of
    row = (NAME, value["quantity"], value["unit"], 0.3 * limit, 0.05 * limit, 0.2 * limit, 0.4 * limit, 0.0, limit)
    place = recorded(tmp_path, certificate("new", dt.date(2026, 3, 2), (row,), machine=new))

    def told(command: str, *further: str | Path) -> dict[str, Any]:
        asked = (command, "new", "--records", place, "--on", "2026-11-22", "--json", *further)
        return cast("dict[str, Any]", json.loads(run(*asked).stdout))

    with open_records(place, read_only=True) as records:
        series = records.series("new")[NAME]
    prior = FleetPrior.from_data(value["prior"]).prior(of["model"], of["place"])
    days = {}
    asked: tuple[tuple[DriftPrior | None, tuple[str | Path, ...], str], ...] = (
        (prior, ("--fleet", file), "with its fleet"), (None, (), "without a fleet"),
    )  # fmt: skip
    for given, further, words in asked:
        first = days[words] = crossing(series, limit, given).quantile(0.05)
        assert first is not None
        found = next(one for one in told("due", *further)["items"] if one["item"] == "machine")
        assert words in found["why"]
        assert f"{(first - dt.date(2026, 3, 2)).days} days" in found["why"]
        stated = told("history", *further)["values"][NAME]["crosses_limit"]
        assert (stated["day_5"], stated["fleet"]) == (first.isoformat(), given is not None)
    assert "with its fleet" in run("history", "new", "--records", place, "--fleet", file).stdout
    assert days["with its fleet"] != days["without a fleet"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"values": [{"name": "a", "prior": {}}]}'])
def test_a_file_that_is_no_fleets_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "fleet.json").write_text(text, encoding="utf-8")
    place = recorded(tmp_path, certificate("1"))
    with pytest.raises(CmmUqError, match=r"fleet\.json.*cmm-uq fleet"):
        what_is_due(place, fleet=tmp_path / "fleet.json")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("--records", "none.db"), "none.db"),
        (("--name", "scale_x.pm"), "Did you mean 'scale_x.ppm'?"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    asked: tuple[str, str], words: str, lab: Path, tmp_path: Path
) -> None:
    there = () if "--records" in asked else ("--records", lab)
    done = run("fleet", *there, *asked, "--out", tmp_path / "out", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert words in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "change", [{"log": [[0.0]]}, {"unit": "none"}, {"hyper_parameters": []}, {"models": ["one", "more"]}]
)
def test_a_prior_of_another_version_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(CmmUqError, match="no prior of a fleet"):
        FleetPrior.from_data(alone().values[0].fleet.data() | change)


def test_records_without_a_certificate_are_refused_in_words(tmp_path: Path) -> None:
    open_records(tmp_path / "records.db", create=True).close()
    done = run("fleet", "--records", tmp_path / "records.db")
    assert done.returncode == 2
    assert "no certificate of a measured recording is recorded yet" in done.stderr
