"""Are the truths' ranks in their posteriors uniform: ``python -m benchmarks.ranks.study FOLDER [--only WORDS] [--page]``.

Simulation-based calibration of the sampler (Talts et al. 2018). Every recording is appended to ``FOLDER/<artefact>.jsonl`` as
it is done, so that a run can be stopped and taken up again, and more recordings added. ``--only`` takes artefacts whose
name contains one of the words, ``--page`` writes the page and runs nothing.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.coverage.measuring import kept
from benchmarks.coverage.study import measure, waiting
from benchmarks.ranks.drawn import CASES
from benchmarks.ranks.measuring import Case, ranked
from benchmarks.ranks.page import gathered, page

PAGE = Path(__file__).parents[2] / "docs" / "noise-ranks.md"


def main() -> None:
    """Run, count, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="words of the artefacts' names")
    parser.add_argument("--recordings", type=int, default=100, help="of each artefact")
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--page", nargs="?", const=PAGE, type=Path, help="write the page from what is there")
    chosen = parser.parse_args()
    some = [Case(name) for name in CASES if not chosen.only or any(word in name for word in chosen.only)]
    if not chosen.page:
        tasks = waiting(some, chosen.folder, chosen.seed, chosen.recordings)
        measure(tasks, chosen.folder, chosen.processes, ranked)
    found = page(gathered(kept(chosen.folder)))
    if chosen.page:
        chosen.page.write_text(found, encoding="utf-8")
    print(found)


if __name__ == "__main__":
    main()
