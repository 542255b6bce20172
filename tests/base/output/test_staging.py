"""The files of a command are one set: all or none, never over anything else, whatever happens in between.

Leftovers of a process that is no more are acted upon by one process at a time, and never those of one that lives.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import (
    MANIFEST,
    Owner,
    finish_interrupted,
    is_pending,
    read_manifest,
    staged,
    staging,
    staging as staging_module,
)
from cmm_uq.base.output.staging import locked

MINE = Owner("report", "job-1")
OLD, NEW = {"a.txt": b"old a", "b.txt": b"old b"}, {"a.txt": b"new a", "c.txt": b"new c"}


def write(folder: Path, contents: dict[str, bytes], owner: Owner = MINE, *, force: bool = False) -> None:
    with staged(folder, owner, force=force, expected=contents) as place:
        place.write(contents)


def there(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def is_set(folder: Path, contents: dict[str, bytes]) -> bool:
    """Whether the manifest and the files say the same, and these are the files."""
    data = json.loads((folder / MANIFEST).read_bytes())
    said = {name: entry["sha256"] for name, entry in data["files"].items()}
    found = {name: content for name, content in there(folder).items() if name != MANIFEST}
    return found == contents and said == {name: sha256(content).hexdigest() for name, content in contents.items()}


def test_all_files_and_their_manifest_arrive_and_nothing_else_stays(tmp_path: Path) -> None:
    write(tmp_path / "a" / "b", OLD)
    assert is_set(tmp_path / "a" / "b", OLD)
    data = json.loads((tmp_path / "a" / "b" / MANIFEST).read_bytes())
    assert data["schema"] == "cmm-uq/manifest/1"
    assert (data["command"], data["job"]) == ("report", {"id": "job-1", "origin": "measured"})
    assert data["files"]["a.txt"]["bytes"] == 5


def test_the_same_command_for_the_same_job_replaces_its_set_and_removes_what_the_new_one_lacks(tmp_path: Path) -> None:
    write(tmp_path, OLD)
    write(tmp_path, NEW)
    assert is_set(tmp_path, NEW)


@pytest.mark.parametrize(
    "other", [Owner("plan", "job-1"), Owner("report", "job-2"), Owner("report", "job-1", "simulated")]
)
def test_what_another_command_job_or_origin_wrote_is_refused_and_kept_by_force(tmp_path: Path, other: Owner) -> None:
    write(tmp_path, OLD, other)
    before = there(tmp_path)
    with pytest.raises(CmmUqError, match=f"holds what cmm-uq {other.command} for {other.job}.*--out.*--force"):
        write(tmp_path, NEW)
    assert there(tmp_path) == before
    write(tmp_path, NEW, force=True)
    kept = {f"{name}.previous": content for name, content in before.items()}
    assert {name: content for name, content in there(tmp_path).items() if name.endswith(".previous")} == kept
    assert read_manifest(tmp_path).owner == MINE  # type: ignore[union-attr]


def test_a_strangers_file_of_that_name_is_refused_and_another_stays_beside(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_bytes(b"mine")
    write(tmp_path, OLD)
    (tmp_path / "c.txt").write_bytes(b"a stranger's")
    with pytest.raises(CmmUqError, match=r"c\.txt: was not written by cmm-uq report for job-1"):
        write(tmp_path, NEW)
    assert there(tmp_path).items() >= {"a.txt": b"old a", "c.txt": b"a stranger's", "notes.txt": b"mine"}.items()


def test_what_was_changed_since_it_was_written_is_refused_and_kept_by_force(tmp_path: Path) -> None:
    write(tmp_path, OLD)
    (tmp_path / "a.txt").write_bytes(b"with my remarks")
    with pytest.raises(CmmUqError, match=r"a\.txt: was changed after it was written"):
        write(tmp_path, NEW)
    write(tmp_path, NEW, force=True)
    assert (tmp_path / "a.txt.previous").read_bytes() == b"with my remarks"
    (tmp_path / "a.txt").write_bytes(b"again")
    write(tmp_path, NEW, force=True)
    assert (tmp_path / "a.txt.previous").read_bytes() == b"with my remarks"
    assert (tmp_path / "a.txt.previous-2").read_bytes() == b"again"


def test_a_file_that_was_removed_is_written_again(tmp_path: Path) -> None:
    write(tmp_path, OLD)
    (tmp_path / "a.txt").unlink()
    write(tmp_path, NEW)
    assert is_set(tmp_path, NEW)


@pytest.mark.parametrize("force", [False, True])
def test_an_input_is_never_replaced_nor_moved(tmp_path: Path, force: bool) -> None:
    (tmp_path / "a.txt").write_bytes(b"measured")
    link = tmp_path / "link.txt"
    os.link(tmp_path / "a.txt", link)
    for given_path in (tmp_path / "a.txt", link):
        with (
            pytest.raises(CmmUqError, match="is an input of this command"),
            staged(tmp_path, MINE, inputs=[given_path], force=force, expected=NEW),
        ):
            pass
    assert there(tmp_path) == {"a.txt": b"measured", "link.txt": b"measured"}


def test_force_does_not_move_an_input_of_a_former_set_away(tmp_path: Path) -> None:
    """A plan of a simulated job, into the folder of that job."""
    write(tmp_path, OLD, Owner("simulate", "job-1"))
    with (
        pytest.raises(CmmUqError, match="is an input"),
        staged(tmp_path, MINE, inputs=[tmp_path / "b.txt"], force=True),
    ):
        pass


def test_a_link_in_the_way_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere.txt").write_bytes(b"mine")
    out = tmp_path / "out"
    out.mkdir()
    (out / "a.txt").symlink_to(tmp_path / "elsewhere.txt")
    with pytest.raises(CmmUqError, match="was not written by"):
        write(out, NEW)
    write(out, NEW, force=True)
    assert (tmp_path / "elsewhere.txt").read_bytes() == b"mine"
    assert (out / "a.txt.previous").is_symlink()


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": "cmm-uq/manifest/1"}', "null", '{"schema": 3, "files": 4}']
)
def test_a_manifest_of_somebody_else_is_in_the_way_like_any_file(tmp_path: Path, text: str) -> None:
    (tmp_path / MANIFEST).write_text(text)
    assert read_manifest(tmp_path) is None
    with pytest.raises(CmmUqError, match=r"manifest\.json: was not written by"):
        write(tmp_path, NEW)


def test_a_manifest_cannot_point_out_of_its_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, OLD)
    (tmp_path / "victim.txt").write_bytes(b"mine")
    data = json.loads((out / MANIFEST).read_bytes())
    data["files"]["../victim.txt"] = {"sha256": sha256(b"mine").hexdigest(), "bytes": 4}
    (out / MANIFEST).write_text(json.dumps(data))
    with pytest.raises(CmmUqError):
        write(out, NEW)
    assert (tmp_path / "victim.txt").read_bytes() == b"mine"


def test_an_interruption_leaves_no_trace(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), staged(tmp_path / "a" / "b", MINE):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("call", ["fsync", "rename", "replace", "mkdir"])
def test_a_system_that_refuses_any_call_leaves_the_former_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """The first, second, … call fails, as on a full disk or with a file that cannot be replaced."""
    real, refused = getattr(os, call), 0
    for number in range(12):
        out = tmp_path / str(number)
        write(out, OLD)
        (out / "c.txt").write_bytes(b"a stranger's")
        left = [number]

        def refuse(*arguments: object, left: list[int] = left, **named: object) -> object:
            left[0] -= 1
            if left[0] == -1:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return real(*arguments, **named)

        with monkeypatch.context() as patched:
            patched.setattr(os, call, refuse)
            try:
                write(out, NEW, force=True)
            except OutputError as error:
                refused += "No space left on device" in str(error)
                expected = {**OLD, "c.txt": b"a stranger's"}
            else:
                expected = {**NEW, "c.txt.previous": b"a stranger's"}
        assert {name: content for name, content in there(out).items() if name != MANIFEST} == expected, number
    assert 0 < refused < 12


class Killed(BaseException):
    """Stands for a kill: nothing after it runs."""


def killed_at(number: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """While this is active, the process "dies" before its ``number``-th change of a name, and cleans nothing up."""
    left = [number]

    def counted(real: object) -> object:
        def call(*arguments: object, **named: object) -> object:
            if left[0] <= 0:
                raise Killed
            left[0] -= 1
            return real(*arguments, **named)  # type: ignore[operator]

        return call

    with monkeypatch.context() as patched:
        for name in ("rename", "replace", "unlink", "mkdir", "rmdir", "fsync"):
            patched.setattr(os, name, counted(getattr(os, name)))
        patched.setattr(shutil, "rmtree", counted(shutil.rmtree))
        yield


def test_after_a_kill_at_any_point_the_next_command_finds_the_old_set_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = []
    for number in range(200):
        out = tmp_path / str(number)
        write(out, OLD)
        (out / "c.txt").write_bytes(b"a stranger's")
        finished = False
        for _ in killed_at(number, monkeypatch):
            place = None
            try:
                with staged(out, MINE, force=True, expected=NEW) as place:
                    place.write(NEW)
                finished = True
            except Killed:
                pass
        if place is not None and place.descriptor >= 0:
            os.close(place.descriptor)  # as the system does for a process that ended
        for descriptor in _locks_below(out):
            os.close(descriptor)
        finish_interrupted(out)
        found = there(out)
        old = {**OLD, "c.txt": b"a stranger's"}
        new = {**NEW, "c.txt.previous": b"a stranger's"}
        without = {name: content for name, content in found.items() if name != MANIFEST}
        assert without in (old, new), number
        manifest = read_manifest(out)
        assert manifest is not None
        assert set(manifest.files) == set(OLD if without == old else NEW), number
        outcomes.append(without == new)
        if finished:
            break
    assert finished
    assert outcomes == sorted(outcomes)  # once committed, always completed
    assert 0 < outcomes.index(True) < len(outcomes) - 3


def _locks_below(folder: Path) -> list[int]:
    """Descriptors of this process that hold locks below a folder."""
    held = []
    for entry in Path("/proc/self/fd").iterdir() if Path("/proc/self/fd").exists() else ():
        try:
            target = str(entry.readlink())
        except OSError:
            continue
        if target.startswith(str(folder)) and ".unfinished-" in target:
            held.append(int(entry.name))
    return held


def test_what_another_process_is_staging_is_left_alone(tmp_path: Path) -> None:
    with staged(tmp_path, MINE) as other:
        write(tmp_path, NEW)
        assert other.stage.is_dir()
        other.write(OLD)
    assert is_set(tmp_path, OLD)


def test_a_process_that_is_just_putting_files_in_place_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(staging_module, "PATIENCE_S", 0.05)
    with staged(tmp_path, MINE) as other:
        other.stage.rename(tmp_path / ".placing")
        with pytest.raises(OutputError, match="another cmm-uq is writing here"):
            write(tmp_path, NEW)
        (tmp_path / ".placing").rename(other.stage)
    write(tmp_path, NEW)
    assert is_set(tmp_path, NEW)


@pytest.mark.long
@settings(deadline=None)  # it waits for the disk
@given(st.dictionaries(st.sampled_from(["a", "b", "sub/c", "d.csv"]), st.binary(max_size=20), min_size=1),
       st.dictionaries(st.sampled_from(["a", "b", "sub/c", "d.csv"]), st.binary(max_size=20), min_size=1))  # fmt: skip
def test_any_set_replaces_any_other_of_its_owner(
    tmp_path_factory: pytest.TempPathFactory, first: dict[str, bytes], second: dict[str, bytes]
) -> None:
    out = tmp_path_factory.mktemp("sets")
    write(out, first)
    write(out, second)
    assert is_set(out, second)


def test_hidden_folders_of_a_stranger_are_left_alone(tmp_path: Path) -> None:
    for name in (".unfinished-business", ".placing", ".unfinished-abc.lock"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x").write_text("mine")
    before = there(tmp_path)
    with pytest.raises(CmmUqError, match=r"\.placing: is not this program's"):
        write(tmp_path, NEW)
    assert there(tmp_path) == before


@pytest.mark.parametrize("name", ["../x", "/x", "a//b", "", "a/../b", "c:x", "a\\b", "a\0b"])
def test_an_output_cannot_leave_its_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(CmmUqError), staged(tmp_path / "out", MINE) as place:
        place.write({name: b""})
    assert not (tmp_path / "x").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_told_as_such(tmp_path: Path) -> None:
    with staged(tmp_path / "out", MINE) as place:
        (place.stage / "new" / "x.txt").symlink_to("/dev/full")
        with pytest.raises(OutputError, match="No space left"):
            place.write({"x.txt": b"x"})
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(CmmUqError, match=r"out: is a file, not a folder.*--out"), staged(tmp_path / "out", MINE):
        pass
    assert (tmp_path / "out").read_text() == "mine"


def test_a_place_below_a_file_is_told_as_unwritable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"), staged(tmp_path / "file" / "out", MINE):
        pass


def test_a_lock_that_is_just_being_made_is_not_taken_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process looks at the lock in the moment between its making and its locking: whoever stages makes another."""
    made: list[Path] = []

    def looked_at(path: Path, *, create: bool) -> int | None:
        if create and not made:
            made.append(path)
            path.touch()  # made, not locked yet
            finish_interrupted(tmp_path)
            assert not path.exists()
            return None
        return locked(path, create=create)

    monkeypatch.setattr(staging, "locked", looked_at)
    with staged(tmp_path, Owner("report", "k-1")) as stage:
        assert stage.lock.exists()
        assert stage.lock != made[0]
        finish_interrupted(tmp_path)
        assert stage.stage.exists()
        assert is_pending(tmp_path, stage.token)


def test_what_somebody_completes_is_left_to_it(tmp_path: Path) -> None:
    """The lock of a stage whose process is no more is held by whoever completes it."""
    lock, placing = tmp_path / f"{staging.STAGE}{'0' * 12}{staging.LOCK}", tmp_path / staging.PLACING
    placing.mkdir()
    (placing / "token").write_text("0" * 12)
    lock.touch()
    held = locked(lock, create=False)
    assert held is not None
    finish_interrupted(tmp_path)
    assert placing.exists()
    assert is_pending(tmp_path, "0" * 12)
    os.close(held)
    finish_interrupted(tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert not is_pending(tmp_path, "0" * 12)
