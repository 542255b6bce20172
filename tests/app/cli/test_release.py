"""``cmm-uq release`` and ``read``."""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.certificates.release import release
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from tests.app.cli.laboratory import PLACE, kept
from tests.app.cli.process import run
from tests.conftest import ROOT
from tests.jobs.dcc.test_figures import SCHEMAS
from tests.laboratory.records.histories import certificate


def state(place: Path, entry: int) -> str:
    """Of a certificate, as another program of the laboratory reads it."""
    with open_records(place, read_only=True) as records:
        return records.certificate(entry).state


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "records.db"


def numbered(number: str, serial: str = "1102", day: dt.date = dt.date(2026, 3, 2), **further: Any) -> dict[str, Any]:
    """Content of a certificate of a number."""
    return certificate(serial, day, number=number, **further)


def test_a_report_is_released_and_withdrawn_by_a_named_person_for_a_reason(laboratory: Path) -> None:
    done = run("release", "K-1", "--by", "A.  Huber", "--reason", "checked", "--records", PLACE, cwd=laboratory)
    assert (done.returncode, done.stdout, done.stderr) == (0, "K-1 of 2026-01-01 (77): released\n", "")
    again = run("release", "mount", "--by", "B. Kern", "--records", PLACE, cwd=laboratory)
    assert again.returncode == 2
    assert "K-1 cannot be released: it is released already" in again.stderr
    bare = run("release", "K-1", "--withdraw", "--by", "B. Kern", "--records", PLACE, cwd=laboratory)
    assert bare.returncode == 2
    assert "--reason: a certificate is withdrawn for a reason" in bare.stderr
    done = run("release", "K-1", "--withdraw", "--by", "B. Kern", "--reason", "wrong artefact", "--records", PLACE, "--json",
               cwd=laboratory)  # fmt: skip
    told = json.loads(done.stdout)
    assert (told["certificate"], told["job"], told["entry"], told["state"]) == ("K-1", "mount", 1, "withdrawn")
    assert [(one["what"], one["by"], one["reason"]) for one in told["signatures"]] == [
        ("release", "A. Huber", "checked"), ("withdrawal", "B. Kern", "wrong artefact"),
    ]  # fmt: skip
    assert run("records", "verify", "--records", PLACE, cwd=laboratory).returncode == 0
    again = run("release", "K-1", "--withdraw", "--by", "B", "--reason", "twice", "--records", PLACE, cwd=laboratory)
    assert "K-1 is withdrawn already" in again.stderr


def test_a_certificate_that_says_draft_on_its_pages_is_not_released(place: Path) -> None:
    kept(place, numbered("K-1", missing=["[job] issued", "[laboratory] name"]))
    done = run("release", "K-1", "--by", "A. Huber", "--records", place)
    assert done.returncode == 2
    assert "K-1 says DRAFT on every page: it does not state [job] issued, [laboratory] name" in done.stderr


def test_four_eyes_are_two_persons_and_neither_is_the_operator(place: Path) -> None:
    kept(place, numbered("K-1", four_eyes=True, operator="J. Harris"))
    for by, code, words in (
        ("j. harris", 2, "made the certificate K-1"), ("A. Huber", 0, "draft; 1 more must sign"),
        ("A.  HUBER", 2, "has signed the certificate K-1 already"), ("B. Kern", 0, "(1102): released\n"),
    ):  # fmt: skip
        done = run("release", "K-1", "--by", by, "--records", place)
        assert (done.returncode, words in done.stdout + done.stderr) == (code, True), done


@pytest.mark.parametrize(
    ("further", "words"),
    [
        (
            {"artefact": {"serial": "BB-7", "due": "2026-03-01"}},
            "its artefact BB-7 was due for calibration on 2026-03-01",
        ),
        ({"origin": "simulated"}, "its recording is simulated"),
    ],
)
def test_what_must_not_be_released_stays_a_draft(further: dict[str, Any], words: str, place: Path) -> None:
    kept(place, numbered("K-1", **further))
    done = run("release", "K-1", "--by", "A. Huber", "--records", place, "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in json.loads(done.stderr)["error"]["problem"]
    assert state(place, 1) == "draft"


def test_a_certificate_is_replaced_by_a_released_one_of_its_machine(place: Path) -> None:
    kept(place, numbered("K-1"), numbered("K-2", day=dt.date(2026, 3, 3)), numbered("K-3", "1103"))
    asked = ("release", "K-1", "--by", "A", "--reason", "corrected", "--records", place, "--replaced-by")
    assert "K-2 is draft. Name a released certificate" in run(*asked, "K-2").stderr
    for number in ("K-1", "K-2", "K-3"):
        assert run("release", number, "--by", "A", "--records", place, "--quiet").stdout == ""
    assert "K-3 is of 1103, not 1102" in run(*asked, "K-3").stderr
    assert "does not replace itself" in run(*asked, "K-1").stderr
    assert "withdrawn or replaced, not both" in run(*asked, "K-2", "--withdraw").stderr
    assert run(*asked, "K-2").stdout == "K-1 of 2026-03-02 (1102): replaced\n"
    assert [state(place, entry) for entry in (1, 2, 3)] == ["replaced", "released", "released"]


def test_a_draft_that_takes_over_a_number_is_released_by_it_and_the_old_one_named_by_its_entry(place: Path) -> None:
    """As after ``affected --write``: the draft has the number and the job of the certificate that it is to replace."""
    kept(place, numbered("K-1"))
    assert run("release", "K-1", "--by", "A", "--records", place).returncode == 0
    kept(place, numbered("K-1", version="0.5.1"))
    assert run("release", "K-1", "--by", "A", "--records", place).returncode == 0
    assert [state(place, entry) for entry in (1, 3)] == ["released", "released"]
    asked = ("--by", "A", "--reason", "corrected", "--records", place)
    done = run("release", "K-1", "--replaced-by", "3", *asked)
    assert done.returncode == 2
    assert "2 certificates are called 'K-1'" in done.stderr
    assert "the number of the entry: 1 (1102, 2026-03-02, released), 3 (1102, 2026-03-02, released)" in done.stderr
    assert run("release", "1", "--replaced-by", "3", *asked).returncode == 0
    assert run("release", "K-1", "--withdraw", *asked).returncode == 0  # only one of them counts now
    assert [state(place, entry) for entry in (1, 3)] == ["replaced", "withdrawn"]


@pytest.mark.parametrize("further", [(), ("--withdraw", "--reason", "wrong")])
def test_a_number_of_two_certificates_is_not_guessed(further: tuple[str, ...], place: Path) -> None:
    kept(place, numbered("K-1", "1102"), numbered("K-1", "1103"))
    done = run("release", "K-1", "--by", "A", *further, "--records", place, "--json")
    assert (done.returncode, done.stdout) == (2, "")
    told = json.loads(done.stderr)["error"]
    assert told["problem"] == "2 certificates are called 'K-1'"
    assert "1 (1102, 2026-03-02, draft), 2 (1103, 2026-03-02, draft)" in told["fix"]
    assert run("release", "2", "--by", "A", *further, "--records", place).returncode == 0
    assert state(place, 1) == "draft"


@pytest.mark.parametrize(
    ("name", "fix"),
    [
        ("K-2026-105", "Did you mean 'K-2026-104'?"), ("1102-2026-03-03", "Did you mean '1102-2026-03-02'?"),
        ("zzz", "Give its number, the id of its job, or the number of its entry"),
    ],
)  # fmt: skip
def test_for_an_unknown_certificate_the_nearest_is_offered(name: str, fix: str, place: Path) -> None:
    kept(place, numbered("K-2026-104"))
    done = run("release", name, "--by", "A", "--records", place)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"no certificate {name!r} is recorded. {fix}" in done.stderr


def test_a_person_must_be_named(place: Path) -> None:
    kept(place, numbered("K-1"))
    assert "a person must be named" in run("release", "K-1", "--by", "  ", "--records", place).stderr
    assert run("release", "K-1", "--records", place).returncode == 2
    assert state(place, 1) == "draft"


SCALE = {"name": "scale_x.ppm", "by": None, "title": "Scale error of X", "outcome": "fail", "value": -53.0, "U": 6.0,
         "limit": 25.0, "unit": "ppm", "missing": []}  # fmt: skip


def test_what_states_no_pass_is_released_with_a_word_that_stays_in_the_records(place: Path) -> None:
    kept(place, numbered("K-1", decision="fail", verdicts={"overall": "fail", "statements": [SCALE]}))
    bare = run("release", "K-1", "--by", "A. Huber", "--reason", "checked", "--records", place)
    assert bare.returncode == 2
    assert "K-1 states fail (scale_x.ppm: fail)" in bare.stderr
    assert '--despite "TEXT"' in bare.stderr
    assert state(place, 1) == "draft"
    done = run("release", "K-1", "--by", "A. Huber", "--reason", "checked", "--despite", "customer informed", "--records",
               place, "--json")  # fmt: skip
    assert done.returncode == 0
    assert json.loads(done.stdout)["signatures"][0]["reason"] == "checked; fail: customer informed"
    with open_records(place, read_only=True) as records:
        entry = next(records.entries(2)).data
        assert (entry["outcome"], entry["despite"], entry["reason"]) == ("fail", "customer informed", "checked")
        assert records.verify(files=False) == []


@pytest.mark.parametrize(
    ("decision", "code"),
    [("pass", 0), ("conditional pass", 0), ("none", 0), ("incomplete", 2), ("undecided", 2), ("remeasure", 2),
     ("conditional fail", 2), ("fail", 2), ("a word of another package", 2)],
)  # fmt: skip
def test_an_entry_of_an_earlier_version_has_the_gravest_decision_alone(place: Path, decision: str, code: int) -> None:
    kept(place, numbered("K-1", decision=decision))
    done = run("release", "K-1", "--by", "A. Huber", "--records", place)
    assert done.returncode == code
    assert (f"K-1 states {decision}" in done.stderr) == (code == 2)


def test_a_terminal_is_asked(place: Path) -> None:
    kept(place, numbered("K-1", decision="undecided"))
    with open_records(place) as records:
        asked: list[str] = []
        with pytest.raises(CmmUqError, match="K-1 states undecided"):
            release(records, "K-1", by="A. Huber", ask=lambda question: asked.append(question) or "  ")
        done = release(records, "K-1", by="A. Huber", ask=lambda question: "agreed with the customer")
        assert asked == ["K-1 states undecided"]
        assert done.certificate.state == "released"
        assert records.signatures(1)[0].reason == "undecided: agreed with the customer"


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


@pytest.mark.long
@pytest.mark.skipif(not SCHEMAS.exists(), reason="PTB's schemas are not at hand")
def test_the_schema_is_asked_as_well_and_must_be_in_the_folder(tmp_path: Path) -> None:
    assert run("read", SAMPLE, "--schema", SCHEMAS, "-q").returncode == 0
    done = run("read", SAMPLE, "--schema", tmp_path)
    assert done.returncode == 2
    assert "3.2.1" in done.stderr
