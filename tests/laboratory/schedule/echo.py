"""A process that answers at once, or does what ends, hangs or swells a process: for tests of what runs processes.

It imports nothing, so that a test pays for the processes alone.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.processes import serve

Record = dict[str, Any]


def begin(seconds: float | str) -> Callable[[int, Any], Record]:
    if seconds == "refuse":
        raise CmmUqError("the setting is refused", where="setting")
    if isinstance(seconds, str):
        os._exit(7)

    def answer(number: int, task: Any) -> Record:
        time.sleep(seconds)
        if isinstance(task, Path) and not task.exists():  # the first to get it is killed as the system kills
            task.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if task == "die":
            os._exit(9)
        if task == "hang":
            time.sleep(600)
        if task == "break":
            raise KeyError("x")
        if task == "refuse":
            raise CmmUqError("this is refused", where="task", fix="Ask something else")
        print("what a library prints is no answer")
        return {"number": number, "square": number**2, "threads": os.environ["OPENBLAS_NUM_THREADS"]}

    return answer


if __name__ == "__main__":
    serve(begin)
