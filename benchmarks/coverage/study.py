"""Do 95 % intervals hold under the noise that machines have: ``python -m benchmarks.coverage.study FOLDER [--only WORDS]``.

Every recording is appended to ``FOLDER/<cell>.jsonl`` as it is done, so that a run can be stopped and taken up again, and more
recordings added. ``--only`` takes cells whose name contains one of the words, ``--page`` writes the page, ``--beside`` names
the folder of another run, whose u is compared where the noise is white.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from benchmarks.coverage.cells import Cell, cells
from benchmarks.coverage.measuring import kept, measured, run
from benchmarks.coverage.page import page
from benchmarks.coverage.tally import POOLED, Tally, tallies

PAGE = Path(__file__).parents[2] / "docs" / "coverage-study.md"
FURTHER = "## Figures of performance without noise"
"""Heading of what another study writes below this one's."""


class Named(Protocol):
    """A cell of a study."""

    @property
    def name(self) -> str:
        """Of its file too."""


AnyCell = TypeVar("AnyCell", bound=Named)


def waiting(chosen: list[AnyCell], folder: Path, seed: int, count: int) -> list[tuple[AnyCell, int, int]]:
    """What is not done yet, the first recordings of all cells first."""
    done = {(record["cell"], record["number"]) for record in kept(folder)}
    return [(cell, seed, i) for i in range(count) for cell in chosen if (cell.name, i) not in done]


def measure(
    tasks: Sequence[Any], folder: Path, processes: int, work: Callable[[Any], dict[str, Any]] = measured
) -> None:
    """Run them, and keep each record.

    Parameters
    ----------
    tasks : of this study or of another one.
    folder : of the records.
    processes : at once.
    work : what makes a record, which names its cell and its number, of a task.
    """
    folder.mkdir(parents=True, exist_ok=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as progress:
        bar = progress.add_task("Recordings", total=len(tasks))
        for record in run(tasks, processes, work):
            file = folder / f"{record['cell'].replace(' ', '_').replace(',', '')}.jsonl"
            cut = file.exists() and not file.read_bytes().endswith(b"\n")
            with file.open("a", encoding="utf-8") as out:
                out.write("\n" * cut + json.dumps(record, ensure_ascii=False) + "\n")
            progress.advance(bar)


def main() -> None:
    """Run, count, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--only", nargs="*", default=[], help="words of the cells' names; '=NAME' for one by its whole name"
    )
    parser.add_argument("--recordings", type=int, default=200, help="of each cell")
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument(
        "--page", nargs="?", const=PAGE, type=Path, help="write the page from what is there, and run nothing"
    )
    parser.add_argument("--beside", type=Path, help="folder of a run of a model of white noise")
    chosen = parser.parse_args()
    some = [cell for cell in cells() if not chosen.only or any(_means(word, cell) for word in chosen.only)]
    if not chosen.page:
        measure(waiting(some, chosen.folder, chosen.seed, chosen.recordings), chosen.folder, chosen.processes)
    found = tallies(kept(chosen.folder))
    if chosen.page:
        beside = tallies(kept(chosen.beside)) if chosen.beside else {}
        whole = chosen.page.read_text(encoding="utf-8") if chosen.page.exists() else ""
        further = whole[whole.index(FURTHER) :] if FURTHER in whole else ""  # of benchmarks.coverage.performance
        written = page(found, beside, chosen.folder / "power.json")
        chosen.page.write_text(f"{written}\n{further}" if further else written, encoding="utf-8")
    for cell in some:
        if cell.name in found:
            print(f"{cell.name}: {_line(found[cell.name])}")


def _line(tally: Tally) -> str:
    """What a cell came to."""
    held, (worst, least), count = tally.group(*POOLED), tally.worst, tally.recordings
    return (
        f"{count} recordings, hold {held.share:.1f} %, factors {tally.group('factors').share:.1f}, figures "
        f"{tally.group('figures').share:.1f}, worst {worst} {least.share:.0f}, noisy axis {tally.noisy.share:.0f}, "
        f"cries {tally.cries.hits}, faults {sum(tally.faults.values())}, {sum(tally.seconds) / count:.1f} s each"
    )


def _means(word: str, cell: Cell) -> bool:
    return cell.name == word[1:] if word.startswith("=") else word in cell.name


if __name__ == "__main__":
    main()
