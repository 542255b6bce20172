"""A run of slow tasks that keeps its answers in the folder that is named, to be killed from outside."""

from __future__ import annotations

import sys
from pathlib import Path

from cmm_uq.laboratory.proving.answers import AnswersFolder, answer_tasks

TASKS, TRUTH, PROGRAM = dict.fromkeys(range(12)), b'{"run":1}\n', "tests.laboratory.schedule.echo"


def main(folder: Path, seconds: float) -> None:
    kept = AnswersFolder(folder, TRUTH)
    todo = {i: task for i, task in TASKS.items() if i not in kept.records}
    answer_tasks(PROGRAM, seconds, todo, 2, keep=kept.keep)
    kept.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]))
