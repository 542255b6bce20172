"""Numbered tasks answered by processes of this machine, as many at once as asked for.

Tasks are taken as they are needed and answers given as they come, so that memory does not grow with their number: whoever
does not take answers is not sent more.
"""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Generator, Iterable
from itertools import islice
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.talking import Answer, Talk, Work

MOST_WORKERS = 256

_AHEAD = 2
"""Tasks for each process that are ready before it asks."""

_Waiting = queue.SimpleQueue[tuple[int, Any] | None]
_Answers = queue.SimpleQueue[Answer | BaseException]


def check_workers(workers: int) -> None:
    """Refuse a number of processes that is none.

    Raises
    ------
    CmmUqError : it is not from 1 to 256.
    """
    if not 1 <= workers <= MOST_WORKERS:
        raise CmmUqError(f"{workers} workers", where="--workers", fix=f"Give from 1 to {MOST_WORKERS} processes")


def processes() -> int:
    """How many processes this one may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not every system says
        return os.cpu_count() or 1


def answers(work: Work, tasks: Iterable[tuple[int, Any]], workers: int) -> Generator[Answer, None, None]:
    """Have every task answered, in the order in which they are done.

    Parameters
    ----------
    work : what the processes are begun for.
    tasks : each with its number; taken in the caller's thread.
    workers : processes at once; none is begun without a task.

    Raises
    ------
    CmmUqError : a process cannot begin. What comes of a task is an :class:`Answer`.
    """
    todo = iter(tasks)
    waiting: _Waiting = queue.SimpleQueue()
    done: _Answers = queue.SimpleQueue()
    talks: list[Talk] = []
    threads: list[threading.Thread] = []
    asked = 0
    try:
        for task in islice(todo, _AHEAD * workers):
            waiting.put(task)
            asked += 1
            if len(talks) < workers:
                talks.append(Talk(work))
                threads.append(threading.Thread(target=_converse, args=(talks[-1], waiting, done), daemon=True))
                threads[-1].start()
        while asked:
            answer = done.get()
            if isinstance(answer, BaseException):
                raise answer
            asked -= 1
            for task in islice(todo, 1):
                waiting.put(task)
                asked += 1
            yield answer
    finally:
        for _ in threads:
            waiting.put(None)
        for talk in talks:
            talk.end()
        for thread in threads:
            thread.join()


def _converse(talk: Talk, waiting: _Waiting, done: _Answers) -> None:
    """Give one process its tasks, one after the other."""
    try:
        while (task := waiting.get()) is not None:
            done.put(talk.ask(*task))
    except BaseException as error:
        done.put(error)
