"""Places that cannot be written to, or not for long: full, read-only, in the way, closed, gone."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Protocol

from benchmarks.hostile.invariants import Outcome, lost, problems, set_problems, snapshot
from benchmarks.hostile.processes import (
    COMMANDS,
    OUT,
    contents,
    emptied,
    environment,
    put,
    reference,
    run,
    taken_for_a_set,
)  # fmt: skip


@dataclass(frozen=True)
class Way:
    """How a command is run in a bad place.

    Parameters
    ----------
    arguments : of the command.
    prefix : a program that runs it.
    more : for the process: environment, stdout, stderr.
    quiet : whether it should say nothing on stderr when it ends well.
    heard : whether anything that it says arrives.
    """

    arguments: tuple[str, ...]
    prefix: tuple[str, ...] = ()
    more: Mapping[str, object] = field(default_factory=dict)
    quiet: bool = True
    heard: bool = True


class Place(Protocol):
    """Makes a folder a bad place for as long as it lasts."""

    def __call__(self, folder: Path, way: Way) -> AbstractContextManager[Way]: ...


def _mount(*arguments: str) -> None:
    subprocess.run(["mount", *arguments], check=True, capture_output=True)


def _unmount(path: Path) -> None:
    subprocess.run(["umount", "--lazy", str(path)], check=True, capture_output=True)


def may_mount() -> bool:
    """Whether this user may mount."""
    return (
        os.geteuid() == 0
        and subprocess.run(["unshare", "--mount", "true"], check=False, capture_output=True).returncode == 0
    )


@contextmanager
def small(folder: Path, way: Way, *, options: str) -> Iterator[Way]:
    """The folder to write to is a file system of its own with hardly any room, the old set in it."""
    old, out = contents(folder / OUT), folder / OUT
    size = sum(-(-len(content) // 4096) * 4 for content in old.values()) + 4
    shutil.rmtree(out)
    out.mkdir()
    name, _, room = options.partition("=")
    limit = f"size={size + int(room)}k" if name == "size" else f"nr_inodes={len(old) + 1 + int(room)}"
    _mount("-t", "tmpfs", "-o", limit, "hostile", str(out))
    try:
        for file, content in old.items():
            (out / file).write_bytes(content)
        yield way
        left = contents(out)
    finally:
        _unmount(out)
    for file, content in left.items():
        (out / file).write_bytes(content)


@contextmanager
def bound(folder: Path, way: Way, *, name: str, read_only: bool) -> Iterator[Way]:
    """The folder, or a file in it, is mounted over itself: read-only, or so that nothing can take its place."""
    path = folder / OUT / name
    _mount("--bind", str(path), str(path))
    try:
        if read_only:
            _mount("-o", "remount,bind,ro", str(path))
        yield way
    finally:
        _unmount(path)


@contextmanager
def forbidden(folder: Path, way: Way, *, mode: int) -> Iterator[Way]:
    """The folder has no permission to write, for a process without the privileges of root."""
    (folder / OUT).chmod(mode)
    drop = ("setpriv", "--inh-caps=-all", "--bounding-set=-all") if os.geteuid() == 0 else ()
    yield replace(way, prefix=drop)
    (folder / OUT).chmod(0o755)


@contextmanager
def in_the_way(folder: Path, way: Way, *, name: str) -> Iterator[Way]:
    """Where a file would go, there is a folder with a stranger's file in it."""
    path = folder / OUT / name
    path.unlink(missing_ok=True)
    path.mkdir()
    (path / "strange.txt").write_bytes(b"not yours\n")
    yield way


@contextmanager
def prefixed(folder: Path, way: Way, *, prefix: Sequence[str]) -> Iterator[Way]:
    """Another program runs the command: a limit of size, a shell that closes or removes something."""
    # a limit of a byte holds for the file that stderr goes to as well
    yield replace(way, prefix=tuple(prefix), quiet=False, heard=not {"--fsize=0", "--fsize=1"} & set(prefix))


@contextmanager
def environed(folder: Path, way: Way, *, more: Mapping[str, str]) -> Iterator[Way]:
    """Odd variables of the environment; the command may print."""
    arguments = tuple(argument for argument in way.arguments if argument != "--quiet")
    yield replace(way, arguments=arguments, more={"env": environment(more)}, quiet=False)


@contextmanager
def shell(folder: Path, way: Way, *, line: str) -> Iterator[Way]:
    """A line of shell that ends in ``"$@"``; the command may print, the job is named by its whole path."""
    where = [str(folder / part) if part.startswith("job") else part for part in way.arguments if part != "--quiet"]
    where = [str(folder / part) if part == "truth.toml" else part for part in where]
    yield replace(way, arguments=tuple(where), prefix=("sh", "-c", line, "sh"), quiet=False, heard="2>" not in line)


@contextmanager
def elsewhere(folder: Path, way: Way, *, out: str) -> Iterator[Way]:
    """``--out`` names something that is no folder and cannot be one."""
    (folder / "file").write_bytes(b"not yours\n")
    (folder / "dangling").symlink_to("nowhere/at/all")
    (folder / "loop").symlink_to("loop")
    arguments = list(way.arguments)
    arguments[arguments.index("--out") + 1] = out
    yield replace(way, arguments=tuple(arguments))


def places(command: str, *, mount: bool) -> dict[str, Place]:
    """Every bad place for a command, by what it is."""
    names = [*reference(command, 0), "manifest.json", ".placing"]
    found: dict[str, Place] = {f"a folder stands where {name} goes": partial(in_the_way, name=name) for name in names}
    if mount:
        rooms = (0, 4, 12, 32, 64, 128, 256, 512)
        found |= {f"disk with {room} kB left": partial(small, options=f"size={room}") for room in rooms}
        found |= {f"disk with {room} inodes left": partial(small, options=f"nr_inodes={room}") for room in range(6)}
        found["read-only file system"] = partial(bound, name=".", read_only=True)
        found |= {
            f"{name} cannot be replaced": partial(bound, name=name, read_only=False) for name in reference(command, 0)
        }
    found |= {f"folder with mode {mode:o}": partial(forbidden, mode=mode) for mode in (0o555, 0o000, 0o333, 0o444)}
    found |= {f"files of at most {size} bytes": partial(prefixed, prefix=("prlimit", f"--fsize={size}"))
              for size in (0, 1, 1000, 20_000)}  # fmt: skip
    outs = ("file", "file/below", "dangling", "loop", "/dev/null", "/dev/null/x", "/proc/x", "/dev/full", "", "x" * 300,
            "a\nb", "y/" * 2500)  # fmt: skip
    found |= {f"--out is {out[:20]!r}": partial(elsewhere, out=out) for out in outs}
    lines = {
        "stdout closed": 'exec "$@" >&-', "stdout full": 'exec "$@" >/dev/full', "stderr closed": 'exec "$@" 2>&-',
        "stderr full": 'exec "$@" 2>/dev/full', "both closed": 'exec "$@" >&- 2>&-', "stdin closed": 'exec "$@" <&-',
        "stdout a pipe that nobody reads": '("$@"; echo $? >code) | true; exit $(cat code)',
        "working folder deleted": 'mkdir gone && cd gone && rmdir ../gone && exec "$@"',
        "few open files": 'ulimit -n 24; exec "$@"',
    }  # fmt: skip
    found |= {what: partial(shell, line=line) for what, line in lines.items()}
    odd = {"HOME": "/proc/x", "TMPDIR": "/nowhere", "MPLCONFIGDIR": "/proc/x", "PYTHONIOENCODING": "ascii", "LC_ALL": "C",
           "COLUMNS": "1", "TERM": "\x1b", "TZ": "nowhere", "PYTHONHASHSEED": "7", "OMP_NUM_THREADS": "x"}  # fmt: skip
    return found | {f"{name}={value!r}": partial(environed, more={name: value}) for name, value in odd.items()}


def attempt(command: str, place: Place, folder: Path) -> tuple[Outcome, list[str]]:
    """Run a command in a bad place and then, once that is mended, again; say what does not hold."""
    emptied(folder)
    COMMANDS[command].prepare(folder, version=1)
    put(folder / OUT, reference(command, 0))
    old = frozenset(f"{OUT}/{name}" for name in reference(command, 0))
    with place(folder, Way(COMMANDS[command].arguments())) as way:
        before = snapshot(folder)
        outcome = run(way.arguments, folder, prefix=way.prefix, **way.more)
        found = problems(outcome, quiet=way.quiet) if way.heard or outcome.code not in (2, 3) else []
        after = snapshot(folder)
    found += lost(before, after, own=old)
    found += [
        f"lost without writing anew: {name}"
        for name in old
        if outcome.code not in (0, 3, 4) and before.get(name) != after.get(name)
    ]
    if (
        outcome.code == 3
        and taken_for_a_set(folder / OUT)
        and contents(folder / OUT) not in (reference(command, 0), reference(command, 1))
    ):
        found.append("old and new are taken for a set")
    if outcome.code == 0 and OUT in way.arguments and "gone" not in " ".join(way.prefix):
        found += set_problems(folder / OUT)
    return outcome, found + _again(command, folder, old)


def _again(command: str, folder: Path, old: frozenset[str]) -> list[str]:
    """What is wrong after the place was mended and the command ran once more."""
    if (
        any((folder / name).is_dir() for name in old)
        or (folder / OUT / "manifest.json").is_dir()
        or (folder / OUT / ".placing").is_dir()
    ):
        return []  # the stranger's folder is still in the way
    again = run(COMMANDS[command].arguments(), folder)
    ends = [] if again.code == 0 else [f"the next run ends with {again.code}"]
    return ends + [f"after the next run: {problem}" for problem in (*problems(again), *set_problems(folder / OUT))]
