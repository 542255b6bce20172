"""The least uncertainty that a laboratory may state, as its table of job.toml says it."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.identification import Capability, LengthCapability

WHOLE = Capability(length=LengthCapability(a_um=0.4, k=500.0), scale_ppm=1.5, angle_arcsec=0.3)


@pytest.mark.parametrize(("unit", "length_mm", "least"), [
    ("µm", 800.0, 2.0), ("mm", 800.0, 0.002), ("µm", 0.0, 0.4), ("ppm", 800.0, 1.5), ("µm/m", 800.0, 1.5), ("″", 800.0, 0.3),
    ("″/m", 800.0, 0.0), ("°C", 800.0, 0.0),
])  # fmt: skip
def test_a_length_grows_by_its_formula_and_ratios_and_angles_have_their_own_figure(
    unit: str, length_mm: float, least: float
) -> None:
    """0.4 µm + 800 mm / 500 mm/µm = 2.0 µm."""
    assert WHOLE.least(unit, length_mm) == pytest.approx(least, rel=1e-12)


def test_what_is_not_given_asks_for_nothing() -> None:
    assert {Capability().least(unit, 1000.0) for unit in ("mm", "µm", "ppm", "″")} == {0.0}
    assert Capability(length=LengthCapability(a_um=2.0)).least("µm", 5000.0) == 2.0


@pytest.mark.parametrize(("line", "message"), [
    ("cmc = { length = { a_um = -1.0 } }", "greater than 0"),
    ("cmc = { lenght = { a_um = 1.0 } }", "unknown key"),
    ("cmc = 1.5", "must be a table of keys"),
])  # fmt: skip
def test_a_capability_that_is_none_is_refused_with_its_key(job: Path, line: str, message: str) -> None:
    path = job / "job.toml"
    path.write_text(
        path.read_text(encoding="utf-8").replace("[machine]\n", f"[laboratory]\n{line}\n[machine]\n", 1),
        encoding="utf-8",
    )
    with pytest.raises(CmmUqError, match=message) as error:
        read_job(job)
    assert "[laboratory] cmc" in str(error.value.where)
