"""Exports on the desk: every cell with its meaning, every correction a command that reads the same."""

from __future__ import annotations

import shlex
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.app.cli.jobs import import_keys
from cmm_uq.app.desk.exports import corrected, first_keys, keys_of, read, remembered
from cmm_uq.app.desk.place import plans_in
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import imported
from tests.jobs.importing.laboratory import EXPORTS
from tests.jobs.importing.test_interferometer import written


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("exports")


@cache
def laid_out(folder: Path, name: str) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    """An export, the keys that it needs, and how it is read with them."""
    file, made = EXPORTS[name]
    export = made()
    path = folder / name / file
    path.parent.mkdir()
    path.write_bytes(export.content)
    return path, dict(export.keys), read(str(path), dict(export.keys))


@cache
def laid_out_and_placed(folder: Path, name: str) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    """The same with places of its lines."""
    path, keys, found = laid_out(folder, name)
    keys = placed(found, keys)
    return path, keys, read(str(path), keys)


def placed(found: dict[str, Any], keys: dict[str, Any]) -> dict[str, Any]:
    return (
        keys | {"lines": {name: f"along X from 0,{100 * i},0" for i, (name, *_) in enumerate(found["lines"])}}
        if found["lines"]
        else keys
    )


def as_said(command: str) -> ImportKeys:
    """Keys of a command as the command line reads it."""
    options: dict[str, list[str]] = {"--column": [], "--key": [], "--line": []}
    words = shlex.split(command)[3:]
    for option, value in zip(words[::2], words[1::2], strict=True):
        options[option].append(value)
    return import_keys(*options.values())


@pytest.mark.parametrize("name", EXPORTS)
def test_the_command_on_the_page_reads_the_same(name: str, exports: Path) -> None:
    path, keys, found = laid_out_and_placed(exports, name)
    assert found["problem"] is None, found["problem"]
    assert found["example"]
    content = path.read_bytes()
    here, there = (imported(content, path.name, one) for one in (keys_of(keys), as_said(found["command"])))
    assert here.columns.keys() == there.columns.keys()
    assert all(np.array_equal(here.columns[one], there.columns[one]) for one in here.columns)


@pytest.mark.parametrize("name", EXPORTS)
def test_every_column_that_is_used_is_coloured_where_it_stands(name: str, exports: Path) -> None:
    _, _, found = laid_out_and_placed(exports, name)
    meanings = {meaning for _, meaning in found["columns"]}
    assert {"x_mm", "y_mm", "z_mm"} <= meanings or meanings & {"length_mm", "deviation_um", "deviation_mm"}
    figures = [cells for _, cells, head in found["rows"] if not head]
    assert figures
    column = next(
        i
        for i, (_, meaning) in enumerate(found["columns"])
        if meaning in ("x_mm", "length_mm", "deviation_um", "deviation_mm")
    )
    first = 1 if name == "remarks_among_points" else 0  # below its head stands a remark
    assert any(char.isdigit() for char in figures[first][column])


UNSEEN = Path(__file__).parents[2] / "jobs" / "importing"


@pytest.mark.long(but="T0")  # some exports stand for all, which are read in tests/jobs/importing
@pytest.mark.parametrize(
    "path",
    [path for path in sorted(UNSEEN.glob("*_exports/*")) if not path.name.endswith((".json", ".source.txt", "SUMS"))],
    ids=lambda path: path.name[:3],
)
def test_list_boxes_that_nobody_touched_are_no_answer(path: Path) -> None:
    """Of tables that are read by their rows too, whose columns the page can show in part alone."""
    chosen = {str(i): meaning for i, (_, meaning) in enumerate(read(str(path), {})["columns"])}
    assert "columns" not in corrected(str(path), {}, chosen, {"unit": "mm"})


@pytest.mark.parametrize("name", EXPORTS)
def test_a_form_that_changes_nothing_says_nothing(name: str, exports: Path) -> None:
    path, keys, found = laid_out(exports, name)
    chosen = {str(i): meaning for i, (_, meaning) in enumerate(found["columns"])}
    lines = {"lines": keys.get("lines", {})}
    others = {one: str(value) for one, value in keys.items() if one not in ("columns", "lines")}
    assert corrected(str(path), keys, chosen, others | lines) == keys_of(keys).model_dump(exclude_defaults=True)


EXCHANGED = "n;Messpunkt;Achse A;Achse B;Achse C\n1;1;10,0;20,0;30,0\n1;2;110,0;20,5;30,5\n"
EXCHANGED += "2;1;12,0;22,0;33,0\n2;2;112,0;22,5;33,5\n"


def test_columns_nobody_understands_are_named_by_choosing_them(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(EXCHANGED, encoding="utf-8")
    found = read(str(path), {})
    assert found["problem"] is not None
    assert not found["understood"]
    chosen = {"0": "measurement", "1": "point", "2": "y_mm", "3": "x_mm", "4": "z_mm"}
    keys = corrected(str(path), {}, chosen, {"unit": "mm"})
    found = read(str(path), keys)
    assert found["problem"] is None, found["problem"]
    table = imported(path.read_bytes(), path.name, as_said(found["command"]))
    assert table.columns["x_mm"].tolist() == [20.0, 20.5, 22.0, 22.5]
    assert table.columns["y_mm"].tolist() == [10.0, 110.0, 12.0, 112.0]
    back = corrected(str(path), keys, {**chosen, "2": "x_mm", "3": "y_mm"}, {"unit": "mm"})
    assert imported(path.read_bytes(), path.name, keys_of(back)).columns["x_mm"].tolist() == [10.0, 110.0, 12.0, 112.0]


def test_a_column_taken_for_another_is_corrected_by_its_heading(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("measurement;point;X [mm];Y [mm];Z [mm];X corr [mm]\n" + "".join(
        f"{m};{p};{100 * p}.5;0.5;{m}.5;{100 * p}.7\n" for m in (1, 2) for p in (1, 2)), encoding="utf-8")  # fmt: skip
    taken = {str(i): meaning for i, (_, meaning) in enumerate(read(str(path), {})["columns"])}
    keys = corrected(str(path), {}, {**taken, "2": "", "5": "x_mm"}, {})
    assert keys == {"columns": {"x_mm": "X corr [mm]"}}
    found = read(str(path), keys)
    assert found["columns"][5][1] == "x_mm"
    assert "--column 'x_mm=X corr [mm]'" in found["command"]
    assert imported(path.read_bytes(), path.name, keys_of(keys)).columns["x_mm"].tolist() == [
        100.7,
        200.7,
        100.7,
        200.7,
    ]


def test_answers_are_remembered_for_the_next_export_with_the_same_head(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CMM_UQ_FORMATS", str(tmp_path / "formats"))
    head = "measurement;point;X [mm];Y [mm];Z [mm];X corr [mm]\n"
    first, second, other = (tmp_path / name for name in ("a.csv", "b.csv", "c.csv"))
    first.write_text(head + "1;1;1.5;0.5;1.5;1.7\n1;2;9.5;0.5;1.5;9.7\n", encoding="utf-8")
    second.write_text(head + "1;1;2.5;0.5;1.5;2.7\n1;2;8.5;0.5;1.5;8.7\n", encoding="utf-8")
    other.write_text(head.replace("corr", "raw") + "1;1;2.5;0.5;1.5;2.7\n1;2;8.5;0.5;1.5;8.7\n", encoding="utf-8")
    keys = {"columns": {"x_mm": "X corr [mm]"}}
    remembered(str(first), keys)
    remembered(str(first), keys | {"unit": "mm"})  # another answer takes the place of the first
    assert first_keys(str(second)) == keys | {"unit": "mm"}
    assert first_keys(str(other)) == {}


def test_lines_lie_as_a_plan_of_the_folder_has_them(tmp_path: Path) -> None:
    (tmp_path / "reports" / "a").mkdir(parents=True)
    plan = tmp_path / "reports" / "a" / "plan.csv"
    plan.write_text("measurement,point,repeat,x_mm,y_mm,z_mm\n1,1,1,10,20,30\n1,2,1,310,420,30\n", encoding="utf-8")
    export = tmp_path / "bar.csv"
    export.write_text("Position;Length 1 (mm)\n1;500.0020\n", encoding="utf-8")
    assert plans_in(tmp_path) == ["reports/a/plan.csv"]
    keys = corrected(str(export), {}, {}, {"plan": str(plan)})
    assert keys == {"lines": {"1": "from 10.0,20.0,30.0 to 310.0,420.0,30.0"}}
    assert read(str(export), keys)["problem"] is None


def test_a_row_for_each_coordinate_is_shown_as_points(tmp_path: Path) -> None:
    export = tmp_path / "rows.csv"
    rows = "1;1;X;1,5\n1;1;Y;2,5\n1;1;Z;-3,5\n1;2;X;4,5\n1;2;Y;5,5\n1;2;Z;6,5\n"
    export.write_text(f"Messung;Punkt;Achse;Ist (mm)\n{rows}", encoding="utf-8")
    found = read(str(export), {})
    assert [meaning for _, meaning in found["columns"]] == ["measurement", "point", "x_mm", "y_mm", "z_mm"]
    assert found["rows"][1][1] == ["1", "1", "1.5", "2.5", "-3.5"]


def test_where_runs_lie_is_asked_with_what_their_axis_says(tmp_path: Path) -> None:
    path = tmp_path / "x.rtl"
    path.write_text(written(), encoding="utf-8")
    asked = read(str(path), {})
    assert asked["lines"] == [("X", "along X from 0,?,?", "along X from 0,200,300", "")]
    assert asked["example"] == "axis X, run 1: 0 mm, +0 µm"
    whole = read(str(path), {"lines": {"X": "along X from 0,200,300"}})
    assert whole["problem"] is None
    assert whole["amounts"] == "1 set-up, 12 points in each, 1 repeat"


def test_how_much_was_read_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(
        f"{m};{ball};{run};{100 * m + ball};{run / 1000};5\n" for m in (1, 2) for run in (1, 2) for ball in (1, 2, 3)
    )
    path.write_text("Position;Ball;Repeat;X [mm];Y [mm];Z [mm]\n" + rows + "3;1;1;7;8;9\n", encoding="utf-8")
    assert read(str(path), {})["amounts"] == "3 set-ups, 1 to 3 points in each, 1 to 2 repeats"
    lengths = "".join(f"{line};{n};{n}.001;{n}.002\n" for line in "AB" for n in (100, 250, 400, 550, 700))
    path.write_text("Line;Nominal (mm);Run 1 (mm);Run 2 (mm)\n" + lengths, encoding="utf-8")
    lines = {"A": "along X from 0,0,0", "B": "along Y from 0,0,0"}
    assert read(str(path), {"lines": lines})["amounts"] == "10 lengths, 2 runs"
