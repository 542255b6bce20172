"""Keys of job.toml that speak to the records."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError


def test_an_adjustment_lies_before_the_measurement(job: Path) -> None:
    toml = job / "job.toml"
    text = toml.read_text(encoding="utf-8")
    for day, fine in (("2004-08-31", True), ("2004-09-01", True), ("2004-09-02", False)):
        toml.write_text(text.replace("[job]\n", f"[job]\nadjusted_since = {day}\n"), encoding="utf-8")
        if fine:
            assert str(read_job(job).facts.job.adjusted_since) == day
        else:
            with pytest.raises(CmmUqError, match="adjusted_since = 2004-09-02 is after the measurement"):
                read_job(job)
