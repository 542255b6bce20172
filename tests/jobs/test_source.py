"""A file of a job has a name that every system takes, inside the folder, and that no command writes."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.source import check_distinct, inside
from tests.jobs.test_reading import edit, refused


@pytest.mark.parametrize(
    "name", ["ballbar.csv", "day one/ballbar 2.csv", "Messung-µ.csv", "console.csv", "my plan.csv"]
)
def test_plain_names_stay_inside(tmp_path: Path, name: str) -> None:
    assert inside(tmp_path, name, "job.toml") == tmp_path / name


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("/data/ballbar.csv", "is an absolute name. Name it relative to job.toml"),
        ("C:/data/ballbar.csv", "absolute name"),
        ("C:ballbar.csv", "absolute name"),
        ("ab:c.csv", "has a character in it"),
        ("\\\\server\\ballbar.csv", "absolute name"),
        ("../ballbar.csv", "not inside the job folder"),
        ("", "not inside the job folder"),
        ("sub/../ballbar.csv", "is no plain name"),
        ("sub/../../ballbar.csv", "is no plain name"),
        ("./ballbar.csv", "is no plain name"),
        ("sub//ballbar.csv", "is no plain name"),
        ("sub\\ballbar.csv", "has a backslash"),
        ("a" * 201, "a name of 201 characters"),
        ("a\nb.csv", "has a character in it"),
        ("a\u202eb.csv", "has a character in it"),
        ("a:b.csv", "absolute name"),
        ("CON.csv", "Windows does not take"),
        ("sub/nul", "Windows does not take"),
        ("com1.txt", "Windows does not take"),
        ("ballbar.csv.", "Windows does not take"),
        ("ballbar.csv ", "Windows does not take"),
        *(
            (name, "a name that cmm-uq writes itself. Rename the file")
            for name in (
                "job.toml", "Results.JSON", "manifest.json", "truth.toml", "compensation.json",
                "certificate.html", "certificate-2.pdf", "diagnosis.html", "plan.html", "budget.toml", "sub/results.json",
            )
        ),
    ],
)  # fmt: skip
def test_other_names_are_refused_with_the_way_out(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(CmmUqError) as caught:
        inside(tmp_path, name, "job.toml")
    assert says in str(caught.value)


def test_links_cannot_lead_out_or_round(tmp_path: Path) -> None:
    (tmp_path / "job").mkdir()
    (tmp_path / "job" / "out.csv").symlink_to("../other.csv")
    (tmp_path / "job" / "loop.csv").symlink_to("loop.csv")
    with pytest.raises(CmmUqError, match="not inside the job folder"):
        inside(tmp_path / "job", "out.csv", "job.toml")
    with pytest.raises(CmmUqError, match=r"cannot be read"):
        inside(tmp_path / "job", "loop.csv", "job.toml").read_bytes()


def test_names_that_some_systems_take_for_one_are_refused() -> None:
    check_distinct(["a.csv", "a.csv", "b.csv"], "job.toml")
    for pair in (["Map.csv", "map.csv"], ["\u00e9.csv", "e\u0301.csv"]):
        with pytest.raises(CmmUqError, match="are one on Windows and macOS"):
            check_distinct(pair, "job.toml")


@pytest.mark.parametrize("key", ["file", "earlier"])
def test_recording_and_earlier_recording_are_held_to_it(job: Path, key: str) -> None:
    if key == "earlier":
        edit(job, r"^kind = .*", 'kind = "plate"')
    shutil.copy(job / "ballbar.csv", job / "results.json")
    name = 'file = "results.json"' if key == "file" else 'file = "ballbar.csv"\nearlier = "results.json"'
    assert "'results.json' has a name that cmm-uq writes itself" in refused(edit(job, r"^file = .*", name))


def test_error_maps_are_held_to_it(job: Path) -> None:
    edit(job, r"^chain = .*", 'chain = "XYZ"\nerror_map = [{ file = "truth.toml", temperature_c = 20.0 }]')
    assert "'truth.toml' has a name that cmm-uq writes itself" in refused(job)


def test_an_absolute_name_of_the_recording_itself_is_refused(job: Path) -> None:
    """A job derived from this one would go on pointing at the measured file."""
    message = refused(edit(job, r"^file = .*", f'file = "{(job / "ballbar.csv").as_posix()}"'))
    assert "Name it relative to job.toml" in message
    assert read_job(edit(job, r"^file = .*", 'file = "ballbar.csv"')).points.lines.size
