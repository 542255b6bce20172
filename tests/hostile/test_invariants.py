"""The checks of the study find what they are for: each is shown what keeps its rule and what breaks it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from benchmarks.hostile.invariants import Outcome, lost, problems, refusal_problems, set_problems, snapshot

TRACE = """Traceback (most recent call last):
  File "/x/cmm_uq/base/points.py", line 12, in f
  File "/lib/json.py", line 3, in g
ValueError: no
"""


@pytest.mark.parametrize(
    ("outcome", "expected"),
    [
        (Outcome(0, "", "", 40.0), []),
        (Outcome(2, "", "cmm-uq: job.toml: is missing. Add it\n", 1.0), []),
        (Outcome(2, "", "cmm-uq: no\n", 11.0), ["refuses only after more than 10 s"]),
        (Outcome(None, "", "", 60.0), ["hangs"]),
        (Outcome(1, "", TRACE, 1.0), ["traceback: ValueError at cmm_uq/base/points.py:12"]),
        (Outcome(1, "", "", 1.0), ["exit code 1"]),
        (Outcome(3, "", "cmm-uq: a fault of the program: KeyError: 'x'\n", 1.0), ["fault: KeyError"]),
        (Outcome(-11, "", "", 1.0), ["exit code -11"]),
        (Outcome(0, "", "x.py:1: RuntimeWarning: overflow\n", 1.0), ["warning: RuntimeWarning"]),
        (Outcome(0, "", "hello\n", 1.0), ["speaks on stderr"]),
    ],
)
def test_what_a_run_may_not_do(outcome: Outcome, expected: list[str]) -> None:
    assert problems(outcome) == expected


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("cmm-uq: " + "x" * 292 + "\n", []),
        ("cmm-uq: " + "x" * 293 + "\n", ["refusal longer than 300 characters"]),
        ("cmm-uq: a\nb\n", ["refusal of several lines"]),
        ("cmm-uq: a\x1b[31m\n", ["control characters in a refusal"]),
        ("cmm-uq: a\u202eb\n", ["control characters in a refusal"]),
        ("Usage: cmm-uq [OPTIONS]\nerror\n", ["refusal of several lines (usage)"]),
        ("no\n", ["refusal that does not name the program"]),
        ("", ["refuses without a word"]),
    ],
)
def test_a_refusal_is_one_short_line(said: str, expected: list[str]) -> None:
    assert refusal_problems(said) == expected


def manifest(folder: Path, **files: bytes) -> None:
    facts = {
        name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)} for name, content in files.items()
    }
    (folder / "manifest.json").write_text(json.dumps({"files": facts}))
    for name, content in files.items():
        (folder / name).write_bytes(content)


def test_a_folder_is_a_set_when_its_manifest_says_so(tmp_path: Path) -> None:
    assert set_problems(tmp_path) == ["no manifest"]
    manifest(tmp_path, a=b"1", b=b"2")
    assert set_problems(tmp_path) == []
    (tmp_path / "a").write_bytes(b"3")
    assert set_problems(tmp_path) == ["a file has other bytes than its manifest"]
    (tmp_path / "b").unlink()
    (tmp_path / ".unfinished-x").mkdir()
    assert set_problems(tmp_path) == [
        "left over: .unfinished-*", "a file has other bytes than its manifest", "a file of the manifest is missing",
    ]  # fmt: skip


def test_results_with_an_infinity_are_found(tmp_path: Path) -> None:
    manifest(tmp_path, **{"results.json": b'{"u": Infinity}'})
    assert set_problems(tmp_path) == ["results.json is not finite JSON"]


def test_a_file_is_lost_unless_a_copy_of_its_bytes_is_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_bytes(b"measured")
    (tmp_path / "fifo").symlink_to("mine.csv")
    before = snapshot(tmp_path)
    assert lost(before, before) == []
    (tmp_path / "mine.csv").write_bytes(b"simulated")
    assert lost(before, snapshot(tmp_path)) == ["lost: mine.csv"]
    assert lost(before, snapshot(tmp_path), own=frozenset({"mine.csv"})) == []
    (tmp_path / "mine.csv.previous").write_bytes(b"measured")
    assert lost(before, snapshot(tmp_path)) == []
