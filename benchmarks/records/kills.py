"""Processes that write reports into one set of records, killed at random moments: python -m benchmarks.records.kills.

Two processes at a time write reports, each into folders of its own, with the records' ledger as the command does. Each is
killed by SIGKILL after a random time and begun again. After every kill the records are opened and settled, and it is
checked that every report that its process had said to be done is there, that files and entries agree in both directions,
and every hundredth time that the whole chain verifies. Writes docs/records/kills.md. No connection is open when a process is
forked: SQLite's locks do not survive that.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import random
import signal
import sqlite3
import sys
import tempfile
import time
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner, finish_interrupted, sha256_of, staged
from cmm_uq.laboratory.records import open_records
from tests.laboratory.records.histories import certificate

KILLS, WRITERS, FOLDERS = 1000, 2, 5
LONGEST_S = 0.25
SETTLED_S = 5.0
PAGE = Path(__file__).parents[2] / "docs" / "records" / "kills.md"


@dataclass
class Tally:
    """What was seen."""

    kills: int = 0
    done: int = 0
    told: int = 0
    unsettled: int = 0
    verified: int = 0
    faults: list[str] = field(default_factory=list)


def contents(number: int, nonce: str) -> dict[str, bytes]:
    data = json.dumps({"number": number, "nonce": nonce}).encode()
    return {"results.json": data, "certificate.html": data * 500, "certificate.pdf": os.urandom(20_000)}


def write(place: Path, writer: int, told: int) -> None:
    """Write report after report, and say of each that it is done."""
    number = 0
    nonce = os.urandom(6).hex()
    while True:
        folder = place.parent / f"w{writer}-{number % FOLDERS}"
        files = contents(number, nonce)
        digest = sha256(files["results.json"]).hexdigest()
        with open_records(place, create=True) as records, staged(folder, Owner("report", folder.name)) as stage:
            content = certificate(f"{writer}", folder=folder.name, job=folder.name, results_sha256=digest)
            stage.write(files, ledger=records.ledger("report", content))
        os.write(told, f"{digest}\n".encode())
        number += 1


def begun(place: Path, writer: int) -> tuple[int, int]:
    """Process and pipe of a writer."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        try:
            write(place, writer, writing)
        finally:
            os._exit(1)
    os.close(writing)
    return child, reading


def killed(child: int, reading: int) -> list[str]:
    """Kill it; hashes of the reports that it had said to be done."""
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(reading) as pipe:
        return pipe.read().split("\n")[:-1]


def unsettled(place: Path) -> int:
    """Sets of files on their way, as a kill left them."""
    with (
        contextlib.suppress(sqlite3.Error),
        contextlib.closing(sqlite3.connect(f"{place.as_uri()}?mode=ro", uri=True)) as raw,
    ):
        return int(raw.execute("SELECT count(*) FROM pending").fetchone()[0])
    return 0  # the tables are not made yet


def checked(place: Path, writer: int, said: list[str], tally: Tally) -> None:
    """Open, settle, compare the folders of a writer that is no more with the entries."""
    tally.unsettled += unsettled(place) > 0
    deadline = time.monotonic() + SETTLED_S
    while found := differences(place, writer, said):
        if time.monotonic() > deadline:
            tally.faults += found
            break
        time.sleep(0.05)  # the other process may be just settling it
    if tally.kills % 100 == 0:
        tally.verified += 1
        with open_records(place) as records:
            tally.faults += [str(one) for one in records.verify(files=False)]


def differences(place: Path, writer: int, said: list[str]) -> list[str]:
    """Between what was said to be done, the entries, and the folders of a writer."""
    with open_records(place, create=True) as records:
        found = [f"{digest} was done and is not recorded" for digest in said if records.has_results(digest) is None]
        known = any(machine.serial == str(writer) for machine in records.machines())
        newest = {one.folder: one for one in records.certificates(f"{writer}", values=False)} if known else {}
    for folder in sorted(place.parent.glob(f"w{writer}-*")):
        finish_interrupted(folder)
        digest, entry = sha256_of(folder / "results.json"), newest.get(str(folder))
        if (digest is None) != (entry is None) or (entry is not None and entry.results_sha256 != digest):
            found.append(f"{folder.name}: files and entries differ")
    return found


def run(kills: int = KILLS, seed: int = 20261122) -> Tally:
    """The study."""
    draw, tally = random.Random(seed), Tally()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "records.db"
        running = {writer: begun(place, writer) for writer in range(WRITERS)}
        try:
            while tally.kills < kills:
                writer = draw.randrange(WRITERS)
                time.sleep(draw.uniform(0, LONGEST_S))
                said = killed(*running.pop(writer))
                tally.kills += 1
                tally.done += len(said)
                try:
                    checked(place, writer, said, tally)
                except CmmUqError as error:
                    tally.faults.append(str(error))
                running[writer] = begun(place, writer)
        finally:
            for child, reading in running.values():
                killed(child, reading)
        with open_records(place) as records:
            tally.verified += 1
            tally.faults += [str(found) for found in records.verify()]
            tally.told = records.head()[0]
    return tally


def page(tally: Tally, seconds: float) -> str:
    """The page of documentation."""
    faults = "\n".join(f"- {fault}" for fault in tally.faults[:20]) or "None."
    return f"""# A thousand kills

`python -m benchmarks.records.kills` has {WRITERS} processes write reports into one set of records
(SQLite, {platform.system()}), each into {FOLDERS} folders of its own, as `cmm-uq report` does it. At random
moments, up to {LONGEST_S:g} s apart, one of them is killed by SIGKILL and begun again. After every kill, while the other
process goes on writing,

- every report that the killed process had said to be done must be recorded;
- in each of its folders files and newest entry must be those of the same report, or neither may be there (within
  {SETTLED_S:g} s);
- every hundredth time chain and tables are verified, and at the end all files too.

| | |
| --- | --- |
| kills | {tally.kills} |
| reports said to be done by processes that were killed | {tally.done} |
| entries at the end | {tally.told} |
| kills after which a set was on its way, of either process | {tally.unsettled} |
| whole verifications | {tally.verified} |
| faults | {len(tally.faults)} |

Faults: {faults}

It took {seconds / 60:.0f} minutes. A kill ends a process, not the power: what is on the disk then follows from SQLite's
`synchronous = FULL` and from the files' own `fsync`; no power was cut.
"""


def main() -> None:
    """Run and write the page."""
    start = time.monotonic()
    tally = run(int(sys.argv[1]) if len(sys.argv) > 1 else KILLS)
    print(tally)
    if tally.kills >= KILLS:
        PAGE.write_text(page(tally, time.monotonic() - start), encoding="utf-8")


if __name__ == "__main__":
    main()
