"""Folders and files of another user, or closed to this one: ``python -m benchmarks.hostile.other_user [--only COMMAND]``.

Commands run as a user to whom nothing else belongs, which root alone can begin. Each runs once in folders of its own, and then
with each of the folders that it reads or writes in each state of :data:`STATES`.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.hostile.invariants import Outcome, problems, snapshot
from benchmarks.hostile.processes import PROGRAM, environment, memory, run
from benchmarks.hostile.programs import STARTED
from benchmarks.hostile.seeds import BUDGETS, seeds, small_truth
from benchmarks.hostile.warm import Warm

NOBODY = 65534
PERSON = {"user": NOBODY, "group": NOBODY, "extra_groups": ()}
OTHER, OWN = 0, NOBODY
Runner = Callable[[Sequence[str], Path, tuple[int, float] | None, Mapping[str, str]], Outcome]


@dataclass(frozen=True)
class State:
    """Whose a folder and its files are, and what their modes are.

    Parameters
    ----------
    folder, files : owner and mode of the folder, and of each file and folder below it.
    """

    folder: tuple[int, int]
    files: tuple[int, int]


STATES: Mapping[str, State] = {
    "another user's, 0700": State((OTHER, 0o700), (OTHER, 0o600)),
    "another user's, 0500": State((OTHER, 0o500), (OTHER, 0o400)),
    "another user's, 0755": State((OTHER, 0o755), (OTHER, 0o644)),
    "another user's, 0711": State((OTHER, 0o711), (OTHER, 0o644)),
    "another user's, 0744": State((OTHER, 0o744), (OTHER, 0o644)),
    "another user's, 1777, with another's files": State((OTHER, 0o1777), (OTHER, 0o644)),
    "one's own, 0500": State((OWN, 0o500), (OWN, 0o400)),
    "one's own, 0400": State((OWN, 0o400), (OWN, 0o400)),
    "one's own, 0300": State((OWN, 0o300), (OWN, 0o600)),
    "one's own, with another's files, 0644": State((OWN, 0o755), (OTHER, 0o644)),
    "one's own, with another's files, 0600": State((OWN, 0o755), (OTHER, 0o600)),
}


@dataclass(frozen=True)
class Line:
    """A command line on the folders of :func:`laboratory`.

    Parameters
    ----------
    words : as typed, the command first.
    folders : that it reads or writes.
    ends : exit code in folders of its own.
    own : beginnings of the names of what it may replace there.
    """

    words: str
    folders: tuple[str, ...]
    ends: int = 0
    own: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        return self.words.split()[0]


_OF = "--records reports/records.db"
_RECORDS = "reports/records.db"
LINES = (
    Line("new ballbar out/new --machine M --set job.date=2026-05-31", ("out",)),
    Line("import iota/ballbar.csv", ("iota",)),
    Line("check job", ("job",)),
    Line("effects thermal --job job", ("job",)),
    Line(f"report job --out reports/mount {_OF}", ("job", "reports", "reports/mount"), 0, ("reports",)),
    Line("report job --out out/new --records none", ("out",)),
    Line("part part --trials 1000 --out out --records none", ("part", "out")),
    Line("batch job --out out --records none --workers 1", ("job", "out")),
    Line("diagnose job --out out --records none", ("job", "out")),
    Line("plan job --out out --no-power", ("job", "out")),
    Line("prove iota --cases 1 --out out", ("iota", "out")),
    Line(f"history 77 {_OF} --out out", ("reports", "out")),
    Line(f"due {_OF}", ("reports",)),
    Line(f"fleet {_OF} --out out", ("reports", "out")),
    Line("acquire live --plain", ("live", "live/acquisition"), 0, ("live",)),
    Line("simulate iota --truth truth/truth.toml --out out", ("iota", "truth", "out")),
    Line("compensate iota --out out", ("iota", "out")),
    Line("budget truth/budget.toml --out out", ("truth", "out")),
    Line("verify reports/mount --no-rerun", ("reports/mount",), 3),
    Line(f"release K-1 --by A.Huber {_OF}", ("reports",), 0, (_RECORDS,)),
    Line("qif reports/mount/results.json --out out/results.qif", ("reports/mount", "out")),
    Line("read reports/mount/certificate.xml", ("reports/mount",)),
    Line("sign reports/mount/certificate.pdf reports/mount/certificate.xml --key keys/key.p12 --out out --records none",
         ("reports/mount", "keys", "out")),
    Line(f"affected --version 0.3.0 --list {_OF}", ("reports",)),
    Line(f"serve {_OF} --port 0", ("reports",), 143),
    Line("desk job --no-open", ("job",), 143),
    Line("standards ISO_10360-2:2009 --form out/form.toml", ("out",)),
    Line("schema job", ()),
    Line("selftest --json", ()),
    Line("instruments new out/gauge.toml --line T=20.13_C<CR><LF> --quantity temp_c=1", ("out",)),
    Line("schedule print cron job --schedule truth/schedule.toml", ("truth",)),
    Line("report --scheduled job --schedule truth/schedule.toml --quiet", ("job", "truth", "out"), 0, ("out/.scheduled",)),
    Line("keys new keys/new.p12 --name X", ("keys",)),
    Line(f"records verify {_OF}", ("reports",)),
    Line(f"records head {_OF}", ("reports",)),
    Line(f"records backup out/backup.db {_OF}", ("reports", "out")),
    Line("records import reports/mount --records out/new.db", ("reports/mount", "out")),
    Line(f"records restore {_RECORDS} --records out/new.db", ("reports", "out")),
)  # fmt: skip
CODES = {"verify": (1, 3), "records": (1,), "serve": (143,), "desk": (143,), "report": (1,)}
"""Exit codes beside those of every command, as each documents them."""
TOLD_ON_OUTPUT = ("check", "batch", "records", "verify", "report")
"""Commands that say on standard output what is wrong."""
ABOUT = ("ermi", "readable", "writable")
"""Words by which a refusal says what it is about: permission, permissions, permitted."""
SECONDS_OF_SERVER = 8.0


def available() -> bool:
    """Whether this user may become another one, who may read the package."""
    if os.name == "nt" or os.geteuid() != 0:
        return False
    try:
        done = subprocess.run(
            [*PROGRAM, "--version"], cwd="/", env=environment(), check=False, capture_output=True, **PERSON
        )
    except OSError:
        return False
    return done.returncode == 0


@cache
def laboratory() -> Mapping[str, bytes]:
    """Jobs, a report and records of it, a key, and whatever else is read; made once."""
    from cmm_uq.certificate.sign import trial_key
    from tests.app.cli.laboratory import reported
    from tests.certificate.sign.authority import SIGNED
    from tests.conftest import ROOT
    from tests.laboratory.live.session import job_folder

    with tempfile.TemporaryDirectory(dir=memory()) as place:
        folder = reported(Path(place))
        job_folder(folder / "live")
        made = contents(folder)
    part = contents(ROOT / "examples" / "part-plate-simulated")
    made |= {f"part/{name}": content for name, content in part.items()}
    made |= {f"iota/{name}": content for name, content in seeds()["compensable"].files.items()}
    schedule = b'[run]\nout = "../out"\nrecords = "none"\nquiet_s = 0.0\n'
    return made | {
        "truth/truth.toml": small_truth(), "truth/budget.toml": BUDGETS["sum"], "truth/schedule.toml": schedule,
        "keys/key.p12": trial_key("A. Huber", "open", SIGNED).key, "out/notes.txt": b"mine\n",
        "live/acquisition/notes.txt": b"mine\n",
    }  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def laid_out(folder: Path) -> Path:
    """The laboratory, all of it this person's."""
    for place in (folder.parent / "home", folder):
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
    _give(folder.parent / "home", State((OWN, 0o700), (OWN, 0o600)))  # of caches of other packages
    for name, content in laboratory().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    _give(folder, State((OWN, 0o755), (OWN, 0o644)))
    return folder


def _give(folder: Path, state: State) -> None:
    """A folder and everything in it get the owner and the mode; who may open a file's folder may open those below it."""
    for path in (*folder.rglob("*"), folder):
        owner, mode = state.folder if path.is_dir() else state.files
        os.chown(path, owner, owner)
        path.chmod(mode)


def as_other(words: Sequence[str], folder: Path, kill: tuple[int, float] | None, more: Mapping[str, str]) -> Outcome:
    """Run a command as the person, in a process of its own."""
    return run(words, folder, kill=kill, env=environment(more), **PERSON)


def attempt(line: Line, place: str, state: str, folder: Path, run_as: Runner = as_other) -> tuple[Outcome, list[str]]:
    """Run a command with one of its folders in a state; say what does not hold."""
    laid_out(folder)
    if place:
        _give(folder / place, STATES[state])
    before, rights, recorded = snapshot(folder), _rights(folder), _dumped(folder / _RECORDS)
    kill = (signal.SIGTERM, SECONDS_OF_SERVER) if line.command in ("serve", "desk") else None
    words = [word.replace("_", " ") if word.startswith(("ISO", "T=")) else word for word in line.words.split()]
    more = {"CMM_UQ_SIGN_PASSPHRASE": "open", "HOME": str(folder.parent / "home")}
    outcome = run_as(words, folder, kill, more)
    after = snapshot(folder)
    if recorded == _dumped(folder / _RECORDS):  # whatever was announced in them was taken back
        after[_RECORDS] = before[_RECORDS]
    return outcome, _problems(line, place, outcome, before, after) + _changed(rights, _rights(folder))


def _dumped(records: Path) -> list[str]:
    """All that a database holds, as SQL."""
    if not records.is_file():
        return []
    with contextlib.closing(sqlite3.connect(records)) as connection:
        return list(connection.iterdump())


def _rights(folder: Path) -> dict[str, tuple[int, int]]:
    found = {path.relative_to(folder).as_posix(): path.lstat() for path in folder.rglob("*")}
    return {name: (status.st_uid, status.st_mode) for name, status in found.items()}


def _changed(before: Mapping[str, tuple[int, int]], after: Mapping[str, tuple[int, int]]) -> list[str]:
    """Folders of another user, or closed ones, stay as they were; a file of one's own may have been written anew."""
    wrong = [name for name, right in before.items() if name in after and after[name] != right and right[1] & 0o40000]
    return [f"owner or mode of a folder is changed: {name}" for name in wrong]


def _problems(
    line: Line, place: str, outcome: Outcome, before: Mapping[str, str], after: Mapping[str, str]
) -> list[str]:
    code, said = outcome.code, outcome.stderr
    allowed = code in CODES.get(line.command, ()) or (line.command in TOLD_ON_OUTPUT and code == 2 and outcome.stdout)
    faults = "Traceback" in said or "a fault of the program" in said
    found = [] if allowed and not faults else problems(outcome, quiet=False)
    if not place and code != line.ends:
        found.append(f"ends with {code} in folders of its own")
    elif place and code in (2, 3) and not allowed and not any(word in said + outcome.stdout for word in ABOUT):
        found.append(f"refused without a word of permissions: {said.strip()[-160:]}")
    elif place and code in (2, 3) and not allowed and place.split("/")[0] not in said + outcome.stdout:
        found.append(f"another place is named: {said.strip()[-160:]}")
    gone = [name for name, seal in before.items() if after.get(name) != seal]
    found += [f"lost: {name}" for name in gone if not (line.own and name.startswith(line.own) and code not in (2, 3))]
    new = [name for name in after if name not in before and not name.endswith(("-wal", "-shm", ".lock"))
           and not (line.own and name.startswith(line.own))]  # fmt: skip
    if code in (2, 3) and not allowed and new:
        found.append(f"something is written though refused: {new[0]}")
    return found + [f"left over: {name}" for name in after if "/.unfinished-" in name or "/.placing" in name]


def forked(warm: Warm) -> Runner:
    """The same by a process that is forked from one that has imported everything."""

    def run_as(words: Sequence[str], folder: Path, kill: tuple[int, float] | None, more: Mapping[str, str]) -> Outcome:
        return warm.run(words, folder, kill=kill, environment=more)

    return run_as


def cases() -> Iterator[tuple[Line, str, str]]:
    """Each line in folders of its own, and with each of its folders in each state."""
    for line in LINES:
        yield line, "", ""
        yield from ((line, place, state) for place in line.folders for state in STATES)


def main() -> int:
    """Run the cases and say what does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", metavar="COMMAND", action="append")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    if not available():
        print("needs root, and a package that every user may read", file=sys.stderr)
        return 2
    ended: Counter[tuple[str, int | None]] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="hostile-", dir=memory()) as work, Warm(NOBODY) as warm:
        Path(work).chmod(0o755)
        for number, (line, place, state) in enumerate(cases()):
            if options.only and line.command not in options.only:
                continue
            outcome, found = attempt(
                line, place, state, Path(work) / "laboratory", forked(warm) if number % STARTED else as_other
            )
            ended[line.command, outcome.code] += 1
            wrong += bool(found)
            if found or options.verbose:
                print(
                    f"{line.words}; {place or 'nothing'} {state}: {outcome.code} {found} {outcome.stderr[-300:]!r}",
                    flush=True,
                )
    for command in dict.fromkeys(line.command for line in LINES):
        print(command, {code: count for (name, code), count in ended.items() if name == command})
    print(f"{ended.total()} cases, {wrong} with a violation")
    return int(bool(wrong) or not ended)


if __name__ == "__main__":
    sys.exit(main())
