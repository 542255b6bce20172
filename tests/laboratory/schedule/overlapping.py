"""One of several runs at the same moment, in a process of its own: ``python -m tests.laboratory.schedule.overlapping``."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.schedule.notices import EVENTS, OutgoingMessage
from cmm_uq.laboratory.schedule.state import RecordsState
from tests.laboratory.schedule.runs import FolderResults, Jobs
from tests.laboratory.schedule.told import notice


@dataclass
class Appending:
    """A channel whose messages all runs add to one file."""

    path: Path
    name: str = "kept"
    events: frozenset[str] = frozenset(EVENTS)

    def send(self, message: OutgoingMessage) -> str:
        descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(descriptor, f"{message.title}\n".encode())
        os.close(descriptor)
        return ""


def main(root: Path, place: str, out: str) -> None:
    jobs = Jobs(root, channel=Appending(root / "sent"), settings={"quiet_s": 0}, name=out)  # type: ignore[arg-type]
    jobs.due = lambda on: [notice(f"CMM {i}", "due", "2026-11-30") for i in range(5)]
    with open_records(place) as records:
        jobs.state = FolderResults(RecordsState(records, jobs.out))
        print("ready", flush=True)
        sys.stdin.readline()
        code = jobs.run()
    told = [line.get("due") or line.get("standing") for line in jobs.lines if line["exit_code"] and "run" not in line]
    print(json.dumps({"code": code, "told": [*filter(None, told)], "reported": jobs.reported}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
