"""How a recording was taken live: on the certificate, in results.json, and never passed off as something else."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.clauses import traceability_section
from cmm_uq.certificate.document import Facts
from cmm_uq.certificate.origin import origin_warnings
from cmm_uq.certificate.results.contents import head
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.derived_job import kept_inputs
from tests.certificate.saying import leaves, said

SAID: dict[str, Any] = {
    "schema": "cmm-uq/acquired/1", "program": "cmm-uq 1", "simulated": False,
    "sessions": [{"number": 1, "begin_utc": "2026-05-31T08:00:00Z", "journal": "acquisition/0001-events.jsonl", "sha256": ""}],
    "instruments": [
        {"name": "air", "maker": "Fluke", "model": "1529", "serial": "B123", "firmware": "2.0", "certificate": "K-2031"},
        {"name": "cmm"},
    ],
    "typed": 2, "gaps": [{"instrument": "air", "since_s": 60.0, "lasted_s": 12.0, "why": "it said nothing"}],
    "columns": {"temp_air_c": {"u": 0.002, "u_largest": 0.004, "missing": []}},
    "undone": [{"measurement": 1, "point": 2, "repeat": 1, "reason": "slipped"}], "clock_jumps_s": [3600.0],
}  # fmt: skip


def taken(folder: Path, iota: Path, **more: Any) -> Path:
    """The example's job with its recording said to be taken live."""
    shutil.copytree(iota, folder)
    digest = hashlib.sha256((folder / "ballbar.csv").read_bytes()).hexdigest()
    text = json.dumps({**SAID, "recording_sha256": [digest], **more})
    (folder / "ballbar.acquired.json").write_text(text, encoding="utf-8")
    return folder


def test_its_certificate_names_instruments_gaps_and_joins(tmp_path: Path, iota: Path) -> None:
    section = traceability_section(read_job(taken(tmp_path / "job", iota)), ())
    assert [text for text in leaves(section) if not said(text, json.dumps(SAID) + "temp_air_c")] == []
    facts = section.blocks[0]
    assert isinstance(facts, Facts)
    assert dict(facts.rows) == {
        "Recording": "Taken live by cmm-uq 1. 2 points were typed by the operator. "
        "1 point was taken back, with its reason in the journal.",
        "Instruments": "air, Fluke 1529, serial number B123, firmware 2.0, certificate K-2031; cmm, no certificate stated",
        "Joined by time": "temp_air_c: u = 0.002 by interpolation in time, 0.004 at most",
        "Gaps": "air from 60 s for 12 s: it said nothing; the computer's clock was moved by 3600 s",
    }


def test_what_was_changed_or_is_missing_is_warned_of_first(tmp_path: Path, iota: Path) -> None:
    job = read_job(taken(tmp_path / "job", iota))
    assert origin_warnings(job) == []
    gap = {"temp_air_c": {"u": 0.0, "u_largest": 0.0, "missing": [[1, 1, 1], [2, 1, 1]]}}
    changed = read_job(taken(tmp_path / "changed", iota, columns=gap, recording_sha256=["0" * 64], damaged=["line 3"]))
    assert origin_warnings(changed) == [
        "The recording was changed after it was taken live.",
        "Damaged lines of the journal are not in the recording.",
        "temp_air_c is not used: 2 of the points have no value of it.",
    ]


def test_its_results_say_the_same_and_hash_the_file(tmp_path: Path, iota: Path) -> None:
    told = head(read_job(taken(tmp_path / "job", iota)))
    assert told["acquisition"]["instruments"][0]["certificate"] == "K-2031"
    assert told["acquisition"]["gaps"][0]["lasted_s"] == 12.0
    assert "ballbar.acquired.json" in told["job"]["inputs_sha256"]


def test_a_recording_that_was_typed_by_hand_has_none_of_it(iota: Path) -> None:
    job = read_job(iota)
    assert job.acquired is None
    assert "acquisition" not in head(job)


def test_a_job_derived_from_it_was_not_taken_live(tmp_path: Path, iota: Path) -> None:
    assert "ballbar.acquired.json" not in kept_inputs(read_job(taken(tmp_path / "job", iota)))


def test_what_is_no_such_file_is_refused(tmp_path: Path, iota: Path) -> None:
    with pytest.raises(CmmUqError, match=r"ballbar.acquired.json: typed: does not say how the recording was taken"):
        read_job(taken(tmp_path / "a", iota, typed="two"))
    with pytest.raises(CmmUqError, match="has the layout"):
        read_job(taken(tmp_path / "b", iota, schema="cmm-uq/acquired/9"))
    with pytest.raises(CmmUqError, match=r"the recording was simulated, and job\.toml says measured"):
        read_job(taken(tmp_path / "c", iota, simulated=True))


def test_its_name_follows_that_of_the_recording() -> None:
    assert provenance_name("a/bar.csv") == "a/bar.acquired.json"
