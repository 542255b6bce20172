"""Leftovers of a process that is no more are acted upon by one process at a time, and never those of one that lives."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cmm_uq.base.output import Owner, finish_interrupted, is_pending, staged, staging
from cmm_uq.base.output.staging import locked


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
