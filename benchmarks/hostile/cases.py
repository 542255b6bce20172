"""One case of the mutations by its number: which seed, what was changed, how it is run."""

from __future__ import annotations

import os
import random
import socket
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.hostile.mutators import mutate
from benchmarks.hostile.seeds import NOTES, Seed, seeds, small_truth
from benchmarks.hostile.values import NUMBERS, WORDS

KINDS = ("fifo", "loop", "folder", "zero", "null", "full", "outside", "missing", "socket", "dangling", "unreadable")
"""What may lie where a file is expected."""
SHARES = {"report": 0.016, "diagnose": 0.02, "plan": 0.02, "simulate": 0.35, "compensate": 0.35, "budget": 0.1}
"""Part of the inputs that read well on which a command then runs in full; the dear ones run less."""
SLOW = ("plan-ballbar", "plan-step-gauge", "shift-plate-simulated", "step-gauge-simulated")
"""Seeds of which a full run takes more than ten seconds: they run in full a tenth as often."""


@dataclass(frozen=True)
class Case:
    """What is laid out in an empty folder, and what is run there.

    Parameters
    ----------
    number : of the case.
    target : what was mutated: job, recording, truth, budget, map, earlier, arguments, kind of a file.
    what : the mutations in words.
    files : contents of ``job/``, by name.
    odd : files that are something else than a file.
    reads : arguments of the run that only reads; empty where nothing is read first.
    command : arguments of the full run; empty where there is none.
    """

    number: int
    target: str
    what: str
    files: dict[str, bytes]
    reads: tuple[str, ...]
    command: tuple[str, ...] = ()
    odd: dict[str, str] = field(default_factory=dict)


def case(seed: int, number: int) -> Case:
    """The case of this number; the same seed and number give the same case."""
    random_ = random.Random(f"mutations:{seed}:{number}")
    start = random_.choice(_pool())
    roll = random_.random()
    if roll < 0.05:
        return _arguments(number, start, random_)
    files = dict(start.files)
    names = _targets(start)
    if roll < 0.10:
        name, kind = random_.choice(names), random_.choice(KINDS)
        return Case(number, "kind of file", f"{start.name}/{name} is a {kind}", files, _reads(start), (), {name: kind})
    said, first = [], random_.choice(names)
    for i in range(2 if random_.random() < 0.3 else 1):
        name = first if i == 0 else random_.choice(names)
        how, files[name] = mutate(name, files[name], _other(name, random_), random_)
        said.append(f"{how} of {start.name}/{name}")
    return Case(number, _target(first), "; ".join(said), files, _reads(start), _full(start, random_))


def lay_out(case: Case, folder: Path, *, exist_ok: bool = False) -> None:
    """Make the folder of a case: ``job/`` with its files, and a stranger's file beside."""
    job = folder / "job"
    job.mkdir(parents=True, exist_ok=exist_ok)
    (folder / NOTES).write_bytes(b"mine\n")
    for name, content in case.files.items():
        if name not in case.odd:
            (job / name).write_bytes(content)
    for name, kind in case.odd.items():
        _make(job / name, kind, case.files[name])


def _make(path: Path, kind: str, content: bytes) -> None:
    devices = {"zero": "/dev/zero", "null": "/dev/null", "full": "/dev/full", "dangling": "nowhere", "loop": path.name}
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            here = Path.cwd()
            os.chdir(path.parent)  # the name of a socket may have 108 characters only
            made.bind(path.name)
            os.chdir(here)
    elif kind == "outside":
        (path.parent.parent / "elsewhere").write_bytes(content)
        path.symlink_to("../elsewhere")
    elif kind == "unreadable":
        path.write_bytes(content)
        path.chmod(0)
    elif kind != "missing":
        path.symlink_to(devices[kind])


def _pool() -> list[Seed]:
    """Seeds by the weight they have among the cases: those that stand for a whole parser come more often."""
    weight = {"truth": 3, "budget": 2, "maps": 2}
    return [seed for seed in seeds().values() for _ in range(weight.get(seed.reads, 1))]


def _targets(start: Seed) -> list[str]:
    """Files worth mutating; of a truth only the truth itself, since jobs have cases of their own."""
    return ["truth.toml"] if start.reads == "truth" else [name for name in start.files if name != NOTES]


def _target(name: str) -> str:
    plain = {"job.toml": "job", "truth.toml": "truth", "budget.toml": "budget", "earlier.csv": "earlier recording"}
    return plain.get(name, "error map" if name.startswith("error_map") else "recording")


def _other(name: str, random_: random.Random) -> bytes:
    """A file of the same kind from any seed."""
    alike = [content for seed in seeds().values() for other, content in seed.files.items()
             if Path(other).suffix == Path(name).suffix]  # fmt: skip
    return random_.choice(alike)


def _reads(start: Seed) -> tuple[str, ...]:
    where = {"truth": "job/truth.toml", "budget": "job/budget.toml"}.get(start.reads, "job")
    return ("read", "plan" if start.commands == ("plan",) else start.reads, where)


def _full(start: Seed, random_: random.Random) -> tuple[str, ...]:
    command = random_.choice(start.commands)
    share = SHARES[command] * (0.1 if start.name in SLOW else 1.0)
    return _command(command, start, "out") if random_.random() < share else ()


def _command(command: str, start: Seed, out: str) -> tuple[str, ...]:
    subject = "job/budget.toml" if command == "budget" else "job"
    more = {
        "plan": ("--no-power",),
        "simulate": ("--truth", "job/truth.toml" if "truth.toml" in start.files else "truth.toml"),
    }
    return (command, subject, "--out", out, "--quiet", *more.get(command, ()))


def _arguments(number: int, start: Seed, random_: random.Random) -> Case:
    """An odd argument of a command: the job, the folder to write to, a number."""
    more = ("\udcff", "job/job.toml", "job/notes.txt", "job", "notes.txt/out", "/proc/x", "/dev/null")
    words = [word for word in (*WORDS, *NUMBERS, *more) if "\0" not in word and len(word) < 100_000]
    odd = random_.choice(words)
    command = (
        random_.choice(("simulate", "compensate", "budget"))
        if random_.random() < 0.7
        else random_.choice(("report", "plan"))
    )
    arguments = list(_command(command, start, "out"))
    place = (
        random_.choice(("subject", "out", "--seed", "--alpha", "unknown", "truth")) if command in SHARES else "subject"
    )
    if command in ("report", "plan") or place == "subject":
        place, arguments[1] = "subject", odd if odd not in ("job", "job/job.toml") else "nowhere"
    elif place == "out":
        arguments[3] = odd if not Path(odd).is_absolute() or odd.startswith(("/dev", "/proc")) else "out"
    elif place == "unknown":
        arguments.append(odd)
    else:
        arguments += ["--truth" if place == "truth" else place, odd]
    files = dict(start.files) | ({"truth.toml": small_truth()} if command == "simulate" else {})
    return Case(number, "arguments", f"{command} of {start.name}, {place}: {odd[:60]!r}", files, (), tuple(arguments))
