"""A real local Dask cluster answers as processes of this machine do, and says in one line what is wrong with it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule import cluster
from cmm_uq.laboratory.schedule.cluster import _chunks, chunk_answered, cluster_answers, end_idle
from cmm_uq.laboratory.schedule.processes import Packed, TaskAnswer, WorkerTask, answers
from tests.conftest import ROOT

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("ignore")  # what Dask's own parts say of each other

WORK = WorkerTask("tests.laboratory.schedule.echo", 0.0)


@dataclass
class Cluster:
    address: str
    workers: list[subprocess.Popen[bytes]]


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    said, begun = folder / "scheduler.json", []

    def begin(what: str, *options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard", *options]
        begun.append(subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return begun[-1]

    try:
        begin("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(said))
        deadline = time.monotonic() + 60
        while not said.exists() or not said.read_text().endswith("}"):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        address = json.loads(said.read_text())["address"]
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
        workers = [begin("worker", address, *options) for _ in range(2)]
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield Cluster(address, workers)
    finally:
        for process in begun[::-1]:
            process.kill()
            process.wait()


@pytest.mark.long
def test_it_answers_as_processes_here_do_also_where_a_process_or_a_worker_is_killed(
    local: Cluster, tmp_path: Path
) -> None:
    tasks: dict[int, Any] = {**dict.fromkeys(range(30)), 30: "refuse", 31: tmp_path / "killed"}
    found: dict[int, TaskAnswer] = {}
    for one in cluster_answers(local.address, WORK, tasks.items(), len(tasks)):
        if not found:
            local.workers[0].kill()  # with whatever it was asked
        found[one.number] = one
    (tmp_path / "killed").unlink()
    here = {one.number: one for one in answers(WORK, tasks.items(), 2)}
    assert {i: (one.value, str(one.failure)) for i, one in found.items()} == {
        i: (one.value, str(one.failure)) for i, one in here.items()
    }
    assert str(found[30].failure) == "task: this is refused. Ask something else"


def test_a_worker_of_another_version_is_named(local: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "__version__", "0.0.1")
    with pytest.raises(CmmUqError, match=r"worker tcp://127.0.0.1:\d+: has cmm-uq \S+, and this is 0.0.1"):
        list(cluster_answers(local.address, WORK, [(0, None)], 1))
    with pytest.raises(CmmUqError, match="came later has cmm-uq"):
        chunk_answered("0.0.2", WORK, ())


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x"])
def test_no_scheduler_is_said_in_one_line(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with pytest.raises(CmmUqError, match=f"^--scheduler {address}: no Dask scheduler answers"):
        list(cluster_answers(address, WORK, [(0, None)], 1))


def test_a_process_of_a_worker_stays_for_the_next_portion_and_goes_when_nobody_asks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster, "IDLE_S", 0.3)
    packed = WorkerTask(WORK.program, Packed.of(0.0))
    assert chunk_answered(cluster.__version__, packed, ((3, Packed.of(None)),))[0].value["square"] == 9
    (talk,) = cluster._idle[packed]
    process = talk._process
    chunk_answered(cluster.__version__, packed, ((4, Packed.of(None)),))
    assert cluster._idle[packed] == [talk]
    assert talk._process is process
    deadline = time.monotonic() + 30
    while cluster._idle[packed]:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    end_idle()
    assert process is not None
    assert process.wait(10) is not None


def test_portions_are_a_hundred_jobs_and_shrink_towards_the_end() -> None:
    sizes = [len(chunk) for chunk in _chunks(((i, None) for i in range(2000)), 2000, 4)]
    assert sum(sizes) == 2000
    assert sizes[:12] == [100] * 12
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] == 1
    assert len(next(_chunks(((i, b"x" * 3 * 2**20) for i in range(100)), 100, 1))) == 3


@pytest.mark.long
def test_a_cluster_that_loses_its_workers_is_said(local: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "LOOK_S", 0.2)
    monkeypatch.setattr(cluster, "PATIENCE_S", 0.5)

    def killing() -> None:
        for _ in cluster_answers(local.address, WorkerTask(WORK.program, 0.05), dict.fromkeys(range(40)).items(), 40):
            for worker in local.workers:
                worker.kill()

    with pytest.raises(CmmUqError, match=r"has no workers any more. Mend the cluster; the same command with --resume"):
        killing()
    with pytest.raises(CmmUqError, match="has no workers"):
        list(cluster_answers(local.address, WORK, [(0, None)], 1))
