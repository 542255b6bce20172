"""``cmm-uq keys new``, ``report --sign`` and ``sign``: what is signed, said and refused, and what nobody ever sees."""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import stat
import subprocess
import sys
import time
from pathlib import Path

import pikepdf
import pytest

pytest.importorskip("pyhanko")
pytest.importorskip("signxml")

from cryptography.hazmat.primitives.serialization import pkcs12

from cmm_uq.base.output import Owner, read_manifest, sha256_of
from cmm_uq.certificate.sign import signatures_of_pdf, signatures_of_xml, trust_of
from cmm_uq.certificate.sign.signer import TEST_OID
from tests.app.cli.laboratory import PLACE
from tests.app.cli.process import COMMAND, run
from tests.app.cli.terminal import everything, until
from tests.certificate.sign.authority import SIGNED, Held, curve_key, issued
from tests.certificate.sign.conftest import XML, anchor, curve_held, held, rsa_key  # noqa: F401 - fixtures

PASSPHRASE = "correct horse battery staple"
NOTE = "signed with a test key: it proves nothing, and anybody can make one"


@pytest.fixture(autouse=True)
def _environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = tmp_path / "passphrase"
    secret.write_text(PASSPHRASE + "\n")
    secret.chmod(0o600)
    monkeypatch.setenv("CMM_UQ_SIGN_PASSPHRASE_FILE", str(secret))
    monkeypatch.setenv("SOURCE_DATE_EPOCH", str(int(SIGNED.timestamp())))


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """A test key, for A. Huber."""
    path = tmp_path / "test.p12"
    assert run("keys", "new", path, "--name", "A. Huber", "--quiet").returncode == 0
    return path


def kept(folder: Path, whose: Held) -> Path:
    """A key as a trust service gives it."""
    path = folder / "key.p12"
    path.write_bytes(whose.file(PASSPHRASE))
    return path


def test_a_new_key_is_nobody_elses_and_says_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "test.p12"
    done = run("keys", "new", path, "--name", "A. Huber")
    assert done.returncode == 0, done.stderr
    assert NOTE in done.stdout
    if os.name != "nt":
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    _, certificate, _ = pkcs12.load_key_and_certificates(path.read_bytes(), PASSPHRASE.encode())
    assert certificate is not None
    assert "TEST KEY – A. Huber" in certificate.subject.rfc4514_string()
    marks = [one.value.public_bytes() for one in certificate.extensions if one.oid.dotted_string == TEST_OID]
    assert NOTE.encode() in marks[0]


def test_no_key_is_written_over(key: Path) -> None:
    before = key.read_bytes()
    again = run("keys", "new", key)
    assert again.returncode == 2
    assert "is there already" in again.stderr
    assert key.read_bytes() == before


@pytest.mark.long
def test_a_signed_report_is_one_set_and_says_who_signed(key: Path, laboratory: Path) -> None:
    out = laboratory / "signed"
    done = run("report", laboratory / "job", "--out", out, "--records", "none", "--sign", key)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(
        f"Signed by TEST KEY – A. Huber on 2026-03-02 09:30 UTC: certificate.xml, certificate.pdf\nTEST KEY: {NOTE}\n"
    )
    (found,) = signatures_of_pdf((out / "certificate.pdf").read_bytes(), trust_of([key.with_suffix(".pem")]))
    assert (found.intact, found.trusted, found.covers_whole_file, found.problems) == (True, True, True, ())
    assert found.test_key
    assert not found.good
    manifest = json.loads((out / "manifest.json").read_bytes())
    assert manifest["files"]["certificate.pdf"]["bytes"] == (out / "certificate.pdf").stat().st_size


def test_the_signed_pdf_says_test_where_everybody_sees_it_and_stays_for_the_archive(
    key: Path, laboratory: Path
) -> None:
    """As ISO 19005-3 and ISO 14289-1 ask of the field: a picture whose fonts are inside, printed, and in the structure."""
    pdf = laboratory / "reports" / "mount" / "certificate.pdf"
    with pikepdf.open(pdf) as plain:
        metadata, attached = plain.Root.Metadata.read_bytes(), sorted(plain.attachments)
    assert run("sign", pdf, "--key", key, "--records", "none").returncode == 0
    with pikepdf.open(pdf) as signed:
        assert signed.check_pdf_syntax() == []
        assert signed.Root.Metadata.read_bytes() == metadata
        assert sorted(signed.attachments) == attached
        field = signed.Root.AcroForm.Fields[0]
        assert str(field.TU).startswith("TEST KEY: signed with a test key")
        assert int(field.F) & 4  # to be printed
        fonts = field.AP.N.Resources.Font
        assert all(
            any(name in font.DescendantFonts[0].FontDescriptor for name in ("/FontFile2", "/FontFile3"))
            for font in fonts.values()
        )
        number = int(field.StructParent)
        tree = signed.Root.StructTreeRoot
        numbers = list(tree.ParentTree.Nums)
        element = numbers[[int(one) for one in numbers[::2]].index(number) * 2 + 1]
        assert (element.S, element.K.Type, element.K.Obj.objgen) == ("/Form", "/OBJR", field.objgen)
        assert tree.K[0].K[-1].objgen == element.objgen
        assert number < int(tree.ParentTreeNextKey)
        assert signed.pages[0].Tabs == "/S"
        assert field.objgen in [one.objgen for one in signed.pages[0].Annots]
        content = field.AP.N.read_bytes()
        assert b"BDC" not in content  # marks of another document's structure


def test_what_the_seal_shows_stands_below_the_text(key: Path, laboratory: Path) -> None:
    if shutil.which("pdftotext") is None:
        pytest.skip("no pdftotext is installed")
    pdf = laboratory / "reports" / "mount" / "certificate.pdf"
    assert run("sign", pdf, "--key", key, "--records", "none").returncode == 0

    def text(*box: int) -> str:
        area = [f"-{name}={value}" for name, value in zip("xyWH", box, strict=True)]
        area = [part for one in area for part in one.split("=")]
        return subprocess.run(["pdftotext", "-l", "1", *area, str(pdf), "-"], capture_output=True, text=True).stdout

    assert "Electronically signed by TEST KEY – A. Huber" in text(0, 808, 595, 34)
    assert "TEST" in text(0, 808, 595, 34)
    assert "2026-03-02 09:30 UTC" in text(0, 808, 595, 34)
    assert "Electronically" not in text(0, 0, 595, 808)


@pytest.mark.long
def test_four_eyes_look_and_sign_afterwards_and_the_records_still_verify(
    laboratory: Path, tmp_path: Path, held: Held, curve_held: Held  # noqa: F811
) -> None:  # fmt: skip
    pdf, place = laboratory / "reports" / "mount" / "certificate.pdf", laboratory / PLACE
    assert run("release", "K-1", "--by", "A. Huber", "--records", place).returncode == 0
    for whose in (held, curve_held):
        done = run("sign", pdf, "--key", kept(tmp_path, whose), "--records", place)
        assert done.returncode == 0, done.stderr
    assert "TEST" not in done.stdout
    assert run("records", "verify", "--records", place).returncode == 0
    names = [one.name for one in signatures_of_pdf(pdf.read_bytes(), trust_of([]))]
    assert names == ["A. Huber", "B. Maier"]
    from cmm_uq.laboratory.records import open_records

    with open_records(place, read_only=True) as records:
        assert records.signed(1) == {"certificate.pdf": sha256_of(pdf)}
        assert [entry.data["by"] for entry in records.entries(kind="signed")] == ["A. Huber", "B. Maier"]
        assert records.certificate(1).state == "released"
    manifest = read_manifest(pdf.parent)
    assert manifest is not None
    assert manifest.owner == Owner("report", "mount")  # who may replace it


def test_an_altered_set_is_not_signed(key: Path, laboratory: Path) -> None:
    folder = laboratory / "reports" / "mount"
    (folder / "results.json").write_bytes((folder / "results.json").read_bytes() + b"\n")
    before = (folder / "certificate.pdf").read_bytes()
    done = run("sign", folder / "certificate.pdf", "--key", key, "--records", "none")
    assert done.returncode == 2
    assert "was altered after it was written" in done.stderr
    assert (folder / "certificate.pdf").read_bytes() == before


def test_a_file_from_elsewhere_is_signed_as_a_copy(key: Path, tmp_path: Path) -> None:
    file = tmp_path / "from a customer" / "certificate.xml"
    file.parent.mkdir()
    file.write_bytes(XML)
    refused = run("sign", file, "--key", key)
    assert refused.returncode == 2
    assert "is of no set that cmm-uq wrote" in refused.stderr
    missing = run("sign", tmp_path / "there-is-none.pdf", "--key", key)
    assert (missing.returncode, "No such file" in missing.stderr) == (2, True)
    done = run("sign", file, "--key", key, "--out", tmp_path / "signed", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["signer"], told["test_key"], told["level"]) == ("TEST KEY – A. Huber", True, "B-B")
    (found,) = signatures_of_xml(
        (tmp_path / "signed" / "certificate.xml").read_bytes(), trust_of([key.with_suffix(".pem")])
    )
    assert found.intact
    assert found.test_key
    assert file.read_bytes() == XML


REFUSED = {
    "another passphrase": "the passphrase does not open it",
    "no key": "is no PKCS#12 file",
    "only a certificate": "has no private key",
    "expired": "its certificate expired on 2026-02-01",
    "not there": "no such file",
    "a level without a server": "level B-LT needs a time stamp server",
    "no such level": "'B-X' is no level of a signature",
    "no server": "is no address of a time stamp server",
    "others may read the passphrase": "others may read it",
    "a PIN": "a PIN does not stand on the command line",
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_sign_is_one_line_and_nothing_is_written(
    case: str, laboratory: Path, tmp_path: Path, anchor: Held, monkeypatch: pytest.MonkeyPatch  # noqa: F811
) -> None:  # fmt: skip
    import datetime as dt

    expired = issued("old", curve_key(), anchor, last=dt.datetime(2026, 2, 1, 12, tzinfo=dt.UTC))
    path, further = tmp_path / "key.p12", []
    path.write_bytes((expired if case == "expired" else issued("new", curve_key(), anchor)).file(PASSPHRASE))
    if case == "another passphrase":
        (tmp_path / "passphrase").write_text("another")
    elif case == "no key":
        path.write_bytes(b"nothing")
    elif case == "only a certificate":
        path.write_bytes(pkcs12.serialize_key_and_certificates(
            None, None, anchor.certificate, None, _encryption()))  # fmt: skip
    elif case == "not there":
        path.unlink()
    elif case == "others may read the passphrase":
        if os.name == "nt":
            pytest.skip("Windows has other rights")
        (tmp_path / "passphrase").chmod(0o644)
    further = {"a level without a server": ["--level", "B-LT"], "no such level": ["--level", "B-X"],
               "no server": ["--time-server", "ftp://stamps"]}.get(case, [])  # fmt: skip
    given = "pkcs11:token=A;object=B?pin-value=4711" if case == "a PIN" else path
    out = laboratory / "signed"
    done = run("report", laboratory / "job", "--out", out, "--records", "none", "--sign", given, *further)
    assert done.returncode == 2
    assert REFUSED[case] in done.stderr
    assert done.stderr.strip().splitlines()[-1].startswith("cmm-uq: ")
    assert PASSPHRASE not in done.stdout + done.stderr
    assert not out.exists()


def _encryption():  # type: ignore[no-untyped-def]
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption

    return BestAvailableEncryption(PASSPHRASE.encode())


def test_a_server_that_does_not_answer_leaves_the_set_as_it_was(key: Path, laboratory: Path) -> None:
    folder = laboratory / "reports" / "mount"
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, and never listening
        server = f"http://127.0.0.1:{taken.getsockname()[1]}/"
        done = run(
            "sign", folder / "certificate.pdf", "--key", key, "--records", laboratory / PLACE, "--time-server", server
        )
    assert done.returncode == 2
    assert f"{server}: the time stamp server does not answer" in done.stderr
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_scheduled_run_does_not_sign(key: Path, laboratory: Path) -> None:
    done = run("report", "--scheduled", laboratory, "--sign", key)
    assert done.returncode == 2
    assert "--sign: goes without --scheduled" in done.stderr


def test_without_what_it_is_made_with_one_line_says_what_to_install(
    key: Path, laboratory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "cryptography.hazmat.primitives.serialization.pkcs12", None)
    monkeypatch.setitem(sys.modules, "cryptography.hazmat.primitives.serialization", None)
    done = run("report", laboratory / "job", "--out", laboratory / "signed", "--records", "none", "--sign", key)
    assert done.returncode == 2
    assert "pip install 'cmm-uq[sign]'" in done.stderr
    assert not (laboratory / "signed").exists()


def test_nobody_at_the_keyboard_is_no_passphrase(key: Path, laboratory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CMM_UQ_SIGN_PASSPHRASE_FILE")
    monkeypatch.setattr(sys, "stdin", None)
    done = run("sign", laboratory / "reports" / "mount" / "certificate.pdf", "--key", key)
    assert done.returncode == 2
    assert "CMM_UQ_SIGN_PASSPHRASE_FILE" in done.stderr


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="terminals of Unix")
def test_a_passphrase_that_is_typed_is_not_shown(key: Path, laboratory: Path) -> None:
    import pty
    import termios

    own = {name: value for name, value in os.environ.items() if not name.startswith("CMM_UQ_SIGN")}
    pdf = laboratory / "reports" / "mount" / "certificate.pdf"
    master, slave = pty.openpty()
    command = [*COMMAND, "sign", str(pdf), "--key", str(key), "--records", "none"]
    with subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=own, start_new_session=True) as process:
        os.close(slave)
        deadline = time.monotonic() + 20.0
        shown = until(master, "Passphrase of the key", deadline)
        while termios.tcgetattr(master)[3] & termios.ECHO and time.monotonic() < deadline:
            time.sleep(0.01)  # what is typed before that is thrown away
        os.write(master, PASSPHRASE.encode() + b"\n")
        shown += everything(master, deadline)
    os.close(master)
    assert process.returncode == 0, shown
    assert "Signed by" in shown
    assert PASSPHRASE not in shown


@pytest.mark.skipif(shutil.which("strace") is None, reason="no strace is installed")
def test_nothing_secret_is_ever_written(key: Path, laboratory: Path, tmp_path: Path) -> None:
    """Every byte that the process writes, to files, streams or sockets, as the kernel sees it; and every command line."""
    pdf = laboratory / "reports" / "mount" / "certificate.pdf"
    trace = tmp_path / "trace"
    command = ["strace", "-f", "-s", "9999999", "-xx", "-e", "trace=write,pwrite64,writev,sendto,sendmsg,execve", "-o",
               str(trace), *COMMAND, "sign", str(pdf), "--key", str(key), "--records", str(laboratory / PLACE)]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    private, _, _ = pkcs12.load_key_and_certificates(key.read_bytes(), PASSPHRASE.encode())
    number = private.private_numbers().private_value.to_bytes(32, "big")  # type: ignore[union-attr]
    said = (number.hex().encode(), str(int.from_bytes(number, "big")).encode(), base64.b64encode(number)[:40])
    secrets, written = (PASSPHRASE.encode(), number, *said), trace.read_text()
    assert _traced(b"%PDF-1.7") in written  # what is written is seen
    for secret in secrets:
        assert _traced(secret) not in written


def _traced(data: bytes) -> str:
    """As strace prints it."""
    return "".join(f"\\x{byte:02x}" for byte in data)
