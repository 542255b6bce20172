"""What processes are asked is answered, whatever becomes of a process: killed, hung, broken or refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.processes import TaskAnswer, WorkerProcess, WorkerTask, answers, check_workers

PROGRAM = "tests.laboratory.schedule.echo"


def answered(tasks: dict[int, Any], workers: int, **limits: Any) -> dict[int, TaskAnswer]:
    return {one.number: one for one in answers(WorkerTask(PROGRAM, 0.0, **limits), tasks.items(), workers)}


def values(found: dict[int, TaskAnswer]) -> dict[int, Any]:
    return {number: one.value for number, one in found.items()}


def test_one_process_and_three_answer_alike_each_on_one_thread() -> None:
    tasks = dict.fromkeys(range(12))
    one, three = answered(tasks, 1), answered(tasks, 3)
    assert one == three == {i: TaskAnswer(i, {"number": i, "square": i**2, "threads": "1"}) for i in tasks}


def test_a_process_that_is_killed_loses_nothing_and_is_told(tmp_path: Path) -> None:
    found = answered({0: None, 1: tmp_path / "killed", 2: None}, 2)
    assert {number: value["square"] for number, value in values(found).items()} == {0: 0, 1: 1, 2: 4}
    assert [found[i].ended for i in range(3)] == [(), ("signal 9",), ()]


def test_a_task_that_ends_every_process_is_given_up_and_the_others_go_on() -> None:
    found = answered({0: "die", 1: None}, 1, tries=2)
    assert found[0].ended == ("exit code 9", "exit code 9")
    assert str(found[0].failure) == (
        "2 processes ended before its work was done (exit code 9). Give fewer --workers where memory is short"
    )
    assert found[1].value["square"] == 1


@pytest.mark.long
def test_a_task_that_hangs_is_stopped_at_its_limit_and_not_tried_again() -> None:
    began = time.monotonic()
    found = answered({0: "hang", 1: None}, 1, seconds=1.0)
    assert "took longer than 1 s and was stopped" in str(found[0].failure)
    assert found[0].ended == ()
    assert found[1].value["square"] == 1
    assert time.monotonic() - began < 60


def test_a_refusal_and_a_fault_are_answers_in_words() -> None:
    found = answered({0: "refuse", 1: "break", 2: None}, 1)
    assert str(found[0].failure) == "task: this is refused. Ask something else"
    assert "a fault of the program: KeyError: 'x'" in str(found[1].failure)
    assert found[2].failure is None


@pytest.mark.parametrize(("setting", "said"), [("refuse", "the setting is refused"), ("end", "exit code 7")])
def test_a_process_that_cannot_begin_ends_the_run(setting: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        list(answers(WorkerTask(PROGRAM, setting), {0: None, 1: None}.items(), 2))


def test_tasks_are_taken_only_as_far_as_processes_need_them() -> None:
    taken: list[int] = []

    def tasks() -> Iterator[tuple[int, None]]:
        for number in range(1000):
            taken.append(number)
            yield number, None

    with closing(answers(WorkerTask(PROGRAM, 0.0), tasks(), 2)) as found:
        for count in range(1, 6):
            next(found)
            time.sleep(0.05)  # more would be answered meanwhile, if more were asked
            assert len(taken) <= count + 4


def test_who_stops_listening_leaves_no_process_behind() -> None:
    talk = WorkerProcess(WorkerTask(PROGRAM, 0.0))
    talk.ask(0, None)
    process = talk._process
    assert process is not None
    talk.end()
    assert process.returncode == -signal.SIGKILL
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)
    with pytest.raises(CmmUqError, match="stopped"):
        talk.ask(1, None)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux what runs")
def test_a_process_whose_asker_is_killed_does_not_go_on_with_its_task() -> None:
    script = f"""if 1:
        import threading
        from cmm_uq.laboratory.schedule.processes import WorkerProcess, WorkerTask
        talk = WorkerProcess(WorkerTask({PROGRAM!r}, 0.0))
        talk.ask(0, None)
        threading.Thread(target=talk.ask, args=(1, "hang"), daemon=True).start()
        print(talk._process.pid, flush=True)
        threading.Event().wait()"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as asker:
        assert asker.stdout is not None
        worker = int(asker.stdout.readline())
        time.sleep(0.5)
        os.kill(worker, 0)
        asker.kill()
    for _ in range(100):
        if not _runs(worker):
            return
        time.sleep(0.05)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("it hangs on for its ten minutes")


def _runs(process: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False


@pytest.mark.parametrize("workers", [0, -1, 257])
def test_no_workers_and_too_many_are_refused(workers: int) -> None:
    with pytest.raises(CmmUqError, match=f"{workers} workers"):
        check_workers(workers)
