"""A certificate states the head of the records; who holds one can show whether they were rewritten, and when it was signed."""

from __future__ import annotations

import datetime as dt
import json
import re
import shutil
from collections.abc import Callable, Iterable
from hashlib import sha256
from pathlib import Path
from typing import Any

import pypdf
import pytest

from cmm_uq.app.commands.certificates.signing import Signing, sign_files
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.laboratory.batch import BatchOptions, write_batch
from cmm_uq.app.commands.laboratory.records import import_reports
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.verify.given import Inquiry
from cmm_uq.certificate.verify.sources import witnesses_of
from cmm_uq.jobs.dcc import read
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import BEGINNING, ChainHead, Entry
from tests.app.cli.laboratory import PLACE, reported
from tests.app.cli.process import run

pytestmark = pytest.mark.long  # all need what takes long to make

NEW = Callable[[Entry], dict[str, Any] | None]
"""What an entry is to say when the records are written anew; ``None`` for nothing: it is left out."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A laboratory that recorded K-1 as entry 1, released it as entry 2, and recorded K-2 as entry 3; not to be changed."""
    folder = reported(tmp_path_factory.mktemp("laboratory"))
    assert run("release", "K-1", "--by", "A. Huber", "--records", folder / PLACE).returncode == 0
    second(folder, "second", "K-2")
    write_report(folder / "second", folder / "reports" / "second", records=folder / PLACE)
    return folder


def second(folder: Path, job: str, number: str) -> None:
    """The job once more, under another name."""
    copy = shutil.copytree(folder / "job", folder / job) / "job.toml"
    text = copy.read_text(encoding="utf-8").replace('"mount"', f'"{job}"').replace('"K-1"', f'"{number}"')
    copy.write_text(text, encoding="utf-8")


@pytest.fixture
def laboratory(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "laboratory"))


def entries(place: Path | str) -> list[Entry]:
    with open_records(place, read_only=True) as records:
        return list(records.entries())


def rewritten(place: Path, new: NEW) -> None:
    """Records written anew by somebody who knows how: a chain that is sound in itself, with the moments of before."""
    old = entries(place)
    place.unlink()
    with open_records(place, create=True) as records:
        for entry in old:
            if (content := new(entry)) is not None:
                records.append(entry.kind, content, at=dt.datetime.fromisoformat(entry.at))
        assert records.verify(files=False) == []


def disagreeing(place: Path, *files: Path) -> list[str]:
    """What the records have otherwise than certificates state."""
    with open_records(place, read_only=True) as records:
        return [one.problem for one in records.disagreements(witnesses_of(files)[0])]


def by_another(entry: Entry) -> dict[str, Any]:
    """The release by somebody else."""
    return entry.data | ({"by": "B. Maier"} if entry.kind == "release" else {})


def results(folder: Path) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((folder / "results.json").read_bytes())
    return data


def held_to(laboratory: Path, *names: str) -> Inquiry:
    """The second certificate held to the records, without computing again."""
    folder = laboratory / "reports" / "second"
    return verify([folder / name for name in names] or [folder], rerun=False, records=laboratory / PLACE).inquiry


def told(inquiry: Inquiry, check: str = "records") -> list[str]:
    return [one.problem for one in inquiry.findings if one.check == check]


def test_every_form_states_the_newest_entry_before_its_own(made: Path) -> None:
    folder, (_, released, own) = made / "reports" / "second", entries(made / PLACE)
    assert results(folder)["records"] == {"entries": 2, "head": released.hash, "at": released.at}
    assert own.data["records"] == results(folder)["records"]
    at = released.at[:19].replace("T", " ")
    line = f"Records of the laboratory before this document: entry 2 of {at} UTC, SHA-256 {released.hash}."
    assert f"<p>{line}</p>" in (folder / "certificate.html").read_text(encoding="utf-8")
    pages = "".join(page.extract_text() for page in pypdf.PdfReader(folder / "certificate.pdf").pages)
    assert "".join(line.split()) in "".join(pages.split())
    (measurement,) = read((folder / "certificate.xml").read_bytes(), "certificate.xml").measurements
    (stated,) = (one for one in measurement.metadata if one.ref_type == ("cmm_records",))
    assert line in str(stated.declaration)


def test_empty_records_and_none_are_said_in_words(made: Path, tmp_path: Path) -> None:
    first = made / "reports" / "mount"
    assert results(first)["records"] == {"entries": 0, "head": BEGINNING, "at": None}
    page = (first / "certificate.html").read_text(encoding="utf-8")
    assert "<p>Records of the laboratory before this document: empty, entry 0.</p>" in page
    write_report(made / "job", tmp_path / "none", records="none")
    assert results(tmp_path / "none")["records"] is None
    page = (tmp_path / "none" / "certificate.html").read_text(encoding="utf-8")
    assert "<p>Records of the laboratory: none; this document was not recorded.</p>" in page
    found = verify([tmp_path / "none"], records=made / PLACE).inquiry
    assert (found.word, found.findings) == ("NOT WHOLLY CHECKED", [])
    assert [one.what for one in found.unchecked] == ["the records"]


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_same_inputs_at_the_same_head_give_the_same_bytes_and_at_another_one_line_more(
    laboratory: Path, tmp_path: Path
) -> None:
    second(laboratory, "third", "K-3")
    for name in ("one", "two"):
        shutil.copy(laboratory / PLACE, tmp_path / f"{name}.db")
        write_report(laboratory / "third", tmp_path / name, records=tmp_path / f"{name}.db")
    assert bytes_of(tmp_path / "one") == bytes_of(tmp_path / "two")
    write_report(laboratory / "third", tmp_path / "none", records="none")
    pages = [(tmp_path / name / "certificate.html").read_text(encoding="utf-8") for name in ("one", "none")]
    lines = [[line for line in page.splitlines() if "Records of the laboratory" not in line] for page in pages]
    assert lines[0] == lines[1]


def test_a_report_that_is_made_again_keeps_its_head_and_is_recorded_once(laboratory: Path) -> None:
    folder, before = laboratory / "reports" / "mount", entries(laboratory / PLACE)
    there = bytes_of(folder)
    write_report(laboratory / "job", folder, records=laboratory / PLACE)
    assert bytes_of(folder) == there
    assert entries(laboratory / PLACE) == before


def test_computed_again_from_the_head_that_it_states_it_is_the_same_to_the_byte(made: Path) -> None:
    found = verify([made / "reports" / "second"], records=made / PLACE).inquiry
    assert (found.word, found.findings) == ("VERIFIED", [])
    assert found.done["records"] == 1
    stated = "The certificate is entry 3 of the records. They have entry 2, which it states"
    assert any(note.startswith(stated) for note in found.notes)


def test_records_that_were_rewritten_are_found_by_number_and_both_hashes(laboratory: Path) -> None:
    before = entries(laboratory / PLACE)[1]
    rewritten(laboratory / PLACE, by_another)
    now = entries(laboratory / PLACE)[1]
    assert run("records", "verify", "--records", laboratory / PLACE).returncode == 0
    for names in ((), ("certificate.pdf",), ("certificate.xml",), ("results.json",)):
        (problem,) = told(held_to(laboratory, *names))
        assert f"was made after entry 2 with the hash {before.hash}" in problem
        assert f"that entry has the hash {now.hash}: they were rewritten, though they have the certificate" in problem


@pytest.mark.parametrize("witness", ["certificate.pdf", "certificate.xml", "results.json", "."])
def test_every_certificate_in_other_hands_is_a_witness(witness: str, laboratory: Path, tmp_path: Path) -> None:
    customer = shutil.copytree(laboratory / "reports" / "second", tmp_path / "customer") / witness
    line = ("records", "verify", "--records", laboratory / PLACE, "--no-files", "--witness", customer)
    sound = run(*line)
    assert (sound.returncode, sound.stderr) == (0, "")
    assert "certificates state heads up to entry 2; 0 disagree\n3 entries, sound" in sound.stdout
    rewritten(laboratory / PLACE, by_another)
    done = run(*line, "--json")
    assert done.returncode == 4
    data = json.loads(done.stdout)
    assert [(one["kind"], one["entry"]) for one in data["findings"]] == [("witness", 2)]
    assert data["witnesses"] == {"certificates": 1, "entries": 2, "passed_over": []}


def test_records_that_are_shorter_or_others_are_told_apart(laboratory: Path, tmp_path: Path) -> None:
    rewritten(laboratory / PLACE, lambda entry: entry.data if entry.number == 1 else None)
    end = entries(laboratory / PLACE)[-1].hash
    assert f"they end at entry 1 with the hash {end}: their last entries are missing" in told(held_to(laboratory))[0]
    with open_records(tmp_path / "others.db", create=True) as others:
        for turn in range(3):
            others.append("sent", {"turn": turn})
    shutil.copy(tmp_path / "others.db", laboratory / PLACE)
    assert told(held_to(laboratory))[0].endswith("they were rewritten, or they are others")


def test_a_certificate_of_another_laboratory_may_have_been_imported(laboratory: Path, tmp_path: Path) -> None:
    """Records that were put together of two laboratories were not rewritten, and not made empty."""
    with open_records(tmp_path / "merged.db", create=True) as merged:
        for turn in range(2):
            merged.append("sent", {"turn": turn})
        import_reports(merged, [laboratory / "reports"])
    shutil.copy(tmp_path / "merged.db", laboratory / PLACE)
    (problem,) = told(held_to(laboratory))
    assert problem.endswith("they were rewritten, or the certificate, their entry 4, was imported from others")
    first = verify([laboratory / "reports" / "mount"], rerun=False, records=laboratory / PLACE).inquiry
    assert first.findings == []
    assert "it says that they were empty, and is their entry 3" in "".join(map(str, first.unchecked))


def test_a_certificate_whose_own_entry_was_left_out_is_missed(laboratory: Path) -> None:
    """What stands before it is as it was: only that it is not recorded itself tells."""
    rewritten(laboratory / PLACE, lambda entry: entry.data if entry.number < 3 else None)
    assert "they do not have the certificate itself" in told(held_to(laboratory))[0]


def test_an_entry_that_was_altered_under_its_old_hash_shows_nothing(laboratory: Path) -> None:
    from tests.app.cli.test_records import GUARDS, behind

    behind(
        laboratory / PLACE, GUARDS + "UPDATE entries SET content = replace(content, 'Huber', 'Maier') WHERE number = 2"
    )
    assert told(held_to(laboratory)) == ["was altered: cmm-uq records verify says all"]


def swapped(first: Path, other: Path) -> None:
    """Results of two certificates, each with the head of the other."""
    heads = [results(folder)["records"] for folder in (first, other)]
    for folder, head in zip((first, other), reversed(heads), strict=True):
        data = json.dumps(results(folder) | {"records": head}, indent=2, ensure_ascii=False) + "\n"
        (folder / "results.json").write_text(data, encoding="utf-8")


def test_heads_that_were_swapped_between_certificates_are_found(laboratory: Path) -> None:
    """Both are heads of these records; the certificates that state them are not in them."""
    folders = laboratory / "reports" / "mount", laboratory / "reports" / "second"
    swapped(*folders)
    found = disagreeing(laboratory / PLACE, *(folder / "results.json" for folder in folders))
    assert ["do not have the certificate itself" in one for one in found] == [True, True]
    assert "is not results.json" in told(held_to(laboratory), "forms")


def spoilt_page(folder: Path) -> None:
    page = folder / "certificate.html"
    text = page.read_text(encoding="utf-8")
    page.write_text(re.sub(r"SHA-256 [0-9a-f]{8}", "SHA-256 00000000", text), encoding="utf-8")


def spoilt_results(folder: Path) -> None:
    data = results(folder)
    data["records"]["entries"] = 1
    (folder / "results.json").write_text(json.dumps(data, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def spoilt_digital(folder: Path) -> None:
    digital = folder / "certificate.xml"
    digital.write_bytes(
        digital.read_bytes().replace(b"before this document: entry 2 of", b"before this document: entry 1 of")
    )


@pytest.mark.parametrize(
    ("spoil", "check"), [(spoilt_page, "again"), (spoilt_results, "again"), (spoilt_digital, "forms")]
)
def test_a_head_that_was_altered_in_one_form_is_found_without_the_records(
    spoil: Callable[[Path], None], check: str, laboratory: Path
) -> None:
    """The page is made again of results.json, whose head is an input; the digital certificate without computing, too."""
    folder = laboratory / "reports" / "second"
    (folder / "manifest.json").unlink()
    spoil(folder)
    found = verify([folder], rerun=check == "again").inquiry
    assert found.word == "NOT VERIFIED"
    assert told(found, check)


def test_a_certificate_from_which_its_head_was_taken_is_found(laboratory: Path) -> None:
    folder = laboratory / "reports" / "second"
    data = {key: value for key, value in results(folder).items() if key != "records"}
    (folder / "results.json").write_text(json.dumps(data, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    found = verify([folder / "results.json"], rerun=False, records=laboratory / PLACE).inquiry
    assert "the records" in [one.what for one in found.unchecked]
    assert told(verify([folder]).inquiry, "again")


@pytest.mark.parametrize("stated", [
    {"entries": -1, "head": "0" * 64, "at": None}, {"entries": 0, "head": "1" * 64, "at": None}, {"entries": 2}, "none",
    {"entries": 2, "head": "g" * 64, "at": "2026-03-02T09:30:00Z"}, {"entries": 2, "head": "0" * 64, "at": "2026-03-02"},
    {"entries": 2, "head": "0" * 64, "at": "2026-03-02T09:30:00Z", "more": 1},
])  # fmt: skip
def test_what_is_no_head_is_refused(stated: object) -> None:
    with pytest.raises(CmmUqError, match="is no head of records"):
        ChainHead.of_results({"records": stated})


def test_a_folder_in_which_nothing_states_a_head_is_no_witness(tmp_path: Path, made: Path) -> None:
    (tmp_path / "letter.pdf").write_bytes(b"%PDF-1.7 of somebody else")
    done = run("records", "verify", "--records", made / PLACE, "--witness", tmp_path)
    assert done.returncode == 2
    assert "no certificate states a head of records" in done.stderr


def test_reports_of_a_batch_state_heads_of_one_chain_though_others_write_between(laboratory: Path) -> None:
    jobs = [f"b{number}" for number in range(3)]
    for job in jobs:
        second(laboratory, job, f"K-{job}")
    out, place = laboratory / "reports", laboratory / PLACE
    options = BatchOptions(workers=2)
    assert write_batch([laboratory / job for job in jobs], out, options, records=place).written == 3
    heads = [results(out / job)["records"] for job in jobs]
    known = {(entry.number, entry.hash): entry for entry in entries(place)}
    own = {entry.data["job"]: entry.number for entry in entries(place) if entry.kind == "report"}
    assert all((head["entries"], head["head"]) in known for head in heads)
    assert all(head["entries"] < own[job] for head, job in zip(heads, jobs, strict=True))
    assert disagreeing(place, out) == []


# --- signatures, between two entries

signing = pytest.importorskip("cmm_uq.certificate.sign")
pytest.importorskip("pyhanko")
pytest.importorskip("signxml")


def signer(first: dt.datetime) -> Any:
    from tests.certificate.sign.authority import curve_key, issued, root

    return issued("A. Huber", curve_key(), root(), first=first, last=first + dt.timedelta(days=60)).signer


def signed(laboratory: Path, at: dt.datetime) -> Inquiry:
    """The second certificate signed afterwards, at what the signer says is the time, and verified with the records."""
    folder = laboratory / "reports" / "second"
    paths = [folder / "certificate.pdf", folder / "certificate.xml"]
    sign_files(paths, Signing(signer(at - dt.timedelta(days=30)), at), records=laboratory / PLACE)
    return held_to(laboratory)


def now() -> dt.datetime:
    return dt.datetime.now(dt.UTC).replace(microsecond=0)


def test_a_signature_lies_between_the_entry_that_it_names_and_the_one_that_has_it(laboratory: Path) -> None:
    with open_records(laboratory / PLACE) as records:
        records.append("sent", {"key": "another's"})
    found = signed(laboratory, now())
    fourth, fifth = entries(laboratory / PLACE)[3:]
    assert found.findings == []
    assert (
        fifth.data["files"]["certificate.pdf"]
        == sha256((laboratory / "reports" / "second" / "certificate.pdf").read_bytes()).hexdigest()
    )
    assert (
        f"certificate.pdf: A. Huber signed after entry 4 of {fourth.at}, before entry 5 of {fifth.at}." in found.notes
    )
    assert any(note.startswith("certificate.xml: A. Huber signed after entry 2 of") for note in found.notes)
    assert run("records", "verify", "--records", laboratory / PLACE).returncode == 0


def test_a_signature_that_names_an_entry_of_other_records_is_found(laboratory: Path) -> None:
    assert signed(laboratory, now()).findings == []
    old = entries(laboratory / PLACE)
    (laboratory / PLACE).unlink()
    with open_records(laboratory / PLACE, create=True) as records:  # the head that is printed is still there
        for entry in old[:2]:
            records.append(entry.kind, entry.data, at=dt.datetime.fromisoformat(entry.at))
        records.append("sent", {"key": "one entry more"})
        records.append_all((one.kind, one.data, dt.datetime.fromisoformat(one.at)) for one in old[2:3])
    (problem,) = told(held_to(laboratory))
    assert problem.startswith("has the hash ")
    assert problem.endswith(f"and certificate.pdf was signed after it with the hash {old[2].hash}")


@pytest.mark.parametrize(("at", "why"), [
    (dt.datetime(2025, 12, 31, tzinfo=dt.UTC), "the certificate is of 2026-01-02"),
    (dt.datetime(2026, 1, 5, tzinfo=dt.UTC), "it states entry 2 of the records, of "),
])  # fmt: skip
def test_a_signature_older_than_what_it_signs_is_found(at: dt.datetime, why: str, laboratory: Path) -> None:
    problems: Iterable[str] = told(signed(laboratory, at), "signatures")
    assert any(f"says {at:%Y-%m-%d %H:%M} UTC, before there was anything to sign: {why}" in one for one in problems)


def test_clocks_that_differ_by_minutes_are_no_finding(laboratory: Path) -> None:
    head = dt.datetime.fromisoformat(results(laboratory / "reports" / "second")["records"]["at"])
    assert signed(laboratory, (head - dt.timedelta(minutes=9)).replace(microsecond=0)).findings == []


def test_a_signature_that_says_a_time_after_it_was_recorded_is_found(laboratory: Path) -> None:
    late = now() + dt.timedelta(days=3)
    assert "not between these entries" in "\n".join(told(signed(laboratory, late), "signatures"))


def test_a_report_that_is_signed_as_it_is_made_lies_between_its_head_and_its_own_entry(laboratory: Path) -> None:
    second(laboratory, "third", "K-3")
    out, at = laboratory / "reports" / "third", now()
    who = Signing(signer(at - dt.timedelta(days=30)), at)
    write_report(laboratory / "third", out, records=laboratory / PLACE, signing=who)
    found = verify([out], rerun=False, records=laboratory / PLACE).inquiry
    third, fourth = entries(laboratory / PLACE)[2:]
    assert found.findings == []
    assert [
        note
        for note in found.notes
        if note.endswith(f"signed after entry 3 of {third.at}, before entry 4 of {fourth.at}.")
    ] == [
        f"certificate.{form}: A. Huber signed after entry 3 of {third.at}, before entry 4 of {fourth.at}."
        for form in ("pdf", "xml")
    ]
