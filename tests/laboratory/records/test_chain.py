"""Entries hold together: what is altered, deleted, exchanged or slipped in is found, and the database refuses it first."""

from __future__ import annotations

import datetime as dt
import json
import sqlite3
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import BEGINNING, KINDS, Entry, canonical, following, hash_of
from cmm_uq.laboratory.records.tables import TRIGGERS
from tests.laboratory.records.histories import certificate, history, moment

DAY = dt.date(2026, 3, 2)
DAY_3PM = moment(DAY)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("records") / "records.db"
    with open_records(path, create=True) as records:
        records.append_all(history(6, 3, released=True))
        records.append("adjustment", {"machine": {"serial": "100001", "manufacturer": "Maker 1"}, "day": "2018-01-01"})
    return path


def spoiled(whole: Path, folder: Path, spoil: Callable[[sqlite3.Connection], object]) -> Path:
    path = folder / "spoiled.db"
    for end in ("", "-wal", "-shm"):
        Path(f"{path}{end}").unlink(missing_ok=True)
    with sqlite3.connect(whole) as source, sqlite3.connect(path) as raw:
        source.backup(raw)
        for (name,) in raw.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            raw.execute(f"DROP TRIGGER {name}")
        spoil(raw)
        for statement in TRIGGERS["sqlite"]:  # whoever is careful puts them back
            raw.execute(statement)
    raw.close()
    source.close()
    return path


def findings(path: Path, head: str | None = None) -> list[tuple[str, int | None]]:
    with open_records(path, read_only=True) as records:
        return [(one.kind, one.entry) for one in records.verify(head, files=False)]


def test_a_hash_is_sha256_of_the_list_of_the_entrys_parts() -> None:
    """Computed here by the sentence of the documentation, without the package."""
    entry = following(BEGINNING, 1, dt.datetime(2026, 3, 2, 15, tzinfo=dt.UTC), "sent", {"b": 1, "a": "µ"})
    assert entry.content == '{"a":"µ","b":1}'
    parts = ["0" * 64, 1, "2026-03-02T15:00:00.000000Z", "sent", '{"a":"µ","b":1}']
    assert entry.hash == sha256(json.dumps(parts, separators=(",", ":"), ensure_ascii=False).encode()).hexdigest()


def test_an_untouched_chain_is_sound(whole: Path) -> None:
    with open_records(whole, read_only=True) as records:
        number, last = records.head()
        assert number == 31
        assert records.verify(last, files=False) == []


COLUMNS = ("number", "at", "kind", "content", "previous", "hash")


@pytest.mark.long
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_any_entry_altered_in_any_part_is_found(
    data: st.DataObject, whole: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    number = data.draw(st.integers(1, 31), label="number")
    column = data.draw(st.sampled_from(COLUMNS[1:]), label="column")

    def spoil(raw: sqlite3.Connection) -> None:
        (old,) = raw.execute(f"SELECT {column} FROM entries WHERE number = ?", (number,)).fetchone()
        place = data.draw(st.integers(0, len(old) - 1), label="place")
        new = old[:place] + ("0" if old[place] != "0" else "1") + old[place + 1 :]
        raw.execute(f"UPDATE entries SET {column} = ? WHERE number = ?", (new, number))

    path = spoiled(whole, tmp_path_factory.mktemp("altered"), spoil)
    assert ("chain", number) in findings(path)


@pytest.mark.long
@settings(max_examples=15, deadline=None)
@given(numbers=st.sets(st.integers(1, 30), min_size=1, max_size=4))
def test_entries_deleted_before_the_last_are_found(
    numbers: set[int], whole: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = spoiled(whole, tmp_path_factory.mktemp("deleted"),
                   lambda raw: raw.executemany("DELETE FROM entries WHERE number = ?", [(n,) for n in numbers]))  # fmt: skip
    found = findings(path)
    assert found
    assert {kind for kind, _ in found} == {"chain"}


@settings(max_examples=15, deadline=None)
@given(pair=st.lists(st.integers(1, 31), min_size=2, max_size=2, unique=True))
def test_exchanged_entries_are_found(pair: list[int], whole: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    def spoil(raw: sqlite3.Connection) -> None:
        for old, new in ((pair[0], 1000), (pair[1], pair[0]), (1000, pair[1])):
            raw.execute("UPDATE entries SET number = ? WHERE number = ?", (new, old))

    assert set(findings(spoiled(whole, tmp_path_factory.mktemp("exchanged"), spoil))) >= {("chain", n) for n in pair}


def test_what_a_chain_alone_cannot_show_a_filed_hash_does(whole: Path, tmp_path: Path) -> None:
    """The last entry deleted with all that followed from it leaves a sound chain; the hash filed elsewhere is missing."""
    with open_records(whole, read_only=True) as records:
        _, last = records.head()

    def spoil(raw: sqlite3.Connection) -> None:
        raw.execute("DELETE FROM entries WHERE number = 31")
        raw.execute("DELETE FROM adjustments WHERE entry = 31")

    path = spoiled(whole, tmp_path, spoil)
    assert findings(path) == []
    assert findings(path, last) == [("chain", None)]


@pytest.mark.parametrize(
    "spoil",
    [
        "UPDATE figures SET value = value + 1 WHERE certificate = 1 AND place = 0",
        "UPDATE certificates SET state = 'released' WHERE entry = 30",
        "UPDATE certificates SET decision = 'pass' WHERE entry = (SELECT max(entry) FROM certificates)",
        "DELETE FROM signatures WHERE entry = (SELECT min(entry) FROM signatures)",
        "UPDATE machines SET serial = 'x' WHERE id = 1",
        "UPDATE artefacts SET due = '2099-01-01' WHERE id = 1",
        "INSERT INTO adjustments VALUES (1, '2020-02-02', 3)",
    ],
)
def test_tables_that_are_not_what_the_entries_say_are_found(spoil: str, whole: Path, tmp_path: Path) -> None:
    spoil = spoil.replace("serial = 'x'", "called = 'x'").replace("decision = 'pass'", "decision = 'undone'")
    assert {kind for kind, _ in findings(spoiled(whole, tmp_path, lambda raw: raw.execute(spoil)))} == {"index"}


@pytest.mark.parametrize(
    "spoil",
    [
        "UPDATE entries SET content = '{}' WHERE number = 1",
        "DELETE FROM entries WHERE number = 31",
        "INSERT OR REPLACE INTO entries SELECT number, at, kind, '{}', previous, hash FROM entries WHERE number = 2",
    ],
)
def test_the_database_refuses_to_change_entries(spoil: str, whole: Path) -> None:
    with sqlite3.connect(whole) as raw, pytest.raises(sqlite3.IntegrityError, match="never changed"):
        raw.execute(spoil)
    raw.close()
    assert len(TRIGGERS["sqlite"]) == 3


@pytest.mark.parametrize(("spoil", "problem"), [
    ("DROP TRIGGER entries_no_update", "trigger or view CREATE TRIGGER entries_no_update BEFORE UPDATE ON entries "
     "BEGIN SELECT RAISE(ABORT, 'entries are never changed'); END is missing"),
    ("CREATE TRIGGER kept AFTER INSERT ON entries BEGIN UPDATE figures SET u = u / 2; END", "is not of the records"),
    ("CREATE VIEW shown AS SELECT * FROM figures", "trigger or view CREATE VIEW shown AS SELECT * FROM figures is not of the"),
    ("CREATE TABLE more (a)", "table more is not of the records"), ("DROP TABLE covariances", "table covariances is missing"),
    ("ALTER TABLE figures ADD COLUMN k", "column of figures k is not of the records"),
    ("DROP INDEX ix_certificates_job", "index of certificates ix_certificates_job (job) is missing"),
])  # fmt: skip
def test_tables_triggers_and_indexes_that_are_not_as_they_are_made_are_named(
    spoil: str, problem: str, whole: Path, tmp_path: Path
) -> None:
    path = spoiled(whole, tmp_path, lambda raw: None)
    with sqlite3.connect(path) as raw:
        raw.execute(spoil)
    raw.close()
    with open_records(path, read_only=True) as records:
        (finding,) = records.verify(files=False)
    assert finding.kind == "schema"
    assert problem in finding.problem


@pytest.mark.parametrize(("table", "old", "new", "problem"), [
    ("machines", "place TEXT NOT NULL", "place TEXT", "the definition in machines place TEXT NOT NULL is missing"),
    ("figures", "u FLOAT NOT NULL", "u TEXT NOT NULL", "the definition in figures u FLOAT NOT NULL is missing"),
    ("machines", "place TEXT", "place TEXT COLLATE NOCASE", "the definition in machines place TEXT NOT NULL is missing"),
    ("machines", "UNIQUE (called)", "UNIQUE (called) ON CONFLICT REPLACE", "UNIQUE (called) is missing"),
    ("figures", "PRIMARY KEY (certificate, place)", "PRIMARY KEY (certificate, place, u)", "(certificate, place) is missing"),
    ("figures", "DEFERRABLE INITIALLY DEFERRED", "", "certificates (entry) DEFERRABLE INITIALLY DEFERRED is missing"),
    ("signatures", "REFERENCES entries (number)", "REFERENCES certificates (entry)", "REFERENCES entries (number) DEFERRABLE"),
])  # fmt: skip
def test_definitions_that_are_not_as_they_are_made_are_named(
    table: str, old: str, new: str, problem: str, whole: Path, tmp_path: Path
) -> None:
    """A type, NOT NULL, a key or a constraint: the table made again with the same rows and indexes, and nothing else."""
    path = spoiled(whole, tmp_path, lambda raw: None)
    with sqlite3.connect(path) as raw:
        ((sql,), *indexes) = raw.execute("SELECT sql FROM sqlite_master WHERE tbl_name = ? AND sql IS NOT NULL "
                                         "ORDER BY type DESC", (table,)).fetchall()  # fmt: skip
        assert old in sql
        raw.execute("PRAGMA legacy_alter_table = ON")
        raw.execute(f"ALTER TABLE {table} RENAME TO before")
        raw.execute(sql.replace(old, new))
        raw.execute(f"INSERT INTO {table} SELECT * FROM before")
        raw.execute("DROP TABLE before")
        for (index,) in indexes:
            raw.execute(index)
    raw.close()
    with open_records(path, read_only=True) as records:
        found = [one for one in records.verify(files=False) if one.kind == "schema"]
    assert problem in "\n".join(one.problem for one in found)
    assert all(one.problem.startswith(f"the definition in {table} ") for one in found)


@pytest.mark.parametrize(("years", "found"), [
    ((2026, 2025, 2026), [2]), ((2026, 2030, 2026, 2027), [3]), ((2025, 2026, 2027), []),
])  # fmt: skip
def test_time_that_runs_backwards_is_named_once_at_every_step_back(
    years: tuple[int, ...], found: list[int], tmp_path: Path
) -> None:
    """A single entry of the future does not make all that follow it suspicious."""
    with open_records(tmp_path / "r.db", create=True) as records:
        records.append_all(("sent", {"a": year}, dt.datetime(year, 3, 2, tzinfo=dt.UTC)) for year in years)
        findings = records.verify()
    assert [(one.kind, one.entry) for one in findings] == [("clock", number) for number in found]
    for one in findings:
        now, before = years[one.entry - 1], years[one.entry - 2]
        assert one.problem.startswith(f"is of {now}-03-02T00:00:00")
        assert f"the entry before it of {before}-03-02T00:00:00" in one.problem


@pytest.mark.parametrize(("minutes", "named"), [(9, False), (11, True)])
def test_clocks_of_several_computers_may_differ_by_ten_minutes(minutes: int, named: bool, tmp_path: Path) -> None:
    with open_records(tmp_path / "r.db", create=True) as records:
        for at in (DAY_3PM, DAY_3PM - dt.timedelta(minutes=minutes)):
            records.append("sent", {}, at=at)
        assert bool(records.verify()) is named


def test_as_many_wrong_clocks_as_there_may_be_hide_no_altered_entry(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cmm_uq.laboratory.records.indexing.MOST", 2)
    with open_records(tmp_path / "r.db", create=True) as records:
        for number in range(8):
            records.append("sent", {"a": number}, at=DAY_3PM - dt.timedelta(days=number % 2))
    spoilt = spoiled(tmp_path / "r.db", tmp_path, lambda raw: raw.execute(
        "UPDATE entries SET content = '{}' WHERE number = 8"
    ))  # fmt: skip
    assert ("chain", 8) in findings(spoilt)


def test_rows_are_compared_beside_an_index_that_somebody_added(whole: Path, tmp_path: Path) -> None:
    def spoil(raw: sqlite3.Connection) -> None:
        raw.execute("CREATE INDEX quicker ON figures (value)")
        raw.execute("UPDATE figures SET u = u / 2 WHERE certificate = 1")

    assert {kind for kind, _ in findings(spoiled(whole, tmp_path, spoil))} == {"schema", "index"}


def test_an_entry_of_no_time_with_a_hash_of_its_own_is_found(tmp_path: Path) -> None:
    entry = following(BEGINNING, 1, dt.datetime(2026, 3, 2, 15, tzinfo=dt.UTC), "sent", {"a": 1})
    digest = hash_of(entry.previous, 1, "yesterday", "sent", entry.content)
    with open_records(tmp_path / "r.db", create=True) as records:
        with records.writing() as writing:
            writing.connection.exec_driver_sql(
                "INSERT INTO entries VALUES (1, 'yesterday', 'sent', ?, ?, ?)", (entry.content, entry.previous, digest)
            )
        assert [(one.kind, one.entry, one.problem) for one in records.verify()] == [
            ("chain", 1, "is of no time: 'yesterday'")
        ]
        with pytest.raises(CmmUqError, match="an entry is of no time: 'yesterday'"):
            _ = records.last_moment


def test_a_text_that_holds_numbers_or_quotes_is_the_same_when_read_back(tmp_path: Path) -> None:
    odd = {"a": 'O\'Brien "<script>" \\ µ ☃ \U0001f600', "b": [1e-300, 0.1, -0.0, 2**60], "c": None}
    with open_records(tmp_path / "r.db", create=True) as records:
        records.append("sent", odd)
        assert next(records.entries()).data == odd
        assert records.verify() == []


@pytest.mark.parametrize(
    "content", [{"a": float("nan")}, {"a": float("inf")}, {"a": "\0"}, {"a": object()}, {"a": "\ud800"}]
)
def test_what_is_no_json_is_not_recorded(content: dict[str, object], tmp_path: Path) -> None:
    with open_records(tmp_path / "r.db", create=True) as records:
        with pytest.raises(CmmUqError, match="cannot be recorded"):
            records.append("sent", content)
        assert records.head() == (0, BEGINNING)


def test_several_entries_are_added_all_or_none(tmp_path: Path) -> None:
    with open_records(tmp_path / "r.db", create=True) as records:
        with pytest.raises(CmmUqError, match="certificate 7"):
            records.append_all([("report", certificate(), None), ("release", {"certificate": 7, "by": "A"}, None)])
        assert records.head()[0] == 0
        assert records.certificates() == []


@given(content=st.dictionaries(st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0")),
                               st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**70), 2**70)))  # fmt: skip
def test_the_canonical_text_is_one_for_each_content(content: dict[str, float]) -> None:
    assert canonical(json.loads(canonical(content))) == canonical(dict(reversed(content.items())))


def test_a_backslash_before_u0000_is_no_nul() -> None:
    assert json.loads(canonical({"a": r"\u0000"})) == {"a": r"\u0000"}
    for nul in ("\0", "\\\0"):
        with pytest.raises(CmmUqError, match="the character NUL"):
            canonical({"a": nul})


def test_entries_have_a_kind_of_the_list_and_their_moment_in_utc(tmp_path: Path) -> None:
    with open_records(tmp_path / "r.db", create=True) as records:
        with pytest.raises(CmmUqError, match="no kind of entry"):
            records.append("note", {})
        zone = dt.timezone(dt.timedelta(hours=2))
        entry = records.append(KINDS[-1], {}, at=dt.datetime(2026, 3, 2, 1, 30, tzinfo=zone))
    assert isinstance(entry, Entry)
    assert entry.at == "2026-03-01T23:30:00.000000Z"
    assert moment(DAY).hour == 15


def test_an_entry_that_was_deleted_is_named(whole: Path, tmp_path: Path) -> None:
    path = spoiled(whole, tmp_path, lambda raw: raw.execute("DELETE FROM entries WHERE number = 3"))
    with open_records(path, read_only=True) as records:
        assert records.entry(2).number == 2
        with pytest.raises(CmmUqError, match="has no entry 3 any more"):
            records.entry(3)
