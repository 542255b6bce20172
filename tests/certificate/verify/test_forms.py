"""The forms of a certificate agree to the character and to the byte; whatever does not is named with its place."""

from __future__ import annotations

import hashlib
import io
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pikepdf
import pytest
from typer.testing import CliRunner

from cmm_uq import __version__
from cmm_uq.app.cli.terminal import NOT_VERIFIED, NOT_WHOLLY_CHECKED
from cmm_uq.app.commands.certificates import again as computed_again, verification
from cmm_uq.app.commands.certificates.verification import Verification
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.base.errors import CmmUqError, NotInstalledError, OutputError
from cmm_uq.certificate.verify.again import Again, beyond_sampling, by_other_kernels, differences
from cmm_uq.certificate.verify.texts import canonical
from cmm_uq.jobs.job import Job
from tests.conftest import ROOT


def checked(folder: Path, again: Again, *names: str) -> Verification:
    """Verified with the second computation handed in."""
    return verify([folder / name for name in names] or [folder], compute=lambda given, job: again)


def told(found: Verification) -> str:
    return "\n".join(map(str, found.inquiry.findings))


def spoil(path: Path, change: Callable[[bytes], bytes]) -> None:
    content = path.read_bytes()
    new = change(content)
    assert new != content
    path.write_bytes(new)


def test_a_certificate_is_verified_in_any_choice_of_its_forms(certificate: Path, again: Again) -> None:
    for names in (
        (),
        ("certificate.pdf",),
        ("certificate.pdf", "certificate.html"),
        ("certificate.pdf", "results.json"),
    ):
        found = checked(certificate, again, *names)
        assert found.inquiry.word == "VERIFIED", told(found)
    assert any("no electronic signature" in note for note in found.inquiry.notes)


@pytest.mark.long
def test_computed_again_from_the_file_alone_everything_is_the_same(made: Path) -> None:
    """The only test that computes: what is in the PDF gives the PDF to the byte."""
    found = verify([made])
    assert found.inquiry.word == "VERIFIED", told(found)
    assert found.inquiry.done["again"] > 800


def test_without_computing_again_not_everything_is_checked(made: Path) -> None:
    found = verify([made], rerun=False)
    assert found.inquiry.word == "NOT WHOLLY CHECKED"
    pages = "texts and layout of certificate.pdf and certificate.html"
    assert [one.what for one in found.inquiry.unchecked] == ["computing again", pages]


def test_a_digit_of_results_is_named_by_its_path(certificate: Path, again: Again) -> None:
    spoil(certificate / "results.json", lambda content: content.replace(b"79.34911611", b"79.34911612", 1))
    found = checked(certificate, again)
    assert found.inquiry.word == "NOT VERIFIED"
    assert any(
        one.place == "estimates.scale_x.ppm.value" and one.should == "79.34911611" for one in found.inquiry.findings
    )
    assert any("attachment results.json" in one.place for one in found.inquiry.findings)


def test_an_input_that_is_another_is_named_by_its_hash(certificate: Path, made: Path, again: Again) -> None:
    (certificate / "certificate.pdf").unlink()
    for name in ("job.toml", "ballbar.csv"):
        shutil.copy(ROOT / "examples" / "iota-1102-20C" / name, certificate)
    assert checked(certificate, again).inquiry.word == "VERIFIED"
    spoil(certificate / "ballbar.csv", lambda content: content.replace(b"4", b"5", 1))
    found = checked(certificate, again)
    assert any(one.check == "inputs" and one.file == "ballbar.csv" for one in found.inquiry.findings)


def test_an_input_with_a_forged_hash_is_computed_again(certificate: Path, again: Again) -> None:
    """Hash and input agree, so that only what the input gives can tell."""
    (certificate / "certificate.pdf").unlink()
    shutil.copy(ROOT / "examples" / "iota-1102-20C" / "job.toml", certificate)
    recording = (ROOT / "examples" / "iota-1102-20C" / "ballbar.csv").read_bytes()
    lines = recording.splitlines(keepends=True)
    forged = b"".join([*lines[:-1], lines[-1].replace(b"1", b"2")])
    (certificate / "ballbar.csv").write_bytes(forged)
    old, new = (hashlib.sha256(content).hexdigest().encode() for content in (recording, forged))
    spoil(certificate / "results.json", lambda content: content.replace(old, new))
    asked = []

    def compute(given: object, job: Job) -> Again:
        asked.append(job.inputs["ballbar.csv"])
        return again

    found = verify([certificate], compute=compute)
    assert asked == [forged]
    assert any(one.place == "job.inputs_sha256.ballbar.csv" for one in found.inquiry.findings)


@pytest.mark.parametrize("error", [OutputError("no space left"), NotInstalledError("the templates are missing")])
def test_what_this_computer_lacks_is_no_finding_against_a_certificate(certificate: Path, error: CmmUqError) -> None:
    def compute(given: object, job: Job) -> Again:
        raise error

    with pytest.raises(type(error)):
        verify([certificate], compute=compute)


def test_a_figure_written_otherwise_is_named_though_it_is_equal(certificate: Path, again: Again) -> None:
    for name in ("certificate.pdf", "certificate.xml", "certificate.html"):
        (certificate / name).unlink(missing_ok=True)
    for name in ("job.toml", "ballbar.csv"):
        shutil.copy(ROOT / "examples" / "iota-1102-20C" / name, certificate)
    spoil(certificate / "results.json", lambda content: content.replace(b": 0.0,", b": -0.0,", 1))
    assert "written otherwise than its inputs give it" in told(checked(certificate, again))


def resaved(path: Path, change: Callable[[pikepdf.Pdf], None]) -> None:
    with pikepdf.open(io.BytesIO(path.read_bytes())) as pdf:
        change(pdf)
        pdf.save(path, fix_metadata_version=False, object_stream_mode=pikepdf.ObjectStreamMode.disable)


@pytest.mark.long
def test_a_page_that_was_drawn_over_is_named(certificate: Path, again: Again) -> None:
    resaved(certificate / "certificate.pdf", lambda pdf: pdf.pages[1].contents_add(b"q 1 1 1 rg 50 50 100 9 re f Q"))
    found = checked(certificate, again)
    assert any(one.place.startswith("page 2: /Contents") for one in found.inquiry.findings), told(found)


@pytest.mark.long
def test_a_pdf_written_anew_is_not_the_file_that_was_made(certificate: Path, again: Again) -> None:
    resaved(certificate / "certificate.pdf", lambda pdf: None)
    assert "written anew" in told(checked(certificate, again))


@pytest.mark.long
def test_a_missing_and_a_further_attachment_are_named(certificate: Path, again: Again) -> None:
    def change(pdf: pikepdf.Pdf) -> None:
        del pdf.attachments["ballbar.csv"]
        pdf.attachments["more.csv"] = pikepdf.AttachedFileSpec(pdf, b"1", filename="more.csv")

    resaved(certificate / "certificate.pdf", change)
    found = told(checked(certificate, again))
    assert "attachment ballbar.csv" in found


@pytest.mark.long
def test_a_folder_whose_manifest_has_other_hashes_is_named(made: Path, tmp_path: Path, again: Again) -> None:
    folder = Path(shutil.copytree(made, tmp_path / "report"))
    assert checked(folder, again).inquiry.word == "VERIFIED"
    spoil(folder / "posterior.npz", lambda content: content + b"\0")
    assert "whose hash manifest.json has" in told(checked(folder, again))


@pytest.mark.long
@pytest.mark.parametrize(("change", "where"), [
    (lambda data: data["files"]["results.json"].update(bytes=1), "files.results.json"),
    (lambda data: data["files"]["results.json"].update(U="0.1 µm"), "files.results.json"),
    (lambda data: data.update(U="0.1 µm"), "U"), (lambda data: data["job"].update(U="0.1 µm"), "job"),
])  # fmt: skip
def test_a_manifest_that_says_otherwise_than_its_files_is_named(
    change: Callable[[dict[str, Any]], None], where: str, made: Path, tmp_path: Path, again: Again
) -> None:
    folder = Path(shutil.copytree(made, tmp_path / "report"))
    data = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    change(data)
    (folder / "manifest.json").write_text(json.dumps(data), encoding="utf-8")
    (finding,) = checked(folder, again).inquiry.findings
    assert (finding.file, finding.place) == ("manifest.json", where)


def by_version(folder: Path, version: str) -> None:
    """The certificate as another version would have made it: without its PDF, which has results.json inside."""
    (folder / "certificate.pdf").unlink()
    for name in ("job.toml", "ballbar.csv"):
        shutil.copy(ROOT / "examples" / "iota-1102-20C" / name, folder)
    here = f'"version": "{__version__}"'.encode()
    spoil(folder / "results.json", lambda content: content.replace(here, f'"version": "{version}"'.encode(), 1))


@pytest.mark.parametrize(("by", "said"), [
    ("0.5.0", "since then touch"), ("0.3.0", "corrections since then touch this certificate"),
    ("99.0.0", "install that"),
])  # fmt: skip
def test_another_version_says_which_corrections_touch_it(certificate: Path, again: Again, by: str, said: str) -> None:
    """Of corrections.toml; a version to come cannot be computed by this one."""
    by_version(certificate, by)
    inquiry = checked(certificate, again).inquiry
    assert inquiry.word == "NOT WHOLLY CHECKED"
    assert said in "\n".join(map(str, inquiry.unchecked))
    assert any(note.startswith("Version 0.6.0 corrects") for note in inquiry.notes) == (by != "99.0.0")


@pytest.fixture
def uncorrected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(computed_again, "between", lambda first, last: ())


@pytest.mark.usefixtures("uncorrected")
def test_of_a_version_without_corrections_since_figures_are_computed_again_and_pages_are_not_checked(
    certificate: Path, again: Again
) -> None:
    by_version(certificate, "0.14.0")
    spoil(certificate / "certificate.html", lambda content: content.replace(b">404.2051<", b">404.2061<", 1))
    inquiry = checked(certificate, again).inquiry
    assert (inquiry.word, inquiry.findings) == ("NOT WHOLLY CHECKED", [])
    assert inquiry.done["again"] > 80
    assert [(one.what, one.why) for one in inquiry.unchecked] == [(
        "texts and layout of certificate.html",
        f"made by version 0.14.0, which alone makes them again to the byte, and this is {__version__}",
    )]  # fmt: skip


def restated(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    data = json.loads((folder / "results.json").read_bytes())
    change(data)
    (folder / "results.json").write_bytes(canonical(data))


@pytest.mark.usefixtures("uncorrected")
@pytest.mark.parametrize(("by", "said"), [(5e-3, "moved"), (0.1, "wrong"), (1.0, "wrong")])
def test_a_figure_of_another_version_that_moved_is_noted_and_one_that_was_altered_is_found(
    by: float, said: str, certificate: Path, again: Again
) -> None:
    """By a part of U, which is printed to two digits: half of the last is from 0.5 % to 5 % of it."""

    def change(data: dict[str, Any]) -> None:
        one = data["estimates"]["scale_x"]["ppm"]
        one["value"] = float(f"{one['value'] + by * one['U'] / 2:.10g}")

    by_version(certificate, "0.14.0")
    restated(certificate, change)
    inquiry = checked(certificate, again).inquiry
    moved = [note for note in inquiry.notes if "figures moved within their last digit since version 0.14.0" in note]
    wrong = [one.place for one in inquiry.findings if one.check == "again"]
    assert (bool(moved), wrong) == (said == "moved", ["estimates.scale_x.ppm.value"] if said == "wrong" else [])


@pytest.mark.usefixtures("uncorrected")
@pytest.mark.parametrize("path", ["decision", "errors.0.outcome"])
def test_a_decision_of_another_version_is_decided_again_from_the_inputs(
    path: str, certificate: Path, again: Again
) -> None:
    def change(data: dict[str, Any]) -> None:
        inner: Any = data["conformity"][0]
        *way, last = [int(key) if key.isdigit() else key for key in path.split(".")]
        for key in way:
            inner = inner[key]
        inner[last] = "pass"

    by_version(certificate, "0.14.0")
    restated(certificate, change)
    assert f"conformity[0].{path.replace('.0.', '[0].')}" in [
        one.place for one in checked(certificate, again).inquiry.findings if one.check == "again"
    ]


@pytest.mark.long
@pytest.mark.usefixtures("uncorrected")
def test_a_page_of_another_version_is_held_to_the_hash_inside_the_pdf(
    certificate: Path, again: Again, monkeypatch: pytest.MonkeyPatch
) -> None:
    """provenance.json, attached, has the hash of every file that was made with it."""
    for module in (verification, computed_again):
        monkeypatch.setattr(module, "__version__", "99.0.0")
    assert checked(certificate, again).inquiry.findings == []
    spoil(certificate / "certificate.html", lambda content: content.replace(b">404.2051<", b">404.2061<", 1))
    (finding,) = [one for one in checked(certificate, again).inquiry.findings if one.file == "certificate.html"]
    assert finding.problem == "is not the file whose hash provenance.json has"


def test_a_package_that_took_part_and_is_not_here_is_named(certificate: Path, again: Again) -> None:
    (certificate / "certificate.pdf").unlink()
    for name in ("job.toml", "ballbar.csv"):
        shutil.copy(ROOT / "examples" / "iota-1102-20C" / name, certificate)
    data = json.loads((certificate / "results.json").read_bytes())
    data["software"]["plugins"] = {"no-such-effects": "1.2"}
    (certificate / "results.json").write_text(json.dumps(data, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    found = checked(certificate, again)
    assert "no-such-effects 1.2 took part, and it is not installed" in "\n".join(map(str, found.inquiry.unchecked))


def sampled(shift: float) -> dict[str, object]:
    """Twenty quantities of a Monte Carlo of 4000 effective draws, each shifted by some of its standard uncertainty."""
    one = {
        f"p{i}": {"value": i + 0.5 + shift * 0.1, "u": 0.1, "interval95": [i + 0.3, i + 0.7], "U": 0.2, "k": 2.0}
        for i in range(20)
    }
    return {"estimates": one, "sampling": {"ess_min": 4000.0}}


def test_other_kernels_change_nearly_every_figure_and_a_forger_one() -> None:
    plain = sampled(0.0)
    assert not differences(plain, sampled(0.0))
    assert not by_other_kernels(sampled(0.01), plain)  # a fifth of the figures: the values alone
    found = differences(sampled(0.05), plain)
    assert not list(beyond_sampling(sampled(0.05), plain, found))
    far = differences(sampled(9.0), plain)
    assert len(list(beyond_sampling(sampled(9.0), plain, far))) == 20


@pytest.mark.long
def test_the_exit_code_says_what_came_out(certificate: Path) -> None:
    from cmm_uq.app.cli.commands import app

    run = CliRunner().invoke(app, ["verify", str(certificate / "certificate.pdf"), "--no-rerun", "--json"])
    assert run.exit_code == NOT_WHOLLY_CHECKED
    assert json.loads(run.stdout)["verdict"] == "NOT WHOLLY CHECKED"
    spoil(
        certificate / "results.json", lambda content: content.replace(b'"decision": "fail"', b'"decision": "pass"', 1)
    )
    run = CliRunner().invoke(app, ["verify", str(certificate), "--no-rerun"])
    assert run.exit_code == NOT_VERIFIED
    assert run.stdout.startswith("NOT VERIFIED")
    said = run.stdout.splitlines()[1]
    assert re.fullmatch(r"  .+ says of .+ \((measured|simulated), [\d-]+\): .+\. It rests on .+\.", said), said
    assert "conformity[0].decision: does not follow from what was decided: “pass” instead of “fail”" in run.stdout
