"""``cmm-uq read``: a DCC for a person, as data, and what is none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.app.cli.process import run
from tests.conftest import ROOT
from tests.jobs.dcc.test_figures import SCHEMAS

SAMPLE = ROOT / "docs" / "import" / "samples" / "plate-certificate.xml"


def test_a_certificate_is_printed() -> None:
    done = run("read", SAMPLE)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["Certificate", "D-K-4711"] in lines
    assert ["4", "83.00043", "0.0006", "2", "83.00051", "0.0008", "2", "0.00007", "0.0010", "2"] in lines


def test_as_data_it_has_every_quantity_with_its_digits() -> None:
    (found,) = json.loads(run("read", SAMPLE, "--json").stdout)["certificates"]
    assert (found["file"], found["number"], found["issued"]) == (str(SAMPLE), "D-K-4711", "2026-03-05")
    z = found["quantities"][3]
    assert (z["name"], z["values"][1], z["units"][1], z["U"][1]) == (
        "Z calibrated",
        "-0.00102",
        r"\milli\metre",
        "0.0010",
    )


@pytest.mark.parametrize(("content", "told"), [
    (b"<a/>", "is no DCC: its root is a"),
    (b"point,x\n1,2\n", "is no XML"),
    (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "has a document type"),
    (SAMPLE.read_bytes().replace(b'schemaVersion="3.2.1"', b'schemaVersion="2.4.0"'), "is not version 3 of the schema"),
    (SAMPLE.read_bytes().replace(b"83.00051", b"83,00051"), "'0 0 83.00034 83,00051' is not a list of numbers"),
    (None, "no such file"),
])  # fmt: skip
def test_what_is_no_certificate_is_refused_in_one_line(content: bytes | None, told: str, tmp_path: Path) -> None:
    file = tmp_path / "c.xml"
    if content is not None:
        file.write_bytes(content)
    done = run("read", file)
    assert done.returncode == 2
    assert told in done.stderr
    assert done.stderr.startswith("cmm-uq: ")
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


@pytest.mark.skipif(not SCHEMAS.exists(), reason="PTB's schemas are not at hand")
def test_the_schema_is_asked_as_well_and_must_be_in_the_folder(tmp_path: Path) -> None:
    assert run("read", SAMPLE, "--schema", SCHEMAS, "-q").returncode == 0
    done = run("read", SAMPLE, "--schema", tmp_path)
    assert done.returncode == 2
    assert "3.2.1" in done.stderr
