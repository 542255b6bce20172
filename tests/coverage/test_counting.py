"""What the coverage study counts: intervals that hold, exact binomial intervals, and runs that are taken up again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.coverage import study
from benchmarks.coverage.cells import Cell
from benchmarks.coverage.measuring import kept, measured
from benchmarks.coverage.tally import Count, holds, pooled, tallies


def record(
    number: int, held: dict[str, bool], *, cell: Cell | None = None, u: float = 1.0, **more: Any
) -> dict[str, Any]:
    intervals = {name: [0.0, u, -1.0, 1.0, 0.5 if each else 2.0] for name, each in held.items()}
    told = {"cell": (cell or Cell("plate", "axis × 2")).name, "number": number, "noisy_axis": "y", "seconds": 1.0,
            "verdict": "consistent", "intervals": intervals}  # fmt: skip
    return told | more


def test_an_interval_that_was_never_hit_is_that_of_clopper_and_pearson() -> None:
    """Closed form: of 0 of n, the upper end is 1 − (α/2)^(1/n); of n of n, the lower end (α/2)^(1/n)."""
    assert Count(0, 200).interval == pytest.approx((0, 100 * (1 - 0.0005 ** (1 / 200))), rel=1e-12)
    assert Count(200, 200).interval == pytest.approx((100 * 0.0005 ** (1 / 200), 100), rel=1e-12)


def test_a_phase_holds_also_a_turn_further() -> None:
    assert holds("probe_lobing.phase_rad", 3.0, 3.4, -3.0)
    assert holds("probe_lobing.phase_rad", -3.4, -3.0, 3.1)
    assert not holds("probe_lobing.phase_rad", 3.0, 3.2, -3.0)
    assert not holds("scale_x.ppm", 3.0, 3.4, 3.2 - 2 * np.pi)


def test_groups_the_noisy_axis_and_cries_are_counted_apart() -> None:
    records = [
        record(0, {"scale_x.ppm": True, "scale_y.ppm": False, "artefact.length_mm": True, "lines.1.slope_ppm": False},
               verdict="undetermined"),
        record(1, {"scale_x.ppm": False, "scale_y.ppm": True, "figures.mean_length_mm": True, "noise.coordinate_um": False},
               verdict="explained"),
    ]  # fmt: skip
    tally = tallies([*records, records[0]])["plate, axis × 2"]
    assert tally.recordings == 2
    assert (tally.group("factors"), tally.group("sizes"), tally.group("figures")) == (
        Count(2, 4),
        Count(1, 1),
        Count(1, 2),
    )
    assert (tally.noisy, tally.cries, tally.group("noise")) == (Count(1, 2), Count(1, 2), Count(0, 1))


def test_cells_of_a_kind_are_pooled_and_faults_are_no_hits() -> None:
    held = {"scale_x.ppm": True}
    fault = {"cell": "plate, axis × 2", "number": 5, "noisy_axis": "x", "seconds": 2.0, "fault": "ValueError: no"}
    other, apart = record(0, held, cell=Cell("ballbar", "axis × 2")), record(1, held, cell=Cell("plate", "t3"))
    records = [record(0, held), other, apart, fault]
    total = pooled(tallies(records), lambda cell: cell.noise == "axis × 2")
    assert (total.recordings, total.group("factors"), dict(total.faults)) == (3, Count(2, 2), {"ValueError: no": 1})


def test_a_run_is_taken_up_where_it_was_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Cell("plate", "axis × 2")
    file = tmp_path / "plate_axis_×_2.jsonl"
    file.write_text(json.dumps(record(0, {"scale_x.ppm": True})) + '\n{"cell": "plate, ax', encoding="utf-8")
    tasks = study.waiting([cell], tmp_path, 3, 2)
    assert tasks == [(cell, 3, 1)]
    monkeypatch.setattr(study, "run", lambda tasks, processes, work: (record(number, {}) for _, _, number in tasks))
    study.measure(tasks, tmp_path, 1)
    assert [each["number"] for each in kept(tmp_path)] == [0, 1]
    assert study.waiting([cell], tmp_path, 3, 2) == []


@pytest.mark.long
def test_a_recording_goes_through_the_api_and_comes_back_with_every_truth() -> None:
    found = measured((Cell("gauge blocks", "axis × 2"), 1, 0))
    assert "fault" not in found
    lines = [f"lines.{i}.slope_ppm" for i in range(1, 13)]
    scales = [f"scale_{a}.ppm" for a in "xyz"]
    assert set(found["intervals"]) == {*scales, "probe_radius.um", "artefact.length_mm", *lines}
    for value, u, low, high, truth in found["intervals"].values():
        assert low < value < high
        assert abs(value - truth) < 8 * u
