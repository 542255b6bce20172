"""The table of a batch says what results.json says, a row for each value."""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path

import pytest

from cmm_uq import __version__
from cmm_uq.app.commands.laboratory.batch_jobs import COLUMNS, rows, write_table
from tests.artefacts.simulated import outcome
from tests.conftest import ROOT
from tests.laboratory.schedule import canned

NAMES = [name for name, _, _ in COLUMNS]


def test_every_quantity_and_statement_of_a_certificate_is_a_row() -> None:
    results = outcome("iota-1102-20C").results
    found = {row[NAMES.index("name")]: dict(zip(NAMES, row, strict=True)) for row in rows(results)}
    estimates = {f"{effect}.{name}" for effect, values in results["estimates"].items() for name in values}
    figures = {f"accuracy.{name}" for name in results["accuracy_uncertainty"]}
    stated = {f"performance:{one['characteristic']}" for one in results["conformity"]}
    assert set(found) == estimates | figures | stated | {"artefact.length_mm"}
    scale, quantity = found["scale_x.ppm"], results["estimates"]["scale_x"]["ppm"]
    assert [scale[name] for name in ("value", "u", "lower", "upper")] == [
        quantity["value"], quantity["u"], *quantity["interval95"],
    ]  # fmt: skip
    assert [scale[name] for name in ("job", "origin", "day", "unit", "version", "diagnosis")] == [
        "iota-1102-20C", "measured", dt.date(2004, 9, 1), "ppm", __version__, "consistent",
    ]  # fmt: skip
    assert (found["squareness_xy.angle_arcsec"]["unit"], found["accuracy.b89_range_um"]["unit"]) == ("″", "µm")
    assert found["scale_x.ppm"]["quantity"] == "Scale error of X"
    (statement,) = results["conformity"]
    performance = found[f"performance:{statement['characteristic']}"]
    assert [performance[name] for name in ("value", "u", "lower", "limit", "decision")] == [
        statement["value_um"], statement["u_um"], statement["value_um"] - 2 * statement["u_um"], statement["limit_um"],
        "fail",
    ]  # fmt: skip


def test_each_row_is_of_its_columns_types_and_lists_of_positions_are_no_values(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    shifted = canned.results({"id": "s", "date": dt.date(2026, 1, 1)}, {}, 0) | {
        "artefact": {"distance_mm": [0.0, 20.0]}
    }
    write_table(tmp_path / "v.parquet", [shifted, outcome("iota-1102-20C").results], force=False)
    table = parquet.read_table(tmp_path / "v.parquet")
    assert table.column_names == NAMES
    assert table.column("name").to_pylist()[:2] == ["scale_x.ppm", "scale_x.ppm"]
    assert table.column("job").to_pylist().count("s") == 1


def test_the_page_says_what_each_column_is() -> None:
    page = (ROOT / "docs" / "records" / "batch.md").read_text(encoding="utf-8")
    told = re.findall(r"(?m)^\| `(\w+)` \| (?:text|date|number) \| (.+) \|$", page)
    assert told == [(name, meaning) for name, _, meaning in COLUMNS]
