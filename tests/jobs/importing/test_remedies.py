"""What a message of an import says to do helps: followed, the export is read, or asks the next question."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from tests.app.cli.process import run

EXPORTS = {
    "unit": "Measurement;Point;X;Y;Z\n1;1;1;0;0\n1;2;2;0;0\n",
    "thousands": "Measurement;Point;X [mm];Y [mm];Z [mm]\n1;1;1,234;2,345;3,456\n",
    "two columns": "Measurement;Point;X [mm];X actual;Y [mm];Z [mm]\n1;1;1;1;0;0\n",
    "no numbers": "X [mm];Y [mm];Z [mm]\n1;0;0\n2;0;0\n",
    "one place": "Nominal (mm);Measured (mm)\n100;100.002\n",
    "several lines": "Line;Nominal (mm);Measured (mm)\nA;100;100.002\nB;100;100.003\n",
    "unit of deviations": "Line;Nominal (mm);Deviation\n1;100;2\n1;250;3\n",
    "runs": "Line;Nominal (mm);Run 1;Run 2\n1;100;2;1\n1;250;3;1\n",
    "another reference": "Line;Nominal (mm);Measured (mm);Deviation (µm)\n1;100.0000;100.0020;7.0\n",
    "which lie together": "Object;Nominal (mm);Measured (mm)\nA;100;100.002\nA;250;250.001\nB;100;100.003\n",
}
"""By what each leaves open."""
OPTION = re.compile(r'--(?:column|key|line) (?:"[^"]*"|[^\s",]+(?:"[^"]*")?)')


@pytest.mark.long
@pytest.mark.parametrize("name", EXPORTS)
def test_following_what_a_message_says_reads_the_export(name: str, tmp_path: Path) -> None:
    (tmp_path / "export.csv").write_text(EXPORTS[name], encoding="utf-8")
    options: list[str] = []
    questions: list[str] = []
    for _ in range(5):
        ended = run("import", "export.csv", *options, cwd=tmp_path)
        if ended.returncode == 0:
            break
        told = re.search(r"\. (?:Say|Name)[^.]*:?.*", ended.stderr.replace("…", "").replace("=N", "=2"), re.DOTALL)
        assert told, ended.stderr
        followed = re.findall(OPTION, told[0])
        assert followed, ended.stderr
        given = [option for option in followed if option.split("=")[0] == followed[0].split("=")[0]]
        if followed[0].startswith("--key"):
            given = given[:1]
        assert given[0] not in questions, ended.stderr  # no question twice
        questions.append(given[0])
        options += [part for option in given for part in shlex.split(option)]
    assert ended.returncode == 0, ended.stderr
    assert questions


def test_a_remedy_names_no_column_by_its_number_alone() -> None:
    """1, 2, 3 for x, y, z reads numbers of points as coordinates where followed as it stands."""
    source = "".join(
        path.read_text(encoding="utf-8") for path in (Path(__file__).parents[3] / "cmm_uq/jobs/importing").glob("*.py")
    )
    assert not re.search(r"fix=.*x_mm = \d", source)


def test_columns_that_are_said_twice_are_two_points_in_a_row_and_a_key_said_twice_is_refused(tmp_path: Path) -> None:
    (tmp_path / "export.csv").write_text("Bar;A;B;C;D;E;F\n1;1;2;3;400;2;3\n", encoding="utf-8")
    options = ("--column", "measurement=1", "--key", "unit=mm", "--key", "delimiter=;")
    columns = ("--column", "x_mm=2,5", "--column", "y_mm=3", "--column", "y_mm=6", "--column", "z_mm=4,7")
    ended = run("import", "export.csv", *options, *columns, "--out", "recording.csv", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "recording.csv").read_text().splitlines()[1:] == ["1,1,1.0,2.0,3.0", "1,2,400.0,2.0,3.0"]
    twice = run("import", "export.csv", "--key", "unit=mm", "--key", "unit=inch", cwd=tmp_path)
    assert twice.returncode == 2
    assert "unit is said twice" in twice.stderr


def test_an_answer_is_remembered_for_the_next_export_of_its_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CMM_UQ_FORMATS", str(tmp_path / "formats"))
    head = "Line;Nominal (mm);Run 1;Run 2\n"
    (tmp_path / "one.csv").write_text(f"{head}1;100;2;1\n", encoding="utf-8")
    (tmp_path / "two.csv").write_text(f"{head}1;250;3;4\n", encoding="utf-8")
    line, answer = (
        ("--line", "along X from 0,0,0"),
        ("--column", "deviation_um=Run 1", "--column", "deviation_um=Run 2"),
    )
    assert run("import", "one.csv", *line, cwd=tmp_path).returncode == 2
    assert run("import", "one.csv", *line, *answer, "--save-as", "lab-step-gauge", cwd=tmp_path).returncode == 0
    again = run("import", "two.csv", *line, "--out", "two-read.csv", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "As remembered in" in again.stdout
    assert (tmp_path / "two-read.csv").read_text().splitlines()[2].startswith("1,2,1,250.003,")
    taken = run("import", "one.csv", *line, *answer, "--save-as", "lab-step-gauge", cwd=tmp_path)
    assert (taken.returncode, "nothing is overwritten" in taken.stderr) == (3, True)


def test_a_name_of_a_remembered_format_is_no_path(monkeypatch: pytest.MonkeyPatch) -> None:
    from cmm_uq.jobs.importing.answers import path_of

    with pytest.raises(CmmUqError, match="is no name"):
        path_of("../elsewhere")


def test_an_answer_for_another_file_stands_in_no_one_s_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers of a UTF-16 export are tried on every later one, which is none."""
    monkeypatch.setenv("CMM_UQ_FORMATS", str(tmp_path / "formats"))
    (tmp_path / "wide.csv").write_text("Messung;Kugel;X;Y;Z\n1;1;0,5;0;0\n1;2;9,5;0;0\n", encoding="utf-16")
    (tmp_path / "plain.csv").write_text("Messung;Kugel;X;Y;Z [mm]\n1;1;0.5;0;0\n1;2;9.5;0;0\n", encoding="utf-8")
    keys = ("--key", "encoding=utf-16", "--key", "unit=mm")
    assert run("import", "wide.csv", *keys, "--save-as", "wide", cwd=tmp_path).returncode == 0
    ended = run("import", "plain.csv", cwd=tmp_path)
    assert "UTF-16" not in ended.stderr
    assert "As remembered" not in ended.stdout


PLANNED = "\n".join(
    [
        "measurement,point,repeat,x_mm,y_mm,z_mm",
        "1,1,1,10,20,30",
        "1,2,1,310,420,30",
        "2,1,1,0,0,-5",
        "2,2,1,0,90,-5",
        "2,3,1,0,30,-5",
    ]
)


def test_lengths_lie_where_the_plan_has_the_measurements_of_their_numbers(tmp_path: Path) -> None:
    """By hand: 500.002 mm along (3, 4, 0)/5 from the plan's first point; to its point farthest from it, not to its last."""
    (tmp_path / "plan.csv").write_text(PLANNED, encoding="utf-8")
    (tmp_path / "bar.csv").write_text("Position;Length 1 (mm)\n2;500.0000\n1;500.0020\n", encoding="utf-8")
    asked = run("import", "bar.csv", cwd=tmp_path)
    assert (asked.returncode, "--plan plan.csv" in asked.stdout) == (2, True)
    ended = run("import", "bar.csv", "--plan", "plan.csv", "--out", "recording.csv", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    rows = [[float(cell) for cell in row.split(",")] for row in (tmp_path / "recording.csv").read_text().split()[1:]]
    expected = [[1, 1, 1, 0, 0, -5], [1, 2, 1, 0, 500, -5], [2, 1, 1, 10, 20, 30], [2, 2, 1, 310.0012, 420.0016, 30]]
    np.testing.assert_allclose(rows, expected, atol=1e-9)
    begun = run("new", "ballbar", "job", "--from", "bar.csv", "--plan", "plan.csv", "--machine", "M",
                "--set", "job.date=2026-05-31", cwd=tmp_path)  # fmt: skip
    assert begun.returncode == 0, begun.stderr
    assert "from 10.0,20.0,30.0 to 310.0,420.0,30.0" in (tmp_path / "job" / "job.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("1 3", "plan.csv: no measurement has the number of line '3'. Say where it lies: --line"),
        ("1 A", "plan.csv: no measurement has the number of line 'A'"),
        ("1 1.2", "no measurement has the number of line '1.2'"),
        ("A1 B1", "bar.csv: lines 'A1' and 'B1' have the same number"),
    ],
)
def test_a_line_that_the_plan_does_not_number_is_asked_for(names: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "plan.csv").write_text(PLANNED, encoding="utf-8")
    rows = "".join(f"{name};500.0000\n" for name in names.split())
    (tmp_path / "bar.csv").write_text(f"Position;Length 1 (mm)\n{rows}", encoding="utf-8")
    ended = run("import", "bar.csv", "--plan", "plan.csv", "--out", "recording.csv", cwd=tmp_path)
    assert (ended.returncode, told in ended.stderr, (tmp_path / "recording.csv").exists()) == (2, True, False), (
        ended.stderr
    )


def test_a_plan_beside_an_export_of_points_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plan.csv").write_text(PLANNED, encoding="utf-8")
    ended = run("import", "plan.csv", "--plan", "plan.csv", cwd=tmp_path)
    assert (ended.returncode, "holds no lengths whose place is asked for" in ended.stderr) == (2, True)
