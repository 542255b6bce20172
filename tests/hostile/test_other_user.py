"""Folders of another user are refused in words, and nothing in them is changed; every command has cases."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

pytest.importorskip("pyhanko")

from benchmarks.hostile.every_command import commands
from benchmarks.hostile.other_user import LINES, STATES, attempt, available
from benchmarks.hostile.processes import memory

LINE = {line.words.removesuffix(" --records reports/records.db"): line for line in LINES}
CLOSED, READ_ONLY = "another user's, 0700", "another user's, 0755"
CASES = (
    ("due", "", "", 0, ""),
    ("due", "reports", CLOSED, 3, "reports/records.db: cannot be opened: Permission denied"),
    ("due", "reports", READ_ONLY, 0, ""),
    ("qif reports/mount/results.json --out out/results.qif", "reports/mount", CLOSED, 2,
     "reports/mount/results.json: cannot be read: Permission denied"),
    ("sign reports/mount/certificate.pdf reports/mount/certificate.xml --key keys/key.p12 --out out --records none",
     "reports/mount", CLOSED, 2, "reports/mount/certificate.pdf: cannot be read: Permission denied"),
    ("verify reports/mount --no-rerun", "reports/mount", "one's own, 0400", 2,
     "manifest.json: cannot be read: Permission denied"),
    ("budget truth/budget.toml --out out", "truth", "one's own, 0400", 2, "Permission denied"),
    ("budget truth/budget.toml --out out", "out", READ_ONLY, 3, "out: cannot be written: Permission denied"),
    ("report job --out reports/mount", "reports/mount", "one's own, with another's files, 0600", 2,
     "certificate.html: cannot be read: Permission denied"),
    ("report job --out reports/mount", "reports/mount", "another user's, 1777, with another's files", 3,
     "reports/mount: cannot be written: Operation not permitted"),
    ("records import reports/mount --records out/new.db", "reports/mount", "one's own, 0400", 2,
     "reports/mount: may not be entered: Permission denied"),
    ("records import reports/mount --records out/new.db", "reports/mount", "one's own, with another's files, 0600", 2,
     "reports/mount/manifest.json: cannot be read: Permission denied"),
    ("desk job --no-open", "job", "one's own, 0400", 2, "job: may not be entered: Permission denied"),
    ("verify reports/mount --no-rerun", "reports/mount", "one's own, 0500", 3, ""),
)  # fmt: skip


def test_every_command_has_cases() -> None:
    assert sorted({line.command for line in LINES}) == commands()


def test_states_are_of_another_user_and_of_this_one_with_and_without_write_permission() -> None:
    assert {(state.folder[0], bool(state.folder[1] & 0o222)) for state in STATES.values()} == {
        (owner, write) for owner in (0, 65534) for write in (True, False)
    }


@pytest.mark.long
@pytest.mark.skipif(not available(), reason="this user cannot become another, or another may not read the package")
@pytest.mark.parametrize(("words", "place", "state", "code", "says"), CASES)
def test_a_folder_that_is_closed_is_named_and_left(words: str, place: str, state: str, code: int, says: str) -> None:
    with tempfile.TemporaryDirectory(dir=memory()) as folder:
        Path(folder).chmod(0o755)  # another user passes through it
        outcome, wrong = attempt(LINE[words], place, state, Path(folder) / "laboratory")
    assert (outcome.code, wrong) == (code, [])
    assert says in outcome.stderr
