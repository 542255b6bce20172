"""A session, word by word: what is accepted, what is said of it, and what stands in the recording."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.laboratory.acquire import begin_acquisition
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.laboratory.live.instruments.source import Gap, Moment, Returned
from cmm_uq.laboratory.live.story import read_story
from tests.laboratory.live.instruments.mischief import UnreliableIppServer
from tests.laboratory.live.session import FakeClock, job_folder, probed, said, session, temperature, type_in

BAR = ("100 100 -300", "600.003 100 -300")
THERMOMETER = """
[[acquire.source]]
name = "t"
profile = "line-logger"
values = { temp_c = "temp_artefact_c" }
"""


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def no_instruments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmm_uq.app.commands.laboratory.acquire._sources", lambda job, **_: ([], None))


def rows(folder: Path) -> list[dict[str, str]]:
    header, *lines = (folder / "bar.csv").read_text(encoding="utf-8").splitlines()
    return [dict(zip(header.split(","), line.split(","), strict=True)) for line in lines]


def test_typed_points_become_a_recording_that_a_job_reads(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    told = type_in(taking, clock, *BAR)
    assert told[0] == "accepted: measurement 1, point 1, repeat 1: 100.0000, 100.0000, −300.0000"
    assert "500.0030 mm from point 1; the plan has 500.0000 mm: +3.0 µm" in told
    assert (folder / "bar.csv").read_text(encoding="utf-8") == (
        "measurement,point,repeat,x_mm,y_mm,z_mm,time_s\n"
        "1,1,1,100.0000000,100.0000000,-300.0000000,5.000000\n"
        "1,2,1,600.0030000,100.0000000,-300.0000000,10.000000\n"
    )
    job = read_job(folder)
    assert job.points.columns["time_s"].tolist() == [5.0, 10.0]
    assert job.acquired is not None
    assert not job.acquired.changed
    assert job.acquired.said.typed == 2


def test_half_a_bar_is_kept_but_not_in_the_recording(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    type_in(taking, clock, *BAR, "100 100 -300.001")
    assert len(rows(folder)) == 2
    assert len(read_story(folder / "acquisition").points) == 3


def test_a_distance_is_laid_off_along_the_plan_s_line(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    type_in(session(folder, clock), clock, "go 3", "500.01")
    first, second = rows(folder)
    assert (first["x_mm"], first["y_mm"]) == ("100.0000000", "100.0000000")
    assert (second["x_mm"], second["y_mm"]) == ("500.0080000", "400.0060000")
    assert first["time_s"] == ""
    assert "time_s" not in read_job(folder).points.columns


def test_a_point_taken_back_comes_again_and_its_reason_stays(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    type_in(taking, clock, *BAR, "undo the ball was loose")
    assert taking.conductor.step is not None
    assert taking.conductor.step.place == (1, 2, 1)
    type_in(taking, clock, "600.001 100 -300")
    assert [row["x_mm"] for row in rows(folder)] == ["100.0000000", "600.0010000"]
    taking.conductor.finish()
    told = json.loads((folder / "bar.acquired.json").read_text(encoding="utf-8"))
    assert told["undone"] == [{"measurement": 1, "point": 2, "repeat": 1, "reason": "the ball was loose"}]
    assert "1 point was taken back" in str(read_job(folder).acquired.sentence)  # type: ignore[union-attr]


def test_the_only_set_up_taken_back_leaves_no_stale_recording(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    type_in(taking, clock, *BAR, "undo the ball was loose")
    assert rows(folder) == []


def test_skip_go_repeat_and_pause(tmp_path: Path, clock: FakeClock) -> None:
    taking = session(job_folder(tmp_path / "job"), clock)
    conductor = taking.conductor

    def place() -> tuple[int, int, int] | None:
        return conductor.step.place if conductor.step else None

    type_in(taking, clock, "skip the stand is too short")
    assert place() == (1, 1, 2)
    type_in(taking, clock, "go 3")
    assert place() == (3, 1, 1)
    type_in(taking, clock, "100 100 -300", "500 400.001 -300")
    assert place() == (1, 1, 2)
    type_in(taking, clock, "repeat")
    assert place() == (3, 1, 2)
    assert type_in(taking, clock, "pause lunch", "1 2 3") == ["paused: no point is taken. resume goes on"]
    assert conductor.view().head == "PAUSED, 1 of 4 set-ups"
    type_in(taking, clock, "resume", "100 100 -300", "500 400 -300")
    assert place() == (1, 1, 2)


def test_days_later_it_goes_on_where_it_ended(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    first = session(folder, clock)
    type_in(first, clock, *BAR, "100 100 -300.002")
    first.journals.close()
    (folder / "plan.csv").unlink()  # the first session keeps it
    clock.utc += 3 * 86_400 * 10**9
    clock.monotonic = 1_000_000  # the computer was started anew
    second = session(folder, clock)
    assert second.conductor.step is not None
    assert second.conductor.step.place == (1, 2, 2)
    type_in(second, clock, "600 100 -300.002")
    found = rows(folder)
    assert [float(row["time_s"]) for row in found] == [5.0, 10.0, 15.0, 15.0 + 3 * 86_400 + 5.0]
    assert len(read_job(folder).acquired.said.sessions) == 2  # type: ignore[union-attr]


def test_a_clock_set_back_between_two_sessions_does_not_turn_time_round(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    first = session(folder, clock)
    type_in(first, clock, *BAR)
    first.journals.close()
    clock.utc -= 3600 * 10**9
    type_in(session(folder, clock), clock, "100 100 -300.002", "600 100 -300.002")
    times = [float(row["time_s"]) for row in rows(folder)]
    assert times == sorted(times)
    assert times[2] == pytest.approx(15.0)


def test_a_jump_of_the_clock_is_said_and_changes_no_time(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    type_in(taking, clock, BAR[0])
    clock.utc += 3600 * 10**9
    told = type_in(taking, clock, BAR[1])
    assert "the computer's clock was moved by 3600 s" in " ".join(told)
    assert [float(row["time_s"]) for row in rows(folder)] == [5.0, 10.0]
    taking.conductor.finish()
    assert read_job(folder).acquired.said.clock_jumps_s == [3600.0]  # type: ignore[union-attr]


@pytest.mark.usefixtures("no_instruments")
def test_a_machine_s_points_get_the_temperature_of_their_moment(tmp_path: Path, clock: FakeClock) -> None:
    """20 °C and a thousandth more each tenth of a second: at 1.03 and 2.07 s 20.0103 and 20.0207."""
    folder = job_folder(tmp_path / "job", THERMOMETER)
    taking = session(folder, clock)
    begin = clock.monotonic
    points = {1.03: (100.0, 100.0, -300.0), 2.07: (600.002, 100.0, -300.0)}
    for i in range(1, 40):
        for moment in [m for m in points if (i - 1) / 10 < m <= i / 10]:
            clock.monotonic = begin + round(moment * 1e9)
            taking.conductor.event(probed(clock, len(points), points[moment]))
        clock.monotonic = begin + i * 10**8
        taking.conductor.event(temperature(clock, i, 20 + i * 1e-3))
        taking.conductor.tick()
    found = rows(folder)
    assert [float(row["temp_artefact_c"]) for row in found] == pytest.approx([20.0103, 20.0207])
    assert [float(row["time_s"]) for row in found] == pytest.approx([1.03, 2.07])
    taking.conductor.finish()
    acquired = read_job(folder).acquired
    assert acquired is not None
    assert acquired.said.columns["temp_artefact_c"].u < 1e-9
    assert acquired.said.instruments == []


@pytest.mark.usefixtures("no_instruments")
def test_two_instruments_that_give_the_same_quantity_have_a_column_each(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    for i in range(1, 8):
        clock.go(0.5)
        for source, value in (("top", 20.0), ("un-der", 21.0)):
            taking.conductor.event(temperature(clock, i, value, source, "temp_air_c"))
        if i in (2, 4):
            taking.conductor.event(probed(clock, i, (50.0 + 250 * i - 450 * (i == 2), 100.0, -300.0)))
        taking.conductor.tick()
    clock.go(20)
    taking.conductor.tick()
    assert [(row["temp_air_c"], row["un_der_temp_air_c"]) for row in rows(folder)] == [("20", "21")] * 2


@pytest.mark.usefixtures("no_instruments")
def test_in_a_gap_a_point_has_no_temperature_and_the_column_is_not_used(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job", THERMOMETER)
    taking = session(folder, clock)
    conductor = taking.conductor
    for i in range(1, 4):
        clock.go(0.1)
        conductor.event(temperature(clock, i, 20.0))
    conductor.event(probed(clock, 1, (100.0, 100.0, -300.0)))
    conductor.event(Gap("t", clock.utc, clock.monotonic, Verbatim("the cable was pulled")))
    clock.go(4)
    conductor.event(probed(clock, 2, (600.0, 100.0, -300.0)))
    clock.go(16)
    conductor.tick()
    conductor.event(Returned("t", clock.utc, clock.monotonic, 20.0))
    conductor.finish()
    told = " ".join(said(conductor))
    assert "t: the cable was pulled" in told
    assert "t is back after 20 s" in told
    assert "temp_artefact_c: t gave nothing for 10 s after the point" in told
    assert [row["temp_artefact_c"] for row in rows(folder)] == ["20", ""]
    job = read_job(folder)
    assert "temp_artefact_c" not in job.points.columns
    assert job.acquired is not None
    assert "without a value, and so not used: measurement/point/repeat 1/2/1" in str(job.acquired.joins[0])
    assert str(job.acquired.gaps[0]) == "t from 0 s for 20 s: the cable was pulled"


@pytest.mark.usefixtures("no_instruments")
def test_a_point_that_a_kill_left_unjoined_is_joined_by_the_next_session(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job", THERMOMETER)
    first = session(folder, clock)
    values = {1: 20.0, 2: 20.2}
    for i, value in values.items():
        clock.go(1.0)
        first.conductor.event(temperature(clock, i, value))
        if i == 1:
            clock.go(0.25)
            first.conductor.event(probed(clock, 1, (100.0, 100.0, -300.0)))
            first.conductor.event(probed(clock, 2, (600.0, 100.0, -300.0)))
    first.conductor.recorder.commit()  # the readings are on the disk, and the program is killed before it joins them
    first.journals.close()
    clock.go(1000)
    session(folder, clock)
    found = [float(row["temp_artefact_c"]) for row in rows(folder)]
    assert found == pytest.approx([20 + 0.2 * 0.25 / 1.25] * 2)


@pytest.mark.usefixtures("no_instruments")
def test_quitting_waits_for_the_reading_behind_the_last_point_and_twice_does_not(
    tmp_path: Path, clock: FakeClock
) -> None:
    taking = session(job_folder(tmp_path / "job", THERMOMETER), clock)
    conductor = taking.conductor
    conductor.event(temperature(clock, 1, 20.0))
    clock.go(0.1)
    conductor.event(probed(clock, 1, (100.0, 100.0, -300.0)))
    conductor.line("quit")
    assert not conductor.ended
    clock.go(0.1)
    conductor.event(temperature(clock, 2, 20.2))
    conductor.tick()
    assert conductor.ended
    conductor.event(probed(clock, 2, (600.0, 100.0, -300.0)))
    clock.go(0.1)
    conductor.line("quit")
    assert conductor.ended
    conductor.finish()
    first, second = conductor.story.points.values()
    assert first.joined["temp_artefact_c"].value == pytest.approx(20.1)
    assert second.joined["temp_artefact_c"].value == pytest.approx(20.2)


@pytest.mark.usefixtures("no_instruments")
def test_a_point_of_a_machine_that_is_ill_or_comes_in_a_pause_is_not_taken(tmp_path: Path, clock: FakeClock) -> None:
    taking = session(job_folder(tmp_path / "job"), clock)
    type_in(taking, clock, "pause")
    taking.conductor.event(probed(clock, 1, (100.0, 100.0, -300.0)))
    assert said(taking.conductor) == ["cmm: a point is not taken: points are not taken now"]
    assert taking.conductor.story.points == {}


def test_exchanged_balls_a_copied_reading_and_inches_are_warned_of(tmp_path: Path, clock: FakeClock) -> None:
    taking = session(job_folder(tmp_path / "job"), clock)
    told = " ".join(type_in(taking, clock, "607 100 -300", "107 103 -300"))  # wherever the stand is
    assert "points 2 and 1 seem exchanged against the plan" in told
    told = " ".join(type_in(taking, clock, "107 103 -300"))
    assert "its coordinates are those of measurement 1, point 2, repeat 1 to the last digit" in told
    type_in(taking, clock, "undo copied", "100 100.001 -300", "600.001 100 -300")
    told = " ".join(type_in(taking, clock, "3.937 3.937 -11.811", "3.937 23.622 -11.811"))
    assert "inch" in told


def test_a_deviation_is_shown_against_what_all_else_says_and_a_wild_one_is_asked_for_again(
    tmp_path: Path, clock: FakeClock
) -> None:
    """Along x the squareness does not act: σ√2 = 1.41 µm and u = 0.5 µm give ±2.94 µm before anything is measured."""
    taking = session(job_folder(tmp_path / "job"), clock)
    told = type_in(taking, clock, *BAR)
    assert "deviation +3.0 µm; expected 0.0 ± 2.9 µm (95 %)" in [text.replace("+0.0", "0.0") for text in told]
    told = type_in(taking, clock, "100 100 -300.001", "600.025 100 -300")
    again = [text for text in told if text.startswith("REPEAT?")]
    assert len(again) == 1
    assert "the repeats of measurement 1 scatter by" in again[0]
    assert taking.conductor.view().again.startswith("REPEAT?")


def test_a_recording_of_others_is_never_overwritten(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    own = "measurement,point,x_mm,y_mm,z_mm\n1,1,0,0,0\n1,2,500,0,0\n"
    (folder / "bar.csv").write_text(own, encoding="utf-8")
    with pytest.raises(CmmUqError, match="was not written by cmm-uq acquire"):
        session(folder, clock)
    assert (folder / "bar.csv").read_text(encoding="utf-8") == own
    assert not (folder / "acquisition").exists()


def test_a_recording_that_was_changed_by_hand_says_so(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    type_in(taking, clock, *BAR)
    taking.journals.close()
    path = folder / "bar.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("600.003", "600.001"), encoding="utf-8")
    job = read_job(folder)
    assert job.acquired is not None
    assert "The recording was changed after it was taken." in str(job.acquired.sentence)
    with pytest.raises(CmmUqError, match="or was changed since"):
        session(folder, clock)


def test_rows_of_a_dropped_file_go_where_the_file_or_the_plan_says_and_once_only(
    tmp_path: Path, clock: FakeClock
) -> None:
    folder = job_folder(tmp_path / "job")
    taking = session(folder, clock)
    moment = Moment(clock.utc, clock.monotonic)
    pair = [{"x_mm": 100.0, "y_mm": 100.0, "z_mm": -300.0}, {"x_mm": 600.001, "y_mm": 100.0, "z_mm": -300.0}]
    taking.conductor.file("a.txt", b"a", moment, pair, "0001-a.txt")
    numbered = [{"measurement": 3.0, "point": float(i + 1), "x_mm": 100 + 400.0 * i, "y_mm": 100 + 300.0 * i, "z_mm": -300.0}
                for i in range(2)]  # fmt: skip
    taking.conductor.file("b.txt", b"b", moment, numbered, "0002-b.txt")
    taking.conductor.file("c.txt", b"b", moment, numbered, "0003-c.txt")
    clock.go(20)
    taking.conductor.tick()
    assert [(row["measurement"], row["point"]) for row in rows(folder)] == [
        ("1", "1"),
        ("1", "2"),
        ("3", "1"),
        ("3", "2"),
    ]
    assert "c.txt holds what b.txt held, byte for byte: it is not taken again" in said(taking.conductor)
    assert "Points were read from a.txt, b.txt." in str(read_job(folder).acquired.sentence)  # type: ignore[union-attr]


def test_joined_u_of_the_artefact_s_temperature_is_in_the_test_uncertainty(tmp_path: Path, clock: FakeClock) -> None:
    folder = job_folder(tmp_path / "job", "[test_uncertainty]\nu_temperature_k = 0.3")
    type_in(session(folder, clock), clock, *BAR)
    path = folder / "bar.acquired.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    told["columns"] = {"temp_artefact_c": {"u": 0.4, "u_largest": 0.5}}
    path.write_text(json.dumps(told), encoding="utf-8")
    assert read_job(folder).circumstances.uncertainty.u_temperature_k == pytest.approx(0.5)


def test_the_picture_has_every_point_and_a_cross_where_to_go(tmp_path: Path, clock: FakeClock) -> None:
    taking = session(job_folder(tmp_path / "job"), clock)
    drawn = "\n".join(taking.conductor.view().picture)
    assert drawn.count("X") == 2  # in both views
    assert drawn.count("2") == 2
    taking.conductor.line("100 100 -300")
    drawn = "\n".join(taking.conductor.view().picture)
    assert drawn.count("1") == 2
    assert np.array([line.index("X") for line in taking.conductor.view().picture if "X" in line])[0] > 15


def test_a_machine_goes_on_after_an_error_once_the_operator_says_so(tmp_path: Path) -> None:
    machine = UnreliableIppServer()
    more = f'[[acquire.source]]\nname = "cmm"\nprofile = "ipp-position"\nport = "{machine.url}"\n'
    taking = begin_acquisition(job_folder(tmp_path / "job", more))
    (source,) = taking.sources
    stop = threading.Event()
    try:
        machine.trip()
        events = source.events(stop)
        while "Use ClearAllErrors" not in str(getattr(next(events), "status", "")):
            assert machine.state.error
        taking.conductor.line("clear")
        assert said(taking.conductor)[-1] == "the machine is told to go on"
        while not getattr(next(events), "values", None):
            pass
        assert not machine.state.error
    finally:
        stop.set()
        source.close()
        machine.close()
    notes = [text for _, text in read_story(tmp_path / "job" / "acquisition").notes]
    assert notes == ["errors of the machine cleared by the operator"]


@pytest.mark.usefixtures("no_instruments")
def test_where_no_machine_waits_there_is_nothing_to_clear(tmp_path: Path, clock: FakeClock) -> None:
    assert "no machine here waits" in type_in(session(job_folder(tmp_path / "job"), clock), clock, "clear")[0]
