"""What a study found, as counts that can be kept, and as the page that shows them."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

OUTCOMES = {"0": "done", "2": "refused (2)", "3": "output impossible (3)", "4": "done, not conforming (4)",
            "130": "SIGINT (130)", "143": "SIGTERM (143)", "-9": "killed", "None": "stopped"}  # fmt: skip
PARTS = {
    "mutations": ("Mutated inputs", "input"),
    "commands": ("Hostile files for every command", "command"),
    "programs": ("Hostile files for every command, each a process", "command"),
    "signatures": ("Attacks on signatures", "form"),
    "acquisitions": ("Live recordings killed while points are accepted", "signal"),
    "calls": ("Kills at system calls that change the disk", "command and signal"),
    "terminals": ("Pseudo-terminals that vanish, are silent or babble", "command"),
    "kills": ("Kills and interruptions", "command and signal"),
    "disk": ("Places that cannot be written to", "command"),
    "collisions": ("Collisions", "second command"),
}
EXAMPLES = 3


@dataclass
class Tally:
    """Counts of one part.

    Parameters
    ----------
    part : its name.
    seed : of the study.
    seconds : it took.
    counts : of runs by kind and exit code.
    full : of runs in full, by command.
    found : of every violation: how often, and the first examples as number, words and what was said.
    """

    part: str
    seed: int
    seconds: float = 0.0
    counts: Counter[str] = field(default_factory=Counter)
    full: Counter[str] = field(default_factory=Counter)
    violating: int = 0
    found: dict[str, tuple[int, list[tuple[int, str, str]]]] = field(default_factory=dict)

    def add(
        self, number: int, kind: str, what: str, code: int | None, found: list[str], said: str = "", ran: str = ""
    ) -> bool:
        """Count one case; whether it is among the first of a violation, and so worth keeping."""
        self.counts[f"{kind}|{code}"] += 1
        if ran:
            self.full[ran] += 1
        self.violating += bool(found)
        fresh = False
        for problem in dict.fromkeys(found):
            count, examples = self.found.get(problem, (0, []))
            fresh |= len(examples) < EXAMPLES
            self.found[problem] = count + 1, [*examples, (number, what, said[-300:])][:EXAMPLES]
        return fresh

    @property
    def cases(self) -> int:
        """Number of all cases."""
        return sum(self.counts.values())

    def save(self, folder: Path) -> None:
        """Keep it for the page."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{self.part}.json").write_text(
            json.dumps(vars(self), indent=1, ensure_ascii=False), encoding="utf-8"
        )


def load(folder: Path) -> list[Tally]:
    """What was kept, in the order of the parts."""
    files = [folder / f"{part}.json" for part in PARTS]
    kept = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.exists()]
    return [Tally(**{**each, "counts": Counter(each["counts"]), "full": Counter(each["full"])}) for each in kept]


def page(tallies: list[Tally]) -> str:
    """The page of a study, as Markdown."""
    lines = [
        "# Hostile inputs, kills, bad places and collisions", "",
        "Written by `python benchmarks/hostile/study.py`, which reruns all of it; `--part` runs one part,",
        "`--only mutations:123` repeats one case. Checked after every run:", "",
        "- no traceback and no warning, and an exit code of the documented ones;",
        "- a refusal is one line of at most 300 characters without control characters;",
        "- at most 10 s for what is read or refused, 2 s after SIGINT or SIGTERM;",
        "- every file that was there before keeps its bytes, or has them in a copy `.previous`;",
        "- a folder that was written to is a complete set by its `manifest.json`; after a kill, with the next run;",
        "- what an interruption says is true.", "",
        "| part | cases | with a violation | seed | minutes |", "| --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    lines += [f"| {PARTS[t.part][0]} | {t.cases} | {t.violating} | {t.seed} | {t.seconds / 60:.1f} |" for t in tallies]
    for tally in tallies:
        lines += ["", *_part(tally)]
    return "\n".join(lines) + "\n"


def _part(tally: Tally) -> list[str]:
    title, kind = PARTS[tally.part]
    rows = [(*key.rsplit("|", 1), count) for key, count in tally.counts.items()]
    codes = sorted({code for _, code, _ in rows}, key=lambda code: (len(code), code))
    lines = [f"## {title}", "", f"| {kind} | {' | '.join(OUTCOMES.get(code, f'exit {code}') for code in codes)} |",
             "| --- |" + " --- |" * len(codes)]  # fmt: skip
    for name in sorted({name for name, _, _ in rows}):
        counts = (str(tally.counts.get(f"{name}|{code}", 0)) for code in codes)
        lines += [f"| {name} | {' | '.join(counts)} |"]
    if tally.full:
        ran = ", ".join(f"{name} {count}" for name, count in tally.full.most_common() if name)
        lines += [
            "",
            f"Run in full: {sum(tally.full.values())} ({ran}); the others only read, or are refused on reading.",
        ]
    if not tally.found:
        return [*lines, "", "No violation."]
    lines += ["", "| violation | count | first cases |", "| --- | --- | --- |"]
    for problem, (count, examples) in sorted(tally.found.items(), key=lambda item: -item[1][0]):
        cases = "; ".join(f"{number}: {_cell(what)}" for number, what, _ in examples)
        lines += [f"| {_cell(problem)} | {count} | {cases} |"]
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")[:140]
