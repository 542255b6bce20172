"""The second concealed study: ``python -m benchmarks.second.study FOLDER [--cases 60] [--nulls 300] [--seed 0]``.

Cases are made first and their truth is sealed by a hash; then they are diagnosed and searched by two oracles. Every result is
a line in ``FOLDER``, so that a run can be stopped and taken up again, and more cases added with larger numbers.
``--only make``, ``diagnose`` or ``search`` does one part; ``--kind "artefact, geometry"``, once or more, leaves out all other
kinds; ``--page docs`` writes the page in the end, with what ``FOLDER/note.txt`` says of the run, if anything, and with
``--count`` of what is there. The larger run is ``--seed 20261125 --nulls 600 --cases 120 --page docs``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.second.cases import KINDS
from benchmarks.second.page import write
from benchmarks.second.running import completed, kept, lines, sealed, tasks

PARTS = ("make", "diagnose", "search")


def main() -> None:
    """Make, diagnose, search, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=60, help="of each kind that hides something")
    parser.add_argument("--nulls", type=int, default=300, help="of each kind of noise, without a cause")
    parser.add_argument("--seed", type=int, default=0, help="of the cases")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", choices=PARTS, help="one part of the work")
    parser.add_argument("--kind", action="append", choices=KINDS, help="of cases, by default all")
    parser.add_argument("--page", type=Path, help="write page and picture into this folder, in the end")
    parser.add_argument("--count", action="store_true", help="run nothing; count what is there")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)

    def listed(what: str) -> list:
        every = tasks(chosen.folder, chosen.seed, chosen.cases, chosen.nulls, what)
        return [task for task in every if task[2] in (chosen.kind or KINDS)]

    if not chosen.count:
        kept(listed("make"), chosen.folder / "make.jsonl", chosen.workers)
    truths, mark = sealed(chosen.folder, listed("make"))
    print(f"{len(truths)} cases, truth sealed: {mark}", flush=True)
    if not chosen.count:
        for what in PARTS[1:] if chosen.only is None else {chosen.only} - {"make"}:
            kept(listed(what), chosen.folder / f"{what}.jsonl", chosen.workers)
    found, oracles = (
        {record["name"]: record for record in lines(chosen.folder / f"{what}.jsonl")} for what in PARTS[1:]
    )
    note = chosen.folder / "note.txt"
    said = note.read_text(encoding="utf-8").strip() if note.exists() else ""
    truths = completed(truths, chosen.seed)
    write(truths, found, oracles, mark, (chosen.cases, chosen.nulls, chosen.seed), chosen.page, said)


if __name__ == "__main__":
    main()
