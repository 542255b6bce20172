"""Kills and interruptions: at every system call that changes the disk, by strace, and at random moments."""

from __future__ import annotations

import random
import re
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.hostile.invariants import STOPS, Outcome, lost, problems, set_problems, snapshot
from benchmarks.hostile.processes import COMMANDS, OUT, contents, emptied, memory, put, reference, run, taken_for_a_set
from benchmarks.hostile.warm import Warm

CALLS = ("rename", "renameat", "renameat2", "link", "linkat", "symlink", "symlinkat", "unlink", "unlinkat", "mkdir",
         "mkdirat", "rmdir", "write", "pwrite64", "ftruncate", "fsync", "fdatasync", "flock")  # fmt: skip
"""System calls that change what lies on the disk, or say that it stays."""
SIGNALS = ("SIGKILL", "SIGKILL", "SIGINT", "SIGTERM")
SHARES = {"simulate": 6.0, "compensate": 4.0, "budget": 4.0, "plan": 2.0, "diagnose": 1.0, "report": 2.0}
"""How often each command is hit: the cheap ones more often."""
AT_ONCE = 0.3
"""Seconds within which a process that was all but done may still end with 0 after a signal."""
NOTHING = re.compile(r"nothing (was|is|has been) (written|changed)")


@dataclass(frozen=True)
class Kill:
    """One kill: the command, what lay in its folder before, the signal, and when.

    Parameters
    ----------
    command : its name.
    over : whether it writes over a set of its own, otherwise into a folder that does not exist.
    signal : its name.
    call : the system call at which it comes, and at which of them; None at a random moment.
    after : seconds, for a random moment.
    """

    command: str
    over: bool
    signal: str
    call: tuple[str, int] | None
    after: float = 0.0

    @property
    def what(self) -> str:
        """In words."""
        when = f"at {self.call[0]} number {self.call[1]}" if self.call else f"after {self.after:.3f} s"
        return f"{self.signal} {when}, {'over its own set' if self.over else 'into a new folder'}"


def available() -> bool:
    """Whether strace is there, may trace, and has a signal arrive at a call."""
    with tempfile.TemporaryDirectory() as folder:
        at = _at(Path(folder), "SIGKILL", ("write", 1))
        return bool(shutil.which("strace")) and run(["--version"], Path(folder), prefix=at).code == -signal.SIGKILL


def _strace(folder: Path, *more: str) -> list[str]:
    return ["strace", "-f", "-qq", "-ttt", "-s", "60", "-o", str(folder / "trace"), *more]


def _at(folder: Path, name: str, call: tuple[str, int]) -> list[str]:
    """A signal at a call. Without ``--seccomp-bpf``: with it strace 6.1 traces the call and leaves the signal out."""
    return _strace(folder, "-e", f"trace={call[0]}", "-e", f"inject={call[0]}:signal={name}:when={call[1]}")


def calls(command: str, *, over: bool, warm: Warm | None = None) -> list[tuple[str, int]]:
    """Every system call of a command that changes the disk, by name and how many of that name came before."""
    with tempfile.TemporaryDirectory(dir=memory()) as folder:
        _prepare(Path(folder), command, over=over)
        trace = "-e", f"trace={','.join(CALLS)}"
        if warm is None:
            run(COMMANDS[command].arguments(), Path(folder), prefix=_strace(Path(folder), "--seccomp-bpf", *trace))
        else:
            warm.run(COMMANDS[command].arguments(), Path(folder), traced=_strace(Path(folder), *trace))
        lines = (Path(folder) / "trace").read_text(errors="replace").splitlines()
    first = lines[0].split()[0] if lines else ""
    counts = Counter(match[1] for line in lines if line.startswith(first)
                     and (match := re.match(r"\d+\s+[\d.]+ (\w+)\(", line)))  # fmt: skip
    return [(name, k) for name, count in counts.items() for k in range(1, count + 1)]


def duration(command: str) -> float:
    """Seconds that a command takes undisturbed."""
    with tempfile.TemporaryDirectory(dir=memory()) as folder:
        _prepare(Path(folder), command, over=True)
        return run(COMMANDS[command].arguments(), Path(folder)).seconds


def plan(count: int, seed: int, commands: Mapping[str, float], trace: bool) -> Iterator[Kill]:
    """The kills of a study: every call once with each signal as far as the count goes, then random moments.

    Parameters
    ----------
    count : of all kills; at least half of them come at random moments.
    commands : names, with the share of the random moments.
    trace : whether calls can be traced here.
    """
    at_calls = [
        Kill(command, over, name, call)
        for command in (commands if trace else ())
        for over in (True, False)
        for call in calls(command, over=over)
        for name in dict.fromkeys(SIGNALS)
    ]
    random.Random(f"kills:{seed}").shuffle(at_calls)
    at_calls.sort(key=lambda kill: (kill.signal != "SIGKILL", not kill.over))
    yield from at_calls[: count // 2]
    times = {command: duration(command) for command in commands}
    for number in range(count - min(len(at_calls), count // 2)):
        random_ = random.Random(f"kills:{seed}:{number}")
        command = random_.choices(list(commands), list(commands.values()))[0]
        yield Kill(
            command, random_.random() < 0.7, random_.choice(SIGNALS), None, random_.uniform(0.02, 1.05 * times[command])
        )


def _prepare(folder: Path, command: str, *, over: bool) -> None:
    COMMANDS[command].prepare(folder, version=1)
    if over:
        put(folder / OUT, reference(command, 0))


def chosen(seed: int, number: int, warm: Warm | None) -> Kill:
    """A kill at one of the calls of one of the commands; ``warm``: where its process is forked."""
    random_ = random.Random(f"calls:{seed}:{number}")
    (command,) = random_.choices(list(SHARES), list(SHARES.values()))
    over, name = random_.random() < 0.5, random_.choice(SIGNALS)
    return Kill(command, over, name, random_.choice(_calls(command, over, warm)))


@cache
def _calls(command: str, over: bool, warm: Warm | None) -> list[tuple[str, int]]:
    return calls(command, over=over, warm=warm)


def strike(kill: Kill, folder: Path, warm: Warm | None = None) -> tuple[Outcome, list[str]]:
    """Kill a command, look at what it left, run it again, and say what does not hold; forked, where there is a warm one."""
    emptied(folder)
    command, never = COMMANDS[kill.command], False
    _prepare(folder, kill.command, over=kill.over)
    before = snapshot(folder)
    start: Callable[..., Outcome] = run if warm is None else warm.run
    if kill.call:
        at = _at(folder, kill.signal, kill.call)
        outcome = start(command.arguments(), folder, **{"prefix" if warm is None else "traced": at})
        trace = folder / "trace"
        never = not re.search(rf"--- {kill.signal} |killed by {kill.signal} ", trace.read_text(errors="replace"))
        outcome = _since_signal(outcome, trace)
        trace.unlink(missing_ok=True)
    else:
        outcome = start(command.arguments(), folder, kill=(getattr(signal, kill.signal), kill.after))
    found = ["the signal never came"] * never + _after_signal(kill, outcome, folder, before)
    again = start(command.arguments(), folder)
    if again.code != 0:
        found.append(f"the next run ends with {again.code}")
    found += [f"after the next run: {problem}" for problem in (*problems(again), *set_problems(folder / OUT))]
    if again.code == 0 and contents(folder / OUT) != reference(kill.command, 1):
        found.append("after the next run: other bytes than an undisturbed run writes")
    return outcome, found


def _since_signal(outcome: Outcome, trace: Path) -> Outcome:
    """The same with the seconds since the signal came, by the trace."""
    came = re.search(r"^\d+\s+([\d.]+) --- SIG(INT|TERM)", trace.read_text(errors="replace"), re.MULTILINE)
    seconds = trace.stat().st_mtime - float(came[1]) if came else 0.0
    return Outcome(outcome.code, outcome.stdout, outcome.stderr, max(0.0, min(seconds, time.time())))


def _after_signal(kill: Kill, outcome: Outcome, folder: Path, before: Mapping[str, str]) -> list[str]:
    after = snapshot(folder)
    own = frozenset(f"{OUT}/{name}" for name in reference(kill.command, 0)) if kill.over else frozenset()
    found = lost(before, after, own=own)
    lies = contents(folder / OUT)
    if taken_for_a_set(folder / OUT) and lies not in (reference(kill.command, 0), reference(kill.command, 1)):
        found.append("old and new are taken for a set")
    if kill.signal == "SIGKILL" and outcome.code in (0, -signal.SIGKILL):
        return found
    if after == before and outcome.code in (-signal.SIGINT, -signal.SIGTERM) and "cmm_uq" not in outcome.stderr:
        return found  # it came before the program's first line, or after its last
    if outcome.code is None or outcome.code not in (130, 143):
        late = outcome.code == 0 and outcome.seconds > AT_ONCE
        return [*found, *(problems(outcome) if outcome.code else ["the signal is swallowed"] if late else [])]
    checks: tuple[tuple[str, Callable[[], bool]], ...] = (
        (f"ends later than {STOPS:g} s after the signal", lambda: outcome.seconds > STOPS),
        (
            "says that nothing was written, and something was",
            lambda: bool(NOTHING.search(outcome.stderr)) and after != before,
        ),
        ("does not say that nothing was written", lambda: not NOTHING.search(outcome.stderr) and after == before),
        ("a traceback", lambda: "Traceback" in outcome.stderr),
        ("not one line", lambda: outcome.stderr.count("\n") != 1),
        ("leaves something staged", lambda: any("/." in name and name not in before for name in after)),
    )
    return found + [words for words, holds in checks if holds()]
