"""Names and paths: safe on every system, inside one folder, and no file written over unseen."""

from __future__ import annotations

import os
from pathlib import Path, PureWindowsPath

import pytest
from hypothesis import given, strategies as st

from cmm_uq.app.desk.place import (
    LONGEST,
    ChangedError,
    DraftFolder,
    below,
    jobs_in,
    parts_of,
    safe_name,
    sha256,
    write_over,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.source import check_name

NAMES = st.one_of(
    st.text(max_size=300),
    st.text(alphabet='ab./\\:*?"<>| \0\t\n\u202eéç漢.', max_size=40),
    st.sampled_from(
        ["CON", "aux.csv", "COM1.txt", "nul", "lpt9", "job.toml", "results.json", "..", ".", "", " . ", "a" * 400]
    ),
)


@given(NAMES)
def test_a_safe_name_is_one_on_every_system_and_of_no_file_of_a_command(name: str) -> None:
    safe = safe_name(name)
    check_name(safe, "")
    assert safe == safe_name(safe)
    assert "/" not in safe
    assert "\\" not in safe
    assert PureWindowsPath(safe).name == safe
    assert len(safe) <= LONGEST + len("export-")
    assert len(safe.encode()) <= 255


@pytest.mark.parametrize(("name", "safe"), [
    ("run 1.csv", "run 1.csv"), ("C:\\data\\run.xlsx", "run.xlsx"), ("../../etc/passwd", "passwd"), ("", "export"),
    ("Prüfung.csv", "Prüfung.csv"), ("aux.txt", "export-aux.txt"), ("a:b.csv", "a_b.csv"), ("x.csv. .", "x.csv"),
    ("\u202efdp.exe", "fdp.exe"), (".hidden", "hidden"), ("job.toml", "export-job.toml"),
])  # fmt: skip
def test_names_keep_what_can_be_kept(name: str, safe: str) -> None:
    assert safe_name(name) == safe


@pytest.mark.parametrize(
    ("name", "safe"), [("certificate.pdf", "certificate.pdf"), ("../con.pdf", "export-con.pdf"), ("", "export")]
)
def test_a_certificate_that_is_only_looked_at_keeps_its_name(name: str, safe: str) -> None:
    assert safe_name(name, written=True) == safe


@given(st.lists(st.one_of(NAMES, st.just("..")), max_size=8).map("/".join))
def test_a_path_that_is_taken_leads_nowhere_else(path: str) -> None:
    try:
        parts = parts_of(path)
    except CmmUqError:
        return
    assert all(part not in ("", ".", "..") and part[0] != "." for part in parts)
    assert Path("/root/x").joinpath(*parts).is_relative_to("/root/x")
    assert not PureWindowsPath(*parts).drive


@pytest.mark.parametrize(
    "path",
    ["..", "../x", "a/../../x", "/etc/passwd", "C:/x", "a\\b", "a//b", ".ssh/id", "a/.git/config", "a/", "a:b", "a\0"],
)
def test_paths_out_of_the_folder_are_refused(tmp_path: Path, path: str) -> None:
    with pytest.raises(CmmUqError, match="no path of a file in the folder of the desk"):
        below(tmp_path, path)


@pytest.mark.skipif(os.name == "nt", reason="links need a right there")
def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret.txt").write_text("x", encoding="utf-8")
    root = tmp_path / "root"
    root.mkdir()
    (root / "folder").symlink_to(tmp_path / "outside")
    (root / "file.txt").symlink_to(tmp_path / "outside" / "secret.txt")
    for path in ("folder/secret.txt", "folder", "file.txt"):
        with pytest.raises(CmmUqError, match="is a link"):
            below(root, path)


@pytest.mark.skipif(os.name == "nt", reason="links need a right there")
def test_jobs_are_listed_newest_first_and_none_from_elsewhere(tmp_path: Path) -> None:
    root = tmp_path / "root"
    for i, name in enumerate(("a", "2026/b", "reports/c", ".hidden/d", "../elsewhere/e")):
        (root / name).mkdir(parents=True)
        (root / name / "job.toml").touch()
        os.utime(root / name / "job.toml", (i, i))
    (root / "linked").symlink_to(tmp_path / "elsewhere")
    assert [folder.relative_to(root).as_posix() for folder in jobs_in(root)] == ["2026/b", "a"]


def test_what_was_changed_meanwhile_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "job.toml"
    write_over(path, b"one", "")
    seen = sha256(b"one")
    write_over(path, b"two", seen)
    with pytest.raises(ChangedError) as refused:
        write_over(path, b"three", seen)
    assert refused.value.now == b"two"
    with pytest.raises(ChangedError):
        write_over(path, b"three", "")
    path.unlink()
    with pytest.raises(ChangedError):
        write_over(path, b"three", sha256(b"two"))
    assert list(tmp_path.iterdir()) == []


def test_a_draft_whose_answers_are_damaged_hides_no_other(tmp_path: Path) -> None:
    drafts = DraftFolder(tmp_path)
    for name, text in (
        ("0" * 16, '{"export": "a.csv", "keys": {}, "values": {}}'),
        ("1" * 16, '{"export": "b'),
        ("no-draft", "{}"),
    ):
        (drafts.folder / name).mkdir(parents=True)
        (drafts.folder / name / "answers.json").write_text(text, encoding="utf-8")
    assert [one.name for one in drafts.every()] == ["a.csv"]
    with pytest.raises(CmmUqError, match="cannot be read"):
        drafts.read("1" * 16)
