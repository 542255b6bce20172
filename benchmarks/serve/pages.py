"""How long the server takes for each page: ``python -m benchmarks.serve.pages [MACHINES EACH | RECORDS]``.

By default over 10⁵ certificates of 1 000 machines in SQLite, made for it in a temporary folder (two minutes). The site is
asked without a network, as the server asks it: the records are opened, read, the page is rendered. Wall time is the median of
seven, beside the processor's own time, which other programs on the machine do not lengthen as much. The first rows are the
page when nothing is known, as on every new day, and after an entry was added: as known up to the one before the last.
"""

from __future__ import annotations

import gc
import statistics
import sys
import tempfile
import time
from pathlib import Path

from cmm_uq.app.cli import NEW_OBJECTS
from cmm_uq.app.serve.exchange import WebRequest, read_address
from cmm_uq.app.serve.site import Site
from cmm_uq.app.serve.view import MachineOverview
from cmm_uq.base.values import replace
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.listing import entry_of
from tests.laboratory.records.histories import made

TIMES = 7
ADDRESSES = {
    "machines": "/", "machines, last page": "/?page={last}", "machines by a text": "/?text=1000",
    "one machine, with its trends": "/machine?serial=100005", "certificates": "/certificates",
    "certificates, page 1 000": "/certificates?page=1000", "certificates, page 2 000": "/certificates?page=2000",
    "certificates by a text": "/certificates?text=1000", "certificates by a text that none has": "/certificates?text=zzz",
    "certificates that fail": "/certificates?decision=fail", "certificates of a state": "/certificates?state=draft&page=500",
    "certificates of a year": "/certificates?since=2020-01-01&until=2020-12-31",
    "certificates of an artefact": "/certificates?artefact=BB-3", "certificates of a machine": "/certificates?machine=100005",
    "one certificate": "/certificate?entry=50000", "diagnoses that are not consistent": "/diagnoses",
    "all diagnoses": "/diagnoses?verdict=all", "all diagnoses, page 1 000": "/diagnoses?verdict=all&page=1000",
    "artefacts": "/artefacts", "check a file": "/file", "integrity": "/integrity",
}  # fmt: skip


def timed(site: Site, target: str, before: MachineOverview | None, *, anew: bool = False) -> tuple[float, float, int]:
    """Median of wall time and of the processor's, ms, and bytes of the page; ``anew``: with ``before`` alone known."""
    asked, wall, processor, size = WebRequest("GET", *read_address(target)), [], [], 0
    for _ in range(TIMES):
        if anew:
            site._kept = before
        begun = time.perf_counter(), time.process_time()
        answer = site.answer(asked)
        wall.append(time.perf_counter() - begun[0])
        processor.append(time.process_time() - begun[1])
        assert answer.status == 200, target
        size = len(answer.body)
    return 1e3 * statistics.median(wall), 1e3 * statistics.median(processor), size


def measure(place: Path) -> None:
    """Print a row for each page."""
    gc.set_threshold(NEW_OBJECTS)
    site = Site(place)
    site.warm()
    last = max(1, -(-len(site.machines()) // 50))
    print("| page | wall, ms | processor, ms | kB |\n| --- | --- | --- | --- |")
    known = site._kept
    assert known is not None
    with open_records(place, read_only=True) as records:
        entry = entry_of(records, known.head[0] - 1)
    assert entry is not None
    before = replace(known, head=(entry.number, entry.hash))
    rows = [("machines, nothing known", timed(site, "/", None, anew=True))]
    rows += [("machines, after a new entry", timed(site, "/", before, anew=True))]
    rows += [(name, timed(site, target.format(last=last), None)) for name, target in ADDRESSES.items()]
    for name, (wall, processor, size) in rows:
        print(f"| {name} | {wall:.0f} | {processor:.0f} | {size / 1e3:.0f} |")


def main() -> None:
    """Make the records, unless they are named, and measure."""
    if len(sys.argv) == 2:
        measure(Path(sys.argv[1]))
        return
    machines, each = map(int, sys.argv[1:3] or (1000, 100))
    with tempfile.TemporaryDirectory() as folder:
        made(Path(folder) / "records.db", machines, each).close()
        measure(Path(folder) / "records.db")


if __name__ == "__main__":
    main()
