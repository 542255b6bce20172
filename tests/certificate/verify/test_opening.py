"""Hostile and damaged files: each refused, or named, with one clear sentence, within limits."""

from __future__ import annotations

import io
import shutil
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pikepdf
import pytest

from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import PDF_UNPACKED
from cmm_uq.certificate.verify import opened
from cmm_uq.certificate.verify.given import Given, Inquiry, check_files, read_given
from cmm_uq.certificate.verify.opened import PdfFile, read_html, read_pdf
from cmm_uq.certificate.verify.texts import canonical, strict_json
from tests.conftest import ROOT


@pytest.mark.parametrize(("content", "told"), [
    (b'{"a": 1, "a": 2}', "key 'a' twice"), (b'{"a": NaN}', "that is none: NaN"), (b'{"a": 1e999}', "that is none: 1e999"),
    (b'{"a": ' + b"9" * 5000 + b"}", "that is none"), (b'{"a": ' + b"[" * 100_000, "deeper than 40"),
    (b"[1]", "no JSON object"),
    (b'{"a": 1', "no JSON"), (b"\xff", "not UTF-8"), (b'{"a": -Infinity}', "that is none"),
])  # fmt: skip
def test_json_that_says_two_things_or_none_is_refused(content: bytes, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        strict_json(content, "results.json")


def test_results_are_written_again_to_the_byte(made: Path) -> None:
    content = (made / "results.json").read_bytes()
    assert canonical(strict_json(content, "results.json")) == content


@pytest.mark.parametrize(("piece", "told"), [
    ("<script>1</script>", "a <script>"), ('<video src="http://example.org">', "a <video>"), ("<!-- 1 -->", "a comment"),
    ('<img src="http://example.org">', "refers to 'http://example.org'"), ('<img alt="PASS">', "an <img> without a picture"),
    ('<img src="data:text/html;base64,UEFTUw==">', "refers to 'data:text/html"),
    ('<img src="data:image/png;base64,%">', "refers to"), ('<img src="data:," onerror="x()">', "attribute 'onerror'"),
    ('<p onclick="x()">1</p>', "attribute 'onclick'"), ('<p style="display:none">1</p>', "attribute 'style'"),
    ("</p>", "closes <p>"), ("<p>", "is not the last"), ('<table style="display:none"></table>', "the style"),
    ('<link rel="stylesheet" href="x.css">', "refers to 'x.css'"), ('<p class="a" class="b">1</p>', "twice"),
])  # fmt: skip
def test_what_the_template_has_not_is_named(made: Path, piece: str, told: str) -> None:
    content = (made / "certificate.html").read_text(encoding="utf-8")
    assert not read_html(content.encode(), "certificate.html").problems
    spoilt = content.replace("</main>", f"{piece}</main>", 1)
    assert any(told in problem for _, problem in read_html(spoilt.encode(), "certificate.html").problems)


def test_html_nested_without_end_is_refused() -> None:
    with pytest.raises(CmmUqError, match="deeper than 100"):
        read_html(b"<!doctype html>" + b"<div>" * 10_000, "certificate.html")


Change = Callable[[pikepdf.Pdf], None]


def saved(made: Path, change: Change, **options: Any) -> bytes:
    with pikepdf.open(made / "certificate.pdf") as pdf:
        change(pdf)
        out = io.BytesIO()
        pdf.save(out, object_stream_mode=pikepdf.ObjectStreamMode.disable, **options)
        return out.getvalue()


def named(content: bytes) -> str:
    """What the checks of the file say."""
    inquiry = Inquiry()
    check_files(inquiry, Given(pdf=("certificate.pdf", read_pdf(content, "certificate.pdf"))))
    return "\n".join(map(str, inquiry.findings))


def _twice(pdf: pikepdf.Pdf) -> None:
    names = pdf.Root.Names.EmbeddedFiles
    names = names if "/Names" in names else names.Kids[0]
    names.Names.insert(0, names.Names[1])
    names.Names.insert(0, pikepdf.String("ballbar.csv"))


def _climbing(pdf: pikepdf.Pdf) -> None:
    pdf.attachments["../x.csv"] = pikepdf.AttachedFileSpec(pdf, b"1", filename="../x.csv")


def _script(pdf: pikepdf.Pdf) -> None:
    pdf.Root.OpenAction = pikepdf.Dictionary(S=pikepdf.Name.JavaScript, JS=pikepdf.String("x"))


def _launch(pdf: pikepdf.Pdf) -> None:
    pdf.Root.AA = pikepdf.Dictionary(WC=pikepdf.Dictionary(S=pikepdf.Name.Launch, F=pikepdf.String("x.exe")))


def _note(pdf: pikepdf.Pdf) -> None:
    note = pikepdf.Dictionary(Type=pikepdf.Name.Annot, Subtype=pikepdf.Name.FreeText, Rect=pikepdf.Array([0, 0, 9, 9]))
    pdf.pages[0].obj.Annots = pikepdf.Array([pdf.make_indirect(note)])


def _layer(pdf: pikepdf.Pdf) -> None:
    pdf.Root.OCProperties = pikepdf.Dictionary(OCGs=pikepdf.Array([]))


@pytest.mark.parametrize(("change", "told"), [
    (lambda pdf: None, ""), (_twice, "attached twice"), (_climbing, "leads out of its folder"), (_script, "/JavaScript"),
    (_launch, "/Launch"), (_note, "/FreeText"), (_layer, "/OCProperties"),
])  # fmt: skip
def test_what_a_pdf_of_a_certificate_has_not_is_named(made: Path, change: Change, told: str) -> None:
    found = named(saved(made, change))
    assert told in found
    assert told or not found


def test_an_encrypted_pdf_is_refused(made: Path) -> None:
    content = saved(made, lambda pdf: None, encryption=pikepdf.Encryption(owner="a", user=""))
    with pytest.raises(CmmUqError, match="encrypted"):
        read_pdf(content, "certificate.pdf")


def test_a_stream_that_unpacks_without_end_is_refused(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand times as large as it is packed; here with a lower limit, so that it is soon reached."""
    monkeypatch.setattr(opened, "PDF_UNPACKED", replace(PDF_UNPACKED, most=30_000_000))
    packing = zlib.compressobj()
    bomb = b"".join(packing.compress(bytes(10**6)) for _ in range(40)) + packing.flush()

    def change(pdf: pikepdf.Pdf) -> None:
        pdf.Root.More = pikepdf.Stream(pdf, bomb, Filter=pikepdf.Name.FlateDecode)

    content = saved(made, change, compress_streams=False, stream_decode_level=pikepdf.StreamDecodeLevel.none)
    assert len(content) < 2 * 10**6
    with pytest.raises(CmmUqError, match="unpacks to more than"):
        read_pdf(content, "certificate.pdf")


def test_every_byte_of_a_packed_stream_counts(made: Path) -> None:
    content = bytearray((made / "certificate.pdf").read_bytes())
    at = content.index(b"stream\n", content.index(b"/FlateDecode")) + 40
    content[at] ^= 1
    with pytest.raises(CmmUqError, match="damaged"):
        read_pdf(bytes(content), "certificate.pdf")


@pytest.mark.parametrize("cut", [1, 7, 100, 5000])
def test_a_pdf_cut_off_is_refused(made: Path, cut: int) -> None:
    with pytest.raises(CmmUqError):
        read_pdf((made / "certificate.pdf").read_bytes()[:-cut], "certificate.pdf")


def test_a_revision_behind_the_end_is_seen(made: Path) -> None:
    content = (made / "certificate.pdf").read_bytes()
    found: PdfFile = read_pdf(content, "certificate.pdf")
    assert found.ends == [len(content)]
    more = read_pdf(content + b"\n% more\n", "certificate.pdf")
    assert any("after its end" in problem for _, problem in more.problems)


def test_a_link_a_second_pdf_and_what_is_no_certificate_are_refused(certificate: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.pdf"
    link.symlink_to(certificate / "certificate.pdf")
    other = tmp_path / "other.pdf"
    other.write_bytes((certificate / "certificate.pdf").read_bytes())
    note = tmp_path / "note.txt"
    note.write_text("1", encoding="utf-8")
    for paths, told in (([link], "is a link"), ([certificate / "certificate.pdf", other], "a second PDF"),
                        ([note], "nothing given is a certificate"), ([tmp_path / "none.pdf"], "no such file")):  # fmt: skip
        with pytest.raises(CmmUqError, match=told):
            read_given(paths)


ENDS: list[Callable[[bytes], bytes]] = [
    lambda content: content.replace(b"\n", b"\r\n"),
    lambda content: b"\xef\xbb\xbf" + content,
    lambda content: b"\xef\xbb\xbf" + content.replace(b"\n", b"\r\n"),
]


@pytest.mark.parametrize("rewritten", ENDS)
def test_line_ends_that_were_changed_on_the_way_are_no_alteration(
    certificate: Path, rewritten: Callable[[bytes], bytes]
) -> None:
    """As git, an editor or e-mail of Windows changes them, of documents and of inputs beside them."""
    job = ROOT / "examples" / "iota-1102-20C"
    for name in ("job.toml", "ballbar.csv"):
        (certificate / name).write_bytes(rewritten((job / name).read_bytes()))
    for name in ("certificate.html", "results.json"):
        (certificate / name).write_bytes(rewritten((certificate / name).read_bytes()))
    found = verify([certificate], rerun=False).inquiry
    assert (found.word, found.findings) == ("NOT WHOLLY CHECKED", [])
    names = "ballbar.csv, certificate.html, job.toml, results.json"
    assert [one.why for one in found.unchecked if one.what == f"{names} to the byte"]


def test_a_digit_is_found_whatever_line_ends_it_comes_with(certificate: Path) -> None:
    content = (ROOT / "examples" / "iota-1102-20C" / "ballbar.csv").read_bytes().replace(b"\n", b"\r\n")
    (certificate / "ballbar.csv").write_bytes(content.replace(b"1", b"2", 1))
    found = verify([certificate], rerun=False).inquiry
    assert "ballbar.csv" in {one.file for one in found.findings}


def test_one_line_end_that_differs_is_no_other_way_of_writing(certificate: Path) -> None:
    path = certificate / "results.json"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n", 1))
    assert verify([certificate], rerun=False).inquiry.word == "NOT VERIFIED"


def test_what_windows_puts_into_a_folder_is_passed_over(made: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made, tmp_path / "folder"))
    for name in ("Thumbs.db", "desktop.ini"):
        (folder / name).write_bytes(b"1")
    assert verify([folder], rerun=False).inquiry.findings == []
    (folder / "another.ini").write_bytes(b"1")
    assert "does not name another.ini" in str(verify([folder], rerun=False).inquiry.findings[0])


def test_one_file_may_be_given_twice(certificate: Path, tmp_path: Path) -> None:
    pdf = certificate / "certificate.pdf"
    assert verify([certificate, pdf], rerun=False).inquiry.findings == []
    other = tmp_path / pdf.name
    other.write_bytes(pdf.read_bytes() + b"\n")
    with pytest.raises(CmmUqError, match="there are two files"):
        verify([certificate, other], rerun=False)


def test_what_cannot_be_given_is_refused_in_words(made: Path, tmp_path: Path) -> None:
    packed = tmp_path / "certificate.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(made / "certificate.pdf", "certificate.pdf")
    link = tmp_path / "link"
    link.symlink_to(made, target_is_directory=True)
    for path, problem in (
        (packed, "nothing given is a certificate. Unpack"),
        (link, f"a link, .* Give what it leads to: {made.resolve()}"),
        (tmp_path / f"{'long' * 80}.pdf", "cannot be read: File name too long"),
    ):
        with pytest.raises(CmmUqError, match=problem):
            verify([path])


@pytest.mark.parametrize("packing", [
    {"linearize": True}, {"object_stream_mode": pikepdf.ObjectStreamMode.generate},
])  # fmt: skip
def test_a_pdf_that_another_program_saved_is_called_so(made: Path, packing: dict[str, Any]) -> None:
    out = io.BytesIO()
    with pikepdf.open(made / "certificate.pdf") as pdf:
        pdf.save(out, **packing)
    with pytest.raises(CmmUqError, match="was saved anew by another program"):
        read_pdf(out.getvalue(), "certificate.pdf")


def test_results_taken_out_of_a_pdf_are_missed(made: Path) -> None:
    def without(pdf: pikepdf.Pdf) -> None:
        del pdf.attachments["results.json"]
        pdf.Root.AF = pikepdf.Array([spec for spec in pdf.Root.AF if str(spec.UF) != "results.json"])

    assert "attachment results.json: is missing, and provenance.json names it" in named(saved(made, without))
