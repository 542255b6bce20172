"""Hostile files for every command of the program: what each reads, mutated, exchanged or of another kind, by number.

Which commands there are is asked of the program, so that a new one has cases or is counted as never run.
"""

from __future__ import annotations

import os
import random
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.hostile.cases import KINDS, Case
from benchmarks.hostile.mutators import mutate, raw_bytes
from benchmarks.hostile.seeds import EXAMPLES, NOTES, small_truth

JOB, PART = "iota-1102-20C", "part-plate-simulated"
OUT = ("--out", "out", "--records", "none")
OF_RECORDS = ("--records", "job/records.db")
ARGUMENTS: dict[str, tuple[str, ...]] = {
    "new": ("new", "ballbar", "job"), "import": ("import", "job/ballbar.csv"), "check": ("check", "job"),
    "report": ("report", "job", *OUT),
    "part": ("part", "job/part", "--trials", "1000", *OUT),
    "batch": ("batch", "job", "--out", "out", "--records", "none"),
    "diagnose": ("diagnose", "job", "--out", "out", "--records", "none"),
    "plan": ("plan", "job", "--out", "out", "--no-power"),
    "prove": ("prove", "job", "--cases", "1", "--out", "out"),
    "history": ("history", "DEA Iota 1102", *OF_RECORDS, "--out", "out"),
    "due": ("due", *OF_RECORDS), "acquire": ("acquire", "job"),
    "simulate": ("simulate", "job", "--truth", "job/truth.toml", "--out", "out"),
    "compensate": ("compensate", "job", "--out", "out"),
    "fleet": ("fleet", *OF_RECORDS, "--out", "out"), "budget": ("budget", "job/budget.toml", "--out", "out"),
    "verify": ("verify", "job/made", "--no-rerun"),
    "release": ("release", JOB, "--by", "A. Huber", "--despite", "tried", *OF_RECORDS),
    "qif": ("qif", "job/made/results.json", "--out", "out"), "read": ("read", "job/made/certificate.xml"),
    "sign": ("sign", "job/made/certificate.pdf", "job/made/certificate.xml", "--key", "job/key.p12", "--records", "none"),
    "affected": ("affected", "--version", "0.3.0", "--list", *OF_RECORDS), "serve": ("serve", *OF_RECORDS, "--port", "-1"),
    "standards": ("standards", "job/job.toml"),
    "schema": ("schema", "job/job.toml"), "selftest": ("selftest", "job/job.toml"),
    "instruments": ("instruments", "test", "job/profile.toml", "job/job.toml", "--seconds", "0.1"),
    "schedule": ("schedule", "print", "cron", "job"), "keys": ("keys", "new", "job/key.p12"),
    "records": ("records", "verify", *OF_RECORDS),
}  # fmt: skip
"""A command line for each command, on the files of :func:`files`."""

READ: dict[str, tuple[str, ...]] = {
    "part": ("part/",), "history": ("records.db",), "due": ("records.db",), "fleet": ("records.db",),
    "records": ("records.db",),
    "release": ("records.db",), "affected": ("records.db",), "serve": ("records.db",),
    "verify": ("made/",),
    "qif": ("made/results.json",),
    "read": ("made/certificate.xml",), "sign": ("made/certificate.pdf", "made/certificate.xml", "key.p12"),
    "budget": ("budget.toml",),
    "simulate": ("truth.toml", "job.toml", "ballbar.csv"), "schedule": ("schedule.toml",), "instruments": ("profile.toml",),
    "keys": ("key.p12",),
}  # fmt: skip
"""What of the files a command reads, where that is not the job."""
CODES = {"verify": (1,), "records": (1,), "selftest": (1,)}
"""Exit codes beside those of every command, as each documents them."""


def commands() -> list[str]:
    """Every command, as the program has them."""
    from typer.main import get_command

    from cmm_uq.app.cli.commands import app

    top: Any = get_command(app)
    return sorted(name for name in top.commands)


@cache
def files() -> dict[str, bytes]:
    """A job, what a report of it made, records of it, a part's job, and whatever else a command reads; made once."""
    import tempfile

    from cmm_uq.app.commands.report import write_report
    from cmm_uq.certificate.sign import trial_key
    from tests.certificate.sign.authority import SIGNED

    job = {path.name: path.read_bytes() for path in sorted((EXAMPLES / JOB).iterdir()) if path.is_file()}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_report(EXAMPLES / JOB, folder / "made", records=folder / "records.db")
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                job[path.relative_to(folder).as_posix()] = path.read_bytes()
    for path in sorted((EXAMPLES / PART).rglob("*")):
        if path.is_file():
            job[f"part/{path.relative_to(EXAMPLES / PART).as_posix()}"] = path.read_bytes()
    profile = sorted((Path(__file__).parents[2] / "cmm_uq").rglob("profiles/*.toml"))[0]
    from benchmarks.hostile.seeds import BUDGETS

    return job | {
        "truth.toml": small_truth(), "budget.toml": BUDGETS["sum"], "key.p12": trial_key("A. Huber", "open", SIGNED).key,
        "profile.toml": profile.read_bytes(), "schedule.toml": b'[[watch]]\nfolder = "job"\n', NOTES: b"mine\n",
    }  # fmt: skip


def case(seed: int, number: int) -> Case:
    """The case of this number: commands in turn, each with one of its files altered."""
    random_ = random.Random(f"commands:{seed}:{number}")
    names = sorted(ARGUMENTS)
    command = names[number % len(names)]
    held = dict(files())
    read = READ.get(command, ("job.toml", "ballbar.csv"))
    name = random_.choice([one for one in sorted(held) if one.startswith(read)])
    odd: dict[str, str] = {}
    roll = random_.random()
    if roll < 0.15:
        odd = {name: random_.choice(KINDS)}
        what = f"{name} is a {odd[name]}"
    elif roll < 0.3:
        other = random_.choice(sorted(held))
        held[name], what = held[other], f"{name} is {other}"
    elif name.endswith((".toml", ".csv")):
        how, held[name] = mutate(Path(name).name, held[name], held["job.toml"], random_)
        what = f"{how} of {name}"
    else:
        held[name], what = raw_bytes(held[name], held["made/results.json"], random_), f"raw_bytes of {name}"
    return Case(number, command, f"{command}: {what}", held, (), ARGUMENTS[command], odd)


def lay_out(case: Case, folder: Path) -> None:
    """As :func:`benchmarks.hostile.cases.lay_out`, with folders."""
    from benchmarks.hostile import cases

    for name in case.files:
        (folder / "job" / name).parent.mkdir(parents=True, exist_ok=True)
    os.environ["CMM_UQ_SIGN_PASSPHRASE"] = "open"
    cases.lay_out(case, folder, exist_ok=True)
