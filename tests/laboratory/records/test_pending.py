"""Files and their entry are one: whatever fails, and wherever the process is killed, both are there or neither."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sqlite3
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.engine.default import DefaultDialect

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import MANIFEST, InDoubtError, Owner, read_manifest, sha256_of, staged
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.tables import pending
from tests.laboratory.records.histories import certificate

OWNER = Owner("report", "k-1")
MOST = 200
"""More writes than there are in one report."""

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a forked process")


def contents(value: int) -> dict[str, bytes]:
    return {"results.json": json.dumps({"value": value}).encode(), "certificate.html": b"<p>" + str(value).encode()}


def digest(value: int) -> str:
    return sha256(contents(value)["results.json"]).hexdigest()


def report(place: Path, value: int) -> None:
    with open_records(place, create=True) as records, staged(place.parent / "k-1", OWNER) as stage:
        content = certificate(folder="k-1", job="k-1", results_sha256=digest(value))
        stage.write(contents(value), ledger=records.ledger("report", content))


def state(place: Path, value: int) -> bool:
    with open_records(place, create=True) as records:
        recorded = records.has_results(digest(value)) is not None
        with records.engine.connect() as connection:
            assert connection.execute(select(pending)).all() == []
    folder = place.parent / "k-1"
    assert (sha256_of(folder / "results.json") == digest(value)) == recorded
    manifest = read_manifest(folder)
    for name, wanted in (manifest.files if manifest else {}).items():
        assert sha256_of(folder / name) == wanted
    if folder.exists():
        assert {path.name for path in folder.iterdir() if not path.name.startswith(".")} <= {*contents(value), MANIFEST}
    return recorded


class Nth:
    def __init__(self, n: int, act: Callable[[], Any]) -> None:
        self.n, self.act, self.count = n, act, 0

    def step(self) -> None:
        self.count += 1
        if self.count == self.n:
            self.act()

    def install(self, patch: pytest.MonkeyPatch) -> None:
        for name in ("fsync", "rename", "replace", "mkdir", "unlink", "rmdir", "link"):
            patch.setattr(os, name, self._before(getattr(os, name)))
        commit = DefaultDialect.do_commit

        def committed(dialect: Any, connection: Any) -> None:
            self.step()
            commit(dialect, connection)
            self.step()

        patch.setattr(DefaultDialect, "do_commit", committed)

    def _before(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*given: Any, **named: Any) -> Any:
            self.step()
            return call(*given, **named)

        return called


def in_a_process(n: int, work: Callable[[], None]) -> bool:
    sys.stdout.flush()
    child = os.fork()
    if not child:
        try:
            with pytest.MonkeyPatch.context() as patch:
                Nth(n, lambda: os._exit(9)).install(patch)
                work()
            os._exit(0)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.fixture(scope="module", params=[False, True], ids=["the first report", "a report in place of another"])
def start(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bool]:
    folder = tmp_path_factory.mktemp("start")
    open_records(folder / "records.db", create=True).close()
    if request.param:
        report(folder / "records.db", 1)
    return folder, request.param


def both_or_neither(place: Path, before: bool) -> bool:
    there = state(place, 2)
    with open_records(place, read_only=True) as records:
        assert records.verify() == []
    if not there:
        assert not before or state(place, 1)
        report(place, 2)
        assert state(place, 2)
    with open_records(place, read_only=True) as records:
        assert records.head()[0] == 1 + before
    return there


@pytest.mark.long
@needs_fork
def test_a_process_killed_at_any_write_leaves_both_or_neither(start: tuple[Path, bool], tmp_path: Path) -> None:
    folder, before = start
    seen = set()
    for n in range(1, MOST):
        place = Path(shutil.copytree(folder, tmp_path / f"{n}")) / "records.db"
        whole = in_a_process(n, lambda place=place: report(place, 2))  # type: ignore[misc]
        seen.add(both_or_neither(place, before))
        if whole:
            break
    assert 20 < n < MOST - 1
    assert seen == {False, True}


@needs_fork
def test_a_process_killed_while_it_makes_the_records_leaves_them_to_be_made(tmp_path: Path) -> None:
    for n in range(1, MOST):
        place = tmp_path / f"{n}.db"
        whole = in_a_process(n, lambda place=place: open_records(place, create=True).close())  # type: ignore[misc]
        with open_records(place, create=True) as records:
            assert records.append("sent", {}).number == 1
        if whole:
            break
    assert 2 < n < MOST - 1


@pytest.mark.long
def test_a_write_that_fails_anywhere_leaves_both_or_neither(start: tuple[Path, bool], tmp_path: Path) -> None:
    def full() -> None:
        raise OSError(28, "No space left on device")

    folder, before = start
    for n in range(1, MOST):
        place = Path(shutil.copytree(folder, tmp_path / f"{n}")) / "records.db"
        fault = Nth(n, full)
        with pytest.MonkeyPatch.context() as patch, contextlib.suppress(CmmUqError, OSError):
            fault.install(patch)
            report(place, 2)
        there = both_or_neither(place, before)
        if fault.count < n:
            assert there
            break
    assert 20 < n < MOST - 1


def test_records_that_cannot_be_written_to_take_the_files_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk of the records is full when the entry is to be added, and all files are in place already."""
    place = tmp_path / "records.db"
    report(place, 1)
    commits: list[int] = []
    commit = DefaultDialect.do_commit

    def full(dialect: Any, connection: Any) -> None:
        commits.append(1)
        if len(commits) == 2:
            raise sqlite3.OperationalError("database or disk is full")
        commit(dialect, connection)

    monkeypatch.setattr(DefaultDialect, "do_commit", full)
    with pytest.raises(OutputError, match="the disk of the records is full"):
        report(place, 2)
    monkeypatch.undo()
    assert not state(place, 2)
    assert state(place, 1)


def test_an_answer_that_was_lost_is_looked_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commit was done and its answer lost: the report is there, and nothing is taken back."""
    place = tmp_path / "records.db"
    commits: list[int] = []
    commit = DefaultDialect.do_commit

    def lost(dialect: Any, connection: Any) -> None:
        commits.append(1)
        commit(dialect, connection)
        if len(commits) == 3:  # tables, intent, entry
            raise sqlite3.OperationalError("connection lost")

    monkeypatch.setattr(DefaultDialect, "do_commit", lost)
    report(place, 1)
    monkeypatch.undo()
    assert state(place, 1)


def test_records_that_are_lost_leave_the_files_until_they_are_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "records.db"
    report(place, 1)

    def gone(*given: Any) -> Any:
        raise sqlite3.OperationalError("server closed the connection")

    with open_records(place) as records, staged(tmp_path / "k-1", OWNER) as stage:
        ledger = records.ledger("report", certificate(folder="k-1", results_sha256=digest(2)))
        commit = ledger.commit

        def lost(token: str) -> None:
            monkeypatch.setattr(type(records.engine), "connect", gone)
            commit(token)

        monkeypatch.setattr(ledger, "commit", lost)
        with pytest.raises(InDoubtError, match="the next command records them"):
            stage.write(contents(2), ledger=ledger)
        monkeypatch.undo()
    assert sha256_of(tmp_path / "k-1" / "results.json") == digest(2)
    assert state(place, 2)


def test_the_same_results_are_recorded_once(tmp_path: Path) -> None:
    place = tmp_path / "records.db"
    for value in (1, 1, 2, 2, 1):
        report(place, value)
    with open_records(place) as records:
        assert [entry.data["results_sha256"] for entry in records.entries()] == [digest(1), digest(2)]
        records.append("withdrawal", {"certificate": 1, "by": "A. Huber", "reason": "too early"})
    report(place, 1)
    with open_records(place) as records:
        assert [one.state for one in records.certificates(values=False)] == ["withdrawn", "draft", "draft"]


def test_a_set_that_is_being_written_is_left_to_its_process(tmp_path: Path) -> None:
    place = tmp_path / "records.db"
    with open_records(place, create=True) as records, staged(tmp_path / "k-1", OWNER) as stage:
        records.ledger("report", certificate()).intend(stage.token, stage.folder, "0" * 64)
        open_records(place).close()
        with records.engine.connect() as connection:
            assert len(connection.execute(select(pending)).all()) == 1
    open_records(place).close()
    with open_records(place) as records, records.engine.connect() as connection:
        assert connection.execute(select(pending)).all() == []
