"""What became of the mutants: ``python -m benchmarks.mutation.table [--keep FOLDER] [--survivors]``."""

from __future__ import annotations

import argparse
import json
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from benchmarks.mutation.modules import KEEP, MODULES, ROOT
from benchmarks.mutation.operators import Mutant, mutants

EQUIVALENT = Path(__file__).with_name("equivalent.toml")

Record = dict[str, object]


def read(keep: Path) -> dict[tuple[object, ...], Record]:
    """The last result of every mutant, by its key."""
    file = keep / "results.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    records = [json.loads(line) for line in lines]
    return {tuple(record[name] for name in ("module", "source", "change", "nth")): record for record in records}


class Equivalents:
    """Faults that change nothing, as ``equivalent.toml`` lists them with the reason."""

    def __init__(self, file: Path = EQUIVALENT) -> None:
        entries = tomllib.loads(file.read_text(encoding="utf-8")).get("equivalent", [])
        self._nth = {(entry["module"], entry["line"], entry["change"]): entry.get("nth") for entry in entries}

    def __contains__(self, mutant: Mutant) -> bool:
        key = mutant.module, mutant.source, mutant.change
        return key in self._nth and (self._nth[key] is None or mutant.nth in self._nth[key])


def outcomes(keep: Path, module: str) -> Iterator[tuple[Mutant, str]]:
    """Each fault that the module has now, and what became of it: killed, survived, equivalent, not drawn."""
    done, equivalents = read(keep), Equivalents()
    for mutant in mutants(ROOT, module):
        result = str(done.get(mutant.key, {}).get("result", "not drawn"))
        yield mutant, "equivalent" if mutant in equivalents and result != "killed" else result


def main() -> None:
    """Print the table, or what survived."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--survivors", action="store_true")
    parser.add_argument("--keep", type=Path, default=KEEP)
    options = parser.parse_args()
    print("| module | mutants | drawn | equivalent | viable | killed | survived | killed, % |\n|" + " --- |" * 8)
    total: Counter[str] = Counter()
    for module in MODULES:
        found = list(outcomes(options.keep, module))
        counts = Counter(result for _, result in found)
        print(_row(module.removeprefix("cmm_uq/").removesuffix(".py"), counts))
        total += counts
        for mutant, result in found:
            if options.survivors and result == "survived":
                print(f"  {mutant.line}: {mutant.source} | {mutant.change}")
    print(_row("all", total))


def _row(name: str, counts: Counter[str]) -> str:
    every, viable = sum(counts.values()), counts["killed"] + counts["survived"]
    share = f"{100 * counts['killed'] / viable:.1f}" if viable else "–"
    cells = (
        name,
        every,
        every - counts["not drawn"],
        counts["equivalent"],
        viable,
        counts["killed"],
        counts["survived"],
        share,
    )
    return "| " + " | ".join(map(str, cells)) + " |"


if __name__ == "__main__":
    main()
