"""The temperatures of the scales from a log, joined to the recording by its times."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pikepdf
import pytest

from cmm_uq.app.commands.jobs.compensate import write_compensated
from cmm_uq.app.commands.jobs.simulate import write_simulation
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.recording.beside import parse_temperature_log
from tests.app.commands.test_map_squareness import TABLE_7, at, stated, with_maps
from tests.conftest import ROOT

LOG = b"""time_s,x1_c,x2_c,x3_c,y1_c,y2_c,z1_c,table_c
0,20.0,20.3,20.6,21,22,19,18
60,20.6,20.9,21.2,21,22,20,18
120,21.2,21.5,21.8,22,23,,18
"""


def test_a_scale_is_at_the_mean_of_its_thermocouples():
    log = parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv")
    np.testing.assert_allclose(
        log.at([0, 30, 60, 90]), [[20.3, 21.5, 19], [20.6, 21.5, 19.5], [20.9, 21.5, 20], [21.2, 22, 20.5]]
    )


def test_the_spread_of_the_thermocouples_is_kept():
    log = parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv")
    np.testing.assert_allclose(log.spread_at([0.0]), [[0.6, 1.0, 0.0]], atol=1e-12)


def test_a_thermocouple_that_fell_out_is_stood_in_for_by_the_others():
    log = parse_temperature_log(LOG.replace(b",22,23,,", b",,23,21,"), "log.csv")
    np.testing.assert_allclose(log.at([120.0]), [[21.5, 23, 21]])


def test_a_scale_without_any_temperature_is_refused():
    with pytest.raises(CmmUqError, match=r"log\.csv line 4: no temperature of z1_c"):
        parse_temperature_log(LOG, "log.csv")


def test_sensors_can_be_named():
    log = parse_temperature_log(LOG, "log.csv", {"x": ["x2_c"], "y": ["y1_c", "y2_c"], "z": ["table_c"]})
    np.testing.assert_allclose(log.at([0.0]), [[20.3, 21.5, 18]])
    with pytest.raises(CmmUqError, match="no column 'x9_c'"):
        parse_temperature_log(LOG, "log.csv", {"x": ["x9_c"], "y": ["y1_c"], "z": ["z1_c"]})
    with pytest.raises(CmmUqError, match="no thermocouple of scale z"):
        parse_temperature_log(LOG, "log.csv", {"x": ["x1_c"], "y": ["y1_c"]})


def test_dates_are_times():
    text = b"time,x1_c,y1_c,z1_c\n2004-06-01T10:00:00,20,20,20\n2004-06-01T10:10:00,21,21,21\n"
    log = parse_temperature_log(text, "log.csv")
    assert log.at(log.times[:1] + 300)[0].tolist() == [20.5, 20.5, 20.5]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"60,", b"0,", "line 3: is not later than the line before"),
        (b"time_s", b"clock", "no column time_s or time"),
        (b"20.6,20.9", b"293.6,20.9", "line 3: x1_c = 293.6 °C"),
        (b"20.6,20.9", b"warm,20.9", "line 3: x1_c = 'warm' is no number"),
        (b"time_s,", b"time,", "line 2: time = '0' is no date"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(old, new, message):
    with pytest.raises(CmmUqError, match=message):
        parse_temperature_log(LOG.replace(old, new, 1).replace(b",,18", b",21,18"), "log.csv")


@pytest.mark.parametrize("time", [-1.0, 121.0, np.nan])
def test_no_temperature_is_known_before_or_after_the_log(time):
    with pytest.raises(CmmUqError, match="the log reaches from 0 to 120 s"):
        parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv").at([60.0, time])


RATE = np.array([1.0, 2.0, -0.5]) / 3600
"""Of the scales, K/s, from 21 °C."""
NAMED = 'temperature_log = { file = "thermocouples.csv" }\n'


def ramp(times: Sequence[float]) -> str:
    """Three thermocouples on x, two on y and one on z; their means rise by RATE."""
    rows = ["time_s,x1_c,x2_c,x3_c,y1_c,y2_c,z1_c"]
    for t in times:
        x, y, z = (21 + RATE * t).tolist()
        rows.append(f"{t:.10g},{x - 0.3!r},{x!r},{x + 0.3!r},{y - 0.1!r},{y + 0.1!r},{z!r}")
    return "\n".join(rows) + "\n"


def timed(job: Path, *, every: float = 45.0) -> Path:
    """The job with the time of each point."""
    path = job / "ballbar.csv"
    header, *rows = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    text = "\n".join([f"{header},time_s", *(f"{row},{every * i}" for i, row in enumerate(rows))])
    path.write_text(text + "\n", encoding="utf-8")
    return job


def naming(job: Path, line: str = NAMED) -> Path:
    path = job / "job.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"(?m)^(chain = .*\n)", lambda found: found[1] + line, text), encoding="utf-8")
    return job


def logged(job: Path, log: str = ramp(range(0, 1861, 60)), line: str = NAMED) -> Path:
    (job / "thermocouples.csv").write_text(log, encoding="utf-8")
    return naming(timed(job), line)


def test_a_steady_rise_is_met_at_every_point(job: Path) -> None:
    """Between entries a straight course is what linear interpolation has exactly."""
    points = read_job(logged(job)).points
    found = np.column_stack([points.columns[f"temp_{axis}_c"] for axis in "xyz"])
    np.testing.assert_allclose(found, 21 + np.outer(points.columns["time_s"], RATE), rtol=1e-12)


def test_compensating_with_a_log_is_compensating_with_its_temperatures_in_the_recording(
    iota: Path, job: Path, tmp_path: Path
) -> None:
    maps = {t: stated(s) for t, s in TABLE_7.items()}
    with_maps(logged(job, ramp([0, 3600])), maps)
    by_log, told = tmp_path / "a", tmp_path / "a" / "compensation.json"
    write_compensated(job, by_log)
    found = read_job(by_log)
    text = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(text.replace(NAMED, ""), encoding="utf-8")
    recording = (job / "ballbar.csv").read_text(encoding="utf-8").splitlines()
    times = [float(row.split(",")[-1]) for row in recording[1:]]
    rows = [
        f"{row},{','.join(f'{v:.12g}' for v in 21 + RATE * t)}" for row, t in zip(recording[1:], times, strict=True)
    ]
    (job / "ballbar.csv").write_text("\n".join([f"{recording[0]},temp_x_c,temp_y_c,temp_z_c", *rows]) + "\n")
    write_compensated(job, tmp_path / "b")
    np.testing.assert_allclose(found.points.xyz, read_job(tmp_path / "b").points.xyz, atol=1.1e-7)
    log = json.loads(told.read_text(encoding="utf-8"))["temperature_log"]
    assert log["file"].endswith("thermocouples.csv")
    assert log["largest_u_interpolation_k"] == pytest.approx(
        2.0 / np.sqrt(12), abs=1e-6
    )  # y rises by 2 K between entries
    assert log["largest_spread_k"] == pytest.approx(0.6)


@pytest.mark.parametrize("command", ["simulate", "compensate"])
def test_what_is_made_from_it_has_the_temperatures_and_the_log_beside_them(
    job: Path, tmp_path: Path, command: str
) -> None:
    with_maps(logged(job), {20: "", 25: ""})
    if command == "simulate":
        (tmp_path / "truth.toml").write_text("seed = 1\n[noise]\ncoordinate_um = 1.0\n")
        write_simulation(job, tmp_path / "truth.toml", tmp_path / "out")
    else:
        write_compensated(job, tmp_path / "out")
    made = read_job(tmp_path / "out")
    assert "temperature_log" not in tomllib.loads(made.inputs["job.toml"].decode())["machine"]
    assert made.inputs["thermocouples.csv"] == (job / "thermocouples.csv").read_bytes()
    assert made.altered == ()
    for axis in "xyz":
        np.testing.assert_allclose(made.points.columns[f"temp_{axis}_c"], read_job(job).points.columns[f"temp_{axis}_c"],
                                   rtol=1e-9)  # fmt: skip


@pytest.mark.long
def test_the_log_is_an_input_of_the_certificate(job: Path, tmp_path: Path) -> None:
    report = write_report(logged(job), tmp_path / "out")
    assert "thermocouples.csv" in json.loads(report.results)["job"]["inputs_sha256"]
    with pikepdf.open(tmp_path / "out" / "certificate.pdf") as pdf:
        assert "thermocouples.csv" in pdf.attachments


def test_dates_are_joined_from_the_moment_that_is_stated(job: Path) -> None:
    log = "time,x1_c,y1_c,z1_c\n2004-06-01T14:00:00,20,20,20\n2004-06-01T15:00:00,26,23,14\n"
    start = 'temperature_log = { file = "thermocouples.csv", start = 2004-06-01T14:10:00 }\n'
    columns = read_job(logged(job, log, start)).points.columns
    assert [columns[f"temp_{axis}_c"][0] for axis in "xyz"] == [21, 20.5, 19]  # a sixth of the hour
    assert columns["temp_x_c"][1] == pytest.approx(21 + 6 * 45 / 3600)


def test_zones_count_where_they_are_given() -> None:
    log = b"time,x1_c,y1_c,z1_c\n2004-06-01T14:00:00+02:00,20,20,20\n2004-06-01T13:00:00+00:00,26,23,14\n"
    start = tomllib.loads("start = 2004-06-01T12:30:00Z")["start"]
    assert parse_temperature_log(log, "log.csv", start=start).times.tolist() == [-1800, 1800]


def test_columns_of_other_names_are_told(job: Path) -> None:
    log = "time_s,T7,T8,T9\n0,20,21,22\n3600,20,21,22\n"
    line = 'temperature_log = { file = "thermocouples.csv", columns = { x = ["T7"], y = ["T8", "T9"], z = ["T9"] } }\n'
    columns = read_job(logged(job, log, line)).points.columns
    assert [columns[f"temp_{axis}_c"][5] for axis in "xyz"] == [20, 21.5, 22]


def without(times: Sequence[float], *gone: float) -> list[float]:
    return [t for t in times if t not in gone]


def test_one_missing_entry_is_bridged_and_two_in_a_row_are_a_gap(job: Path) -> None:
    """Every 60 s, and points at 585, 630 and 675 s."""
    times = range(0, 1861, 60)
    read_job(logged(job, ramp(without(times, 600))))
    (job / "thermocouples.csv").write_text(ramp(without(times, 600, 660)))
    with pytest.raises(CmmUqError, match=r"ballbar\.csv line 15, column time_s: no temperature at 585 s: the log has a gap "
                                         r"from 540 to 720 s") as caught:  # fmt: skip
        read_job(job)
    assert "max_gap_s" in str(caught.value.fix)
    path = job / "job.toml"
    path.write_text(path.read_text().replace('thermocouples.csv"', 'thermocouples.csv", max_gap_s = 180', 1))
    points = read_job(job).points
    np.testing.assert_allclose(points.columns["temp_y_c"], 21 + 2 * points.columns["time_s"] / 3600, rtol=1e-12)


def test_an_entry_at_the_edge_of_a_gap_is_known(job: Path) -> None:
    log = parse_temperature_log(ramp([0, 60, 120, 600, 660, 720]).encode(), "log.csv")
    assert log.at([120, 600])[:, 2].tolist() == [21 - 60 / 3600, 21 - 300 / 3600]
    for inside in (120.001, 599.999):
        with pytest.raises(CmmUqError, match="a gap from 120 to 600 s"):
            log.at([inside])


def test_between_entries_the_temperature_may_be_anywhere_between_theirs() -> None:
    """GUM 4.3.7: a rectangular distribution over the step, here 0.6, 0 and −1.2 K; at an entry nothing is unknown."""
    text = b"time_s,x1_c,y1_c,z1_c\n0,20,20,20\n10,20.6,20,18.8\n20,20.6,20,18.8\n"
    drawn = np.random.default_rng(7).uniform(0, 1, 200_000).std()
    u = parse_temperature_log(text, "log.csv").u_at([0, 1, 10, 15, 20])
    np.testing.assert_allclose(u[1], drawn * np.array([0.6, 0, 1.2]), rtol=0.01)
    assert not u[[0, 2, 3, 4]].any()


@pytest.mark.parametrize(
    ("log", "line", "says"),
    [
        (ramp([0, 60, 120]), NAMED,
         r"ballbar\.csv line 5, column time_s: no temperature at 135 s: the log reaches from 0 to 120 s"),
        (ramp([10, 3600]), NAMED, r"ballbar\.csv line 2, column time_s: no temperature at 0 s"),
        (ramp([0, 3600, 1800]), NAMED, r"thermocouples\.csv line 4: is not later than the line before"),
        (ramp([0, 1800, 1800, 3600]), NAMED, r"thermocouples\.csv line 4: is not later than the line before"),
        ("time,x1_c,y1_c,z1_c\n2004-06-01,1,1,1\n", NAMED, r"thermocouples\.csv: gives dates.*start = 2004"),
        (ramp([0, 3600]), NAMED.replace(" }", ", start = 2004-06-01T14:00:00 }"), r"gives time_s, seconds that need no start"),
        ("time,x1_c,y1_c,z1_c\n2004-06-01T14:00:00Z,1,1,1\n", NAMED.replace(" }", ", start = 2004-06-01T14:00:00 }"),
         r"thermocouples\.csv line 2: time = .* has a zone, and start has none"),
        ("time,x1_c,y1_c,z1_c\n2004-06-01T14:00:00,1,1,1\n2004-06-01T15:00:00Z,1,1,1\n",
         NAMED.replace(" }", ", start = 2004-06-01T14:00:00 }"), r"line 3: time = .* has a zone, and start has none"),
        ("time_s,x1_c,y1_c\n0,1,1\n", NAMED, r"no thermocouple of scale z"),
        (ramp([0, 3600]), 'temperature_log = { file = "thermocouples.csv", max_gap_s = 0 }\n', r"temperature_log\.max_gap_s"),
        (ramp([0, 3600]), 'temperature_log = { file = "elsewhere.csv" }\n', r"elsewhere\.csv: no such file"),
        (ramp([0, 3600]), 'temperature_log = { file = "../log.csv" }\n', r"is not inside the job folder"),
        (ramp([0, 3600]), 'temperature_log = "thermocouples.csv"\n', r"job\.toml line \d+: \[machine\] temperature_log"),
    ],
)  # fmt: skip
def test_what_a_log_cannot_say_is_refused_with_its_place(job: Path, log: str, line: str, says: str) -> None:
    with pytest.raises(CmmUqError) as caught:
        read_job(logged(job, log, line))
    assert re.search(says, str(caught.value), re.DOTALL), str(caught.value)


def test_temperatures_of_the_scales_are_stated_once(job: Path) -> None:
    at(logged(job), (20.0, 20.0, 20.0))
    with pytest.raises(
        CmmUqError, match=r"\[machine\] temperature_log: the recording has temp_x_c, and the log gives it"
    ):
        read_job(job)


def test_a_recording_without_times_is_not_joined(job: Path) -> None:
    (job / "thermocouples.csv").write_text(ramp([0, 3600]))
    with pytest.raises(CmmUqError, match="the recording has no times to be joined by"):
        read_job(naming(job))


@pytest.mark.long
def test_a_plan_needs_no_log_yet(job: Path, tmp_path: Path) -> None:
    naming(job)
    (job / "ballbar.csv").unlink()
    write_plan(job, tmp_path / "out", power=False)
    assert (tmp_path / "out" / "plan.html").is_file()


def test_maps_without_a_recording_have_nothing_to_be_joined_to(tmp_path: Path) -> None:
    text = (ROOT / "examples" / "iota-1102-maps" / "job.toml").read_text(encoding="utf-8")
    (tmp_path / "job.toml").write_text(text.replace("[artefact]", f"{NAMED}[artefact]"), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"\[machine\] temperature_log: a job of kind 'error_map' has no recording"):
        read_job(tmp_path)
