"""Fields of a job that is there: what is changed is changed in its job.toml, and nothing else."""

from __future__ import annotations

import difflib
import tomllib

import pytest

from cmm_uq.app.desk.questions import facts, with_facts, with_file
from cmm_uq.base.errors import CmmUqError
from tests.app.desk.conftest import Visitor
from tests.app.desk.test_desk import made

TEXT = """# by hand
[job]
id = "K-1"  # stays
date = 2026-05-31

[machine]
name = "CMM 3"
travel_mm = { x = [0.0, 900.0], y = [0.0, 1200.0], z = [-850.0, 0.0] }

[artefact]
kind = "step_gauge"  # the artefact
U_um = 0.8
k = 2.0

[recording]
file = "e0.csv"

[[conformity]]
standard = "ISO 10360-2:2009"
mpe = "4 + L/100"
"""


def changed(**values: str) -> list[str]:
    said = {**facts(TEXT)["values"], **{name.replace("__", "."): value for name, value in values.items()}}
    lines = difflib.unified_diff(TEXT.splitlines(), with_facts(TEXT, said).splitlines(), lineterm="", n=0)
    return [line for line in lines if line[0] in "+-" and line[:3] not in ("+++", "---") and line != "+"]


def test_what_is_not_changed_stays_to_the_byte() -> None:
    assert with_facts(TEXT, facts(TEXT)["values"]) == TEXT


@pytest.mark.parametrize(("values", "lines"), [
    ({"machine__name": "CMM 5"}, ['-name = "CMM 3"', '+name = "CMM 5"']),
    ({"machine__serial": "1102"}, ['+serial = "1102"']),
    ({"artefact__U_um": "0,9"}, ["-U_um = 0.8", "+U_um = 0.9"]),
    ({"artefact__U_um": ""}, ["-U_um = 0.8"]),
    ({"conformity__mpe": "3 + L/200"}, ['-mpe = "4 + L/100"', '+mpe = "3 + L/200"']),
    ({"laboratory__name": "Example Ltd"}, ["+[laboratory]", '+name = "Example Ltd"']),
    ({"artefact__certificate__date": "2026-01-02"}, ["+certificate = {date = 2026-01-02}"]),
    ({"job__date": "2026-06-01"}, ["-date = 2026-05-31", "+date = 2026-06-01"]),
])  # fmt: skip
def test_a_field_that_is_changed_changes_its_line(values: dict[str, str], lines: list[str]) -> None:
    assert changed(**values) == lines


def test_a_travel_is_changed_in_its_place() -> None:
    said = {**facts(TEXT)["values"], "machine.travel_mm.x": "0 to 950"}
    found = tomllib.loads(with_facts(TEXT, said))["machine"]["travel_mm"]
    assert found == {"x": [0.0, 950.0], "y": [0.0, 1200.0], "z": [-850.0, 0.0]}


def test_a_text_that_is_no_job_is_told() -> None:
    for text in ("x = ", "", "[artefact]\nkind = 3\n"):
        with pytest.raises(CmmUqError):
            facts(text)


def test_two_tabs_with_fields_do_not_write_over_each_other(seated: Visitor) -> None:
    name = made(seated)
    path = seated.desk.root / name / "job.toml"
    page = seated.get(f"/desk/facts?name={name}")
    seen, own = page.hidden("seen"), {"machine.name": "CMM five", "artefact.length_mm": "404.205"}
    values = {**facts(path.read_text(encoding="utf-8"))["values"], **own}
    assert seated.post("/desk/facts", name=name, seen=seen, then="check", **values).status == 200
    assert b"CMM 3" in path.read_bytes()
    assert seated.post("/desk/facts", name=name, seen=seen, then="save", **values).status == 303
    assert b'name = "CMM five"' in path.read_bytes()
    late = seated.post("/desk/facts", name=name, seen=seen, then="save", **{**values, "machine.name": "CMM six"})
    assert late.status == 409
    assert "Machine: CMM five in the file, CMM six here" in late.text
    assert b"CMM five" in path.read_bytes()
    again = {**values, "machine.name": "CMM six"}
    assert seated.post("/desk/facts", name=name, seen=late.hidden("seen"), then="save", **again).status == 303
    assert b"CMM six" in path.read_bytes()
    found = seated.post("/desk/check", name=name, **{**again, "artefact.length_mm": "399"})
    assert "404.205" in found.text


@pytest.mark.parametrize(("text", "table", "file"), [
    ('[job]\nid = "x"\n', "recording", '[job]\nid = "x"\n\n[recording]\nfile = "p.csv"\n'),
    ('[recording]  # x\nfile = "o"\n\n[part]\na = "z"\n', "recording",
     '[recording]  # x\nfile = "p.csv"\n\n[part]\na = "z"\n'),
    ('[recording]\nunit = "mm"\n', "recording", '[recording]\nunit = "mm"\nfile = "p.csv"\n'),
    ('[artefact]\nk = 2  # x\n', "artefact.certificate", '[artefact]\nk = 2  # x\ncertificate = {file = "p.csv"}\n'),
    ('[artefact]\n[artefact.certificate]\nnumber = "7"\n', "artefact.certificate",
     '[artefact]\n[artefact.certificate]\nnumber = "7"\nfile = "p.csv"\n'),
])  # fmt: skip
def test_a_dropped_file_is_named_and_nothing_else_is_changed(text: str, table: str, file: str) -> None:
    assert with_file(text, table, "p.csv") == file


@pytest.mark.parametrize("text", ["artefact = 3\n", '[artefact]\ncertificate = "x"\n', "[artefact\n"])
def test_a_file_is_named_in_no_job_that_has_no_table_for_it(text: str) -> None:
    with pytest.raises(CmmUqError, match=r"job\.toml: has no table that"):
        with_file(text, "artefact.certificate", "p.csv")
