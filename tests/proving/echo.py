"""A process that answers at once, or after a while, for tests of what runs processes: no diagnosis, and nothing to import."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from cmm_uq.errors import CmmUqError
from cmm_uq.proving.running import Record, serve


def begin(seconds: float) -> Callable[[int, Any], Record]:
    def answer(number: int, task: Any) -> Record:
        time.sleep(seconds)
        if task == "die":
            os._exit(9)
        if task == "refuse":
            raise CmmUqError("this is refused", where="task", fix="Ask something else")
        print("what a library prints is no answer")
        return {"number": number, "square": number**2, "threads": os.environ["OPENBLAS_NUM_THREADS"]}

    return answer


if __name__ == "__main__":
    serve(begin)
