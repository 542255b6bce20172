"""The dozen things a job states: fields of every kind, and the tables that are made of them."""

from __future__ import annotations

import datetime as dt
import tomllib
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.desk.questions import _wanted, check_answers, check_text, create, fields, tables_of
from cmm_uq.app.desk.work import kinds
from cmm_uq.artefacts import names
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.look import template_folder
from tests.conftest import ROOT

EXPORT = ROOT / "docs" / "tutorial" / "ballbar-export.xlsx"
ANSWERS = {
    "job.date": "2026-05-31", "machine.name": "CMM 3", "machine.serial": "1102", "machine.travel_mm.x": "-600 to 900",
    "machine.travel_mm.y": "-700 1200", "machine.travel_mm.z": "−800 to 400,5", "artefact.U_um": "0,8",
    "artefact.length_mm": "404.205", "conformity.standard": "ASME B89.4.1-1997", "conformity.limit_um": "400",
    "job.customer": "",
}  # fmt: skip


def test_a_line_with_blanks_in_its_name_makes_a_job_that_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = {f"LÄGE {i} (längs {axis})": f"along {axis} from {i},1,2" for i, axis in enumerate("XYZ", 1)}
    rows = [f"{name};{at};{at}.001;{at}.002" for name in lines for at in (50, 150, 400, 600, 800)]
    Path("e.csv").write_text("\n".join(["Position;Nominal [mm];Actual 1 [mm];Actual 2 [mm]", *rows]), encoding="utf-8")
    values = {"job.date": "2026-05-31", "machine.name": "CMM 3"}
    assert check_answers("gauge_blocks", "e.csv", {"lines": lines}, values)["sound"]
    create("gauge_blocks", "e.csv", {"lines": lines}, values, "mine")
    assert tomllib.loads(Path("mine", "job.toml").read_text(encoding="utf-8"))["recording"]["lines"] == lines
    assert check_text("mine", None)["sound"]


def test_what_stands_in_grey_in_a_field_is_read_as_the_job_has_it() -> None:
    for kind in names():
        begun = dict(_wanted(kind))
        for one in (field for field in fields(kind) if field["example"]):
            value: Any = tables_of({"conformity.standard": "any", one["key"]: one["example"]})
            for key in one["key"].split("."):
                value = value[0] if isinstance(value, list) else value
                value = value.get(key, {})
            given = begun[one["key"]]
            assert str(value) == str(given) if isinstance(given, dt.date | str) else value == given, (kind, one)


def test_every_kind_of_an_export_has_a_picture_and_its_dozen() -> None:
    found = kinds()
    drawn = (template_folder() / "serve" / "drawings.html").read_text(encoding="utf-8")
    assert [name for name, *_ in found if f'kind == "{name}"' not in drawn] == []
    for name, *_ in found:
        asked = fields(name)
        assert 4 <= len([one for one in asked if not one["further"]]) <= 24, name
        assert len({one["key"] for one in asked}) == len(asked)
        assert all(one["label"] for one in asked)


def test_answers_are_tables_of_job_toml() -> None:
    found = tables_of(ANSWERS)
    assert found["job"] == {"date": dt.date(2026, 5, 31)}
    assert found["machine"]["serial"] == "1102", "a number that is a name stays one"
    assert found["machine"]["travel_mm"] == {"x": [-600.0, 900.0], "y": [-700.0, 1200.0], "z": [-800.0, 400.5]}
    assert found["artefact"] == {"U_um": 0.8, "k": 2.0, "length_mm": 404.205}
    assert found["conformity"] == {"standard": "ASME B89.4.1-1997", "limit_um": 400}


def test_a_standard_that_is_not_named_decides_nothing() -> None:
    assert "conformity" not in tables_of({**ANSWERS, "conformity.standard": " "})


def test_a_travel_that_is_none_is_told_with_its_key() -> None:
    with pytest.raises(CmmUqError, match="no lowest and highest value") as refused:
        tables_of({**ANSWERS, "machine.travel_mm.x": "about a metre"})
    assert refused.value.where == "[machine] travel_mm.x"


def test_what_is_typed_is_checked_as_the_command_checks_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / EXPORT.name).write_bytes(EXPORT.read_bytes())
    assert "name" in check_answers("ballbar", EXPORT.name, {}, {})["problems"][0]
    assert "when it was measured" in check_answers("ballbar", EXPORT.name, {}, {"machine.name": "CMM 3"})["problems"][0]
    wrong = check_answers("ballbar", EXPORT.name, {}, {**ANSWERS, "artefact.length_mm": "399"})
    assert "404.205" in wrong["problems"][0]
    right = check_answers("ballbar", EXPORT.name, {}, ANSWERS)
    assert right["sound"]
    create("ballbar", EXPORT.name, {}, ANSWERS, "K-1")
    found = check_text("K-1", None)
    assert [one.replace("job/", "K-1/") for one in right["warnings"]] == found["warnings"]
    text = (tmp_path / "K-1" / "job.toml").read_text(encoding="utf-8")
    assert check_text("K-1", text) == found
    assert not check_text("K-1", text.replace("404.205", "399"))["sound"]
    assert check_text("K-1", None) == found, "what was only tried was written"


def test_a_job_names_no_effect_that_its_export_cannot_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step gauge's usual model has hystereses, which directions of approach show, and no table of lengths has them."""
    monkeypatch.chdir(tmp_path)
    heads = "line;nominal [mm];run 1 [mm];run 2 [mm]\n"
    rows = (f"{k};{n};{n}.{k}01{n % 7};{n}.{k}00{n % 5}\n" for k in range(1, 8) for n in (100, 250, 400, 550, 700))
    (tmp_path / "e0.csv").write_text(heads + "".join(rows), encoding="utf-8")
    lines = (
        "along X",
        "along Y",
        "along Z",
        "from 0,0,-600 to 1,1,-599",
        "from 0,0,-600 to 1,0,-599",
        "from 0,0,-600 to 0,1,-599",
    )
    keys = {
        "lines": {
            str(k): one if "to" in one else f"{one} from 0,0,-600" for k, one in enumerate((*lines, "along X"), 1)
        }
    }
    answers = {"job.date": "2026-05-31", "machine.name": "CMM 3"}
    create("step_gauge", "e0.csv", keys, answers, "K-3")
    text = (tmp_path / "K-3" / "job.toml").read_text(encoding="utf-8")
    assert "scale_x" in text
    assert "hysteresis" not in text


def test_a_problem_says_where_on_the_desk_it_is_mended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"1;{ball};{100 * ball};2;{3 + ball / 1000}\n" for ball in (1, 2, 3, 4))
    (tmp_path / "a.csv").write_text("Position;Ball;X [mm];Y [mm];Z [mm]\n" + rows, encoding="utf-8")
    answers = {"job.date": "2026-05-31", "machine.name": "CMM 3"}
    (problem,) = check_answers("plate", "a.csv", {}, answers)["problems"]
    assert "drop the certificate on its page" in problem
    (problem,) = check_answers(
        "sphere", "a.csv", {}, {**answers, "conformity.standard": "ISO 10360-5:2010", "conformity.limit_um": "4"}
    )["problems"]
    assert "“Form deviation of the sphere by its certificate, µm”" in problem


def test_the_artefact_is_said_of_any_recording() -> None:
    told = {name: (text, numbering) for name, text, numbering, *_ in kinds()}
    assert told["step_gauge"][0] == "Step gauge or ball beam: points on a line"
    assert all(text and "measurement" in numbering for text, numbering in told.values())


def test_kinds_that_fit_an_export_come_first_and_of_others_it_is_said_why(tmp_path: Path) -> None:
    lengths = tmp_path / "lengths.csv"
    rows = [f"{line};{at};{at}.001;{at}.002" for line in "AB" for at in (50, 150, 400, 600, 800)]
    lengths.write_text("\n".join(["Position;Nominal [mm];Actual 1 [mm];Actual 2 [mm]", *rows]), encoding="utf-8")
    placed = {"lines": {"A": "along X from 0,1,2", "B": "along Y from 0,1,2"}}
    gauges = ["step_gauge", "arm_lengths", "gauge_blocks"]
    for export, keys, fit, waits, other, why in (
        (str(EXPORT), {}, ["ballbar"], "plate", "sphere", "2 points are too few for a centre and a distance"),
        (str(lengths), placed, gauges, "triangle", "plate", "no column 'reference_x_mm'"),
    ):
        found = kinds(export, keys)
        assert [name for name, _, _, rank, _ in found if rank == 0] == [one[0] for one in found[: len(fit)]] == fit
        assert why in {name: words for name, _, _, rank, words in found if rank == 2}[other]
        assert waits in {name for name, _, _, rank, _ in found if rank == 1}
