"""Runs at the same moment, in processes of their own, on records in a file and on a server: each thing is told by one."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.laboratory.records import open_records
from tests.conftest import ROOT
from tests.laboratory.records.test_postgres import database, server  # noqa: F401 - a fixture
from tests.laboratory.schedule.runs import made

RUNS = 3


@pytest.fixture(params=["SQLite", "PostgreSQL"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "SQLite":
        return str(tmp_path / "lab.db")
    pytest.importorskip("psycopg")
    return database(request.getfixturevalue("server"), f"overlap{time.monotonic_ns()}")


def overlapping(root: Path, place: str, outs: list[str]) -> list[dict[str, Any]]:
    line = [sys.executable, "-m", "tests.laboratory.schedule.overlapping", str(root), place]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    runs = [subprocess.Popen([*line, out], **pipes, text=True, cwd=ROOT) for out in outs]  # type: ignore[call-overload]
    for one in runs:
        assert one.stdout.readline() == "ready\n", one.stderr.read()
    for one in runs:
        one.stdin.write("\n")
        one.stdin.flush()
    told = [one.communicate() for one in runs]
    assert [error for _, error in told] == [""] * len(outs)
    return [json.loads(text) for text, _ in told]


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize(
    "outs", [["reports"] * RUNS, [f"reports-{i}" for i in range(RUNS)]], ids=["one folder", "folders"]
)
def test_each_thing_that_stands_is_in_the_exit_code_of_one_run(tmp_path: Path, place: str, outs: list[str]) -> None:
    """Also of two computers whose reports lie in different folders, and which have the records in common."""
    open_records(place, create=True).close()
    made(tmp_path, "a", "fail")
    made(tmp_path, "b")
    runs = overlapping(tmp_path, place, outs)
    machines = [f"CMM {i}" for i in range(5)]
    told = Counter(about for run in runs for about in run["told"])
    assert {about: told[about] for about in machines} == dict.fromkeys(machines, 1)
    sent = (tmp_path / "sent").read_text().splitlines()
    if len(set(outs)) == 1:
        assert sorted(name for run in runs for name in run["reported"]) == ["a", "b"]
        assert Counter(sent) == {"fail: CMM 3 (job a)": 1, **{f"due: {machine}": 1 for machine in machines}}
        assert all(run["code"] == int(bool(run["told"]) or "a" in run["reported"]) for run in runs)
    with open_records(place) as records:
        assert records.verify(files=False) == []
        entries = [entry.data for entry in records.entries(kind="sent") if entry.data["channel"] == "exit code"]
        assert Counter(entry["about"] for entry in entries) == {"a": 1, **dict.fromkeys(machines, 1)}
    assert all(run["code"] == 0 for run in overlapping(tmp_path, place, outs[:1]))
    assert (tmp_path / "sent").read_text().splitlines() == sent
