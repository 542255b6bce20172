"""Hostile files for every command of the program: what each reads, mutated, exchanged or of another kind, by number.

Which commands there are is asked of the program, so that a new one has cases or is counted as never run. Each command line
ends well on the files as they are, so that what is refused is refused for what was altered.
"""

from __future__ import annotations

import datetime as dt
import os
import random
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hostile import cases
from benchmarks.hostile.cases import KINDS, Case
from benchmarks.hostile.mutators import mutate, raw_bytes
from benchmarks.hostile.rows import altered
from benchmarks.hostile.seeds import BUDGETS, EXAMPLES, seeds, small_truth
from benchmarks.hostile.values import WORDS

RECORDS = "reports/records.db"
MADE, PART = "reports/mount", "reports/plate"


@dataclass(frozen=True)
class Line:
    """A command line.

    Parameters
    ----------
    words : as typed, the command first; files are below ``job/``.
    reads : beginnings of the names of the files that it reads; where it reads none, its words are altered.
    ends : exit code of the unaltered run, as it is documented.
    """

    words: str
    reads: tuple[str, ...] = ()
    ends: int = 0

    @property
    def arguments(self) -> tuple[str, ...]:
        """The words, with ``@`` where a file is meant, and ``_`` for a space."""
        place = {"@": "job/", "=": "--records job/" + RECORDS}
        line = " ".join(place.get(word, word.replace("@", "job/")) for word in self.words.split())
        return tuple(word.replace("_", " ") if word.startswith(("ISO", "A.")) else word for word in line.split())

    @property
    def command(self) -> str:
        """Its name."""
        return self.words.split()[0]


JOB, IOTA = ("mount/",), ("iota/job.toml", "iota/ballbar.csv")
OF_PART = tuple(f"{PART}/{name}" for name in ("part-simulated", "results.json", "provenance.json", "manifest.json"))
SET = tuple(f"{MADE}/{name}" for name in ("certificate", "results.json", "provenance.json", "manifest.json"))
LINES = (
    Line("new ballbar new --from @iota/ballbar.csv --machine M --set job.date=2026-05-31", ("iota/ballbar.csv",)),
    Line("new part new --set part.name=P"),
    Line("import @iota/ballbar.csv", ("iota/ballbar.csv",)), Line("import @exports/plate.txt", ("exports/plate.txt",)),
    Line("import @exports/bar.txt", ("exports/bar.txt",)), Line("check @mount", JOB), Line("check @part", ("part/",)),
    Line("report @mount --out out --records none", JOB), Line("report @iota --out out --records none", ("iota/",)),
    Line("report @mount --out out --records @reports/records.db", (RECORDS,)),
    Line("report @mount --out out --records none --sign @key.p12", ("key.p12",)),
    Line("report --scheduled @mount --schedule @schedule.toml --quiet", ("schedule.toml", "mount/")),
    Line("part @part --trials 1000 --out out --records none", ("part/",)),
    Line(f"verify @{PART} --no-rerun --records @{RECORDS}", (*OF_PART, RECORDS), 3),
    Line(f"records verify = --witness @{PART}", (*OF_PART, RECORDS)), Line(f"records import @{PART} =", OF_PART),
    Line("release P-2026-05-31 --by A._Huber =", (RECORDS,)),
    Line("batch @mount --out out --records none --workers 1", JOB),
    Line("diagnose @iota --out out --records none", IOTA), Line("effects wave --job @own", ("own/job.toml",)),
    Line("check @own", ("own/job.toml",)), Line("plan @plan --out out --no-power", ("plan/",)),
    Line("prove @iota --cases 1 --out out", IOTA),
    Line("history 77 = --out out", (RECORDS,)), Line("due =", (RECORDS,)), Line("fleet = --out out", (RECORDS,)),
    Line("acquire @live --plain", ("live/",)), Line("acquire @live --plain --skip-damaged", ("live/acquisition/",)),
    Line("acquire @trial --simulate --out out --plain", ("trial/",)),
    Line("simulate @iota --truth @truth.toml --out out", ("truth.toml", *IOTA)),
    Line("compensate @iota --out out", ("iota/",)),
    Line("compensate @digitizer --cloud @cloud.csv --out out", ("cloud.csv", "digitizer/")),
    Line("budget @budget.toml --out out", ("budget.toml",)),
    Line(f"verify @{MADE} --no-rerun", SET, 3),  # without computing again pages are not checked
    Line(f"verify @{MADE} --no-rerun --records @{RECORDS}", (RECORDS,), 3),
    Line("verify @signed/certificate.pdf --no-rerun --trust @key.pem", ("key.pem", "signed/"), 1),  # a test key
    Line(f"verify @{MADE}", SET),
    Line("release K-1 --by A._Huber =", (RECORDS,)), Line(f"qif @{MADE}/results.json --out out.qif", (SET[1],)),
    Line(f"read @{MADE}/certificate.xml", (f"{MADE}/certificate.xml",)),
    Line(f"sign @{MADE}/certificate.pdf @{MADE}/certificate.xml --key @key.p12 --out out --records none",
         (f"{MADE}/certificate.pdf", f"{MADE}/certificate.xml", "key.p12")),
    Line("affected --version 0.3.0 --list =", (RECORDS,)), Line("serve = --port 0", (RECORDS, MADE)),
    Line("desk @live --no-open", ("live/job.toml",)),
    Line("standards ISO_10360-2:2009 --form form.toml"), Line("schema job"), Line("selftest --quiet"),
    Line("instruments test @profile.toml file:job/log.txt --seconds 0.1", ("profile.toml", "log.txt")),
    Line("instruments test table --job @live --seconds 0.1", ("live/job.toml", "live/own.toml", "live/log.txt")),
    Line("instruments new gauge.toml --line T=20.13_C<CR><LF> --quantity temp_c=1"),
    Line("schedule print cron @mount --schedule @schedule.toml", ("schedule.toml",)), Line("keys new new.p12 --name X"),
    Line("records verify =", (RECORDS, MADE)), Line(f"records verify = --witness @{MADE}", (SET[1], SET[2], SET[3])),
    Line(f"records import @{MADE} =", SET), Line("records head =", (RECORDS,)),
    Line("records backup backup.db =", (RECORDS,)), Line(f"records restore @{RECORDS} --records new.db", (RECORDS,)),
)  # fmt: skip
"""Command lines on the files of :func:`files`: every kind of file that a command reads is read by one."""
DEAR = ("part", "batch", "prove", "diagnose", "report", "plan", "fleet", "acquire")
"""Commands that take seconds: tests run each unaltered, and the study alone runs them altered."""
CODES = {"verify": (1, 3), "report": (1,)}
"""Exit codes beside those of every command, as each documents them."""
OWN = {"sign": ("reports/",), "release": ("reports/",), "acquire": ("live/",)}
"""What a command may change, since it is its own to write."""
HELD = "CMM_UQ_HOSTILE_FILES"
"""Variable of the environment that names the archive of the files, where there is one."""
LIVE = """
[[acquire.source]]
name = "table"
profile = "own.toml"
port = "file:log.txt"
values = { value1 = "temp_artefact_c" }
"""
OWN_PHYSICS = b"""
[[effect]]
name = "wave"
formula = ["e_x = k*sin(2*pi*y/250)", "e_z = l*abs(x - 100)**1.5*exp(-y/tau)"]
[effect.parameters]
k = { unit = "um", prior = 5.0 }
l = { unit = "um/m", prior = 1.0 }
tau = { unit = "mm", low = 20.0, high = 500.0 }
"""


def commands() -> list[str]:
    """Every command, as the program has them."""
    from typer.main import get_command

    from cmm_uq.app.cli.commands import app

    top: Any = get_command(app)
    return sorted(name for name in top.commands)


def keep(path: Path) -> None:
    """Put the files where :func:`files` of another process finds them: they take seconds to make."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files().items():
            archive.writestr(name, content)
    os.environ[HELD] = str(path)


@cache
def files() -> Mapping[str, bytes]:
    """Those that another process keeps, else those made here."""
    if HELD not in os.environ:
        return _made()
    with zipfile.ZipFile(os.environ[HELD]) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _made() -> Mapping[str, bytes]:
    """Jobs, what a report of one made, records of it, a session of points, and whatever else a command reads; made once."""
    from cmm_uq.app.commands.laboratory.acquire import begin_acquisition
    from cmm_uq.certificate.sign import trial_key
    from tests.app.cli.laboratory import reported
    from tests.app.cli.process import run
    from tests.app.commands.test_compensate_cloud import square
    from tests.laboratory.live.session import job_folder
    from tests.shared import files_below

    profile = next((Path(__file__).parents[2] / "cmm_uq").rglob("line-logger.toml")).read_bytes()
    key = trial_key("A. Huber", "open", dt.datetime.now(dt.UTC) - dt.timedelta(days=1))
    os.environ["CMM_UQ_SIGN_PASSPHRASE"] = "open"
    with tempfile.TemporaryDirectory() as place:
        folder = reported(Path(place))
        (folder / "job").rename(folder / "mount")
        (folder / "live").mkdir()
        for name, content in (("own.toml", profile), ("log.txt", b"20.01, 20.02; 12.0\r\n" * 20)):
            (folder / "live" / name).write_bytes(content)
        job_folder(folder / "live", LIVE)
        session = begin_acquisition(folder / "live")
        for line in ("100 100 -300", "600.001 100 -300", "note cold"):
            session.conductor.line(line)
        session.conductor.finish()
        session.journals.close()
        for source in session.sources:
            source.close()
        job_folder(folder / "trial")
        for name, source in (("part", "part-plate-simulated"), ("plan", "plan-ballbar")):
            shutil.copytree(EXAMPLES / source, folder / name)
        (folder / "key.p12").write_bytes(key.key)
        _report_part(folder)
        signed = run("sign", *(folder / MADE / f"certificate.{form}" for form in ("pdf", "xml")), "--key", folder / "key.p12",
                     "--out", folder / "signed", "--records", "none")  # fmt: skip
        assert signed.returncode == 0, signed.stderr
        square(folder)
        (folder / "job").rename(folder / "digitizer")
        made = files_below(folder)
    made |= {f"iota/{name}": content for name, content in seeds()["compensable"].files.items()}
    exports = Path(__file__).parents[2] / "tests" / "jobs" / "importing"  # of other programs
    for name, source in (
        ("plate", "development_exports/D05_PCDMIS_ballplate"),
        ("bar", "further_exports/S16_BALLBAR_VERIFICATION"),
    ):
        made[f"exports/{name}.txt"] = (exports / f"{source}.txt").read_bytes()
    made |= {name.replace("iota/", "own/", 1): content for name, content in made.items() if name.startswith("iota/")}
    made["own/job.toml"] += OWN_PHYSICS
    rows = b"".join(b"%d,%d,%d,%d,-%d\n" % (i, -i, 100 + i, 150 + 2 * i, 200 + i) for i in range(30))
    return made | {
        "truth.toml": small_truth(), "budget.toml": BUDGETS["sum"], "key.pem": key.certificate,
        "profile.toml": profile, "log.txt": b"20.01, 20.02; 12.0\r\n" * 20, "cloud.csv": b"u_mm,v_mm,d_mm,e_mm,f_mm\n" + rows,
        "schedule.toml": b'[run]\nout = "reports"\nrecords = "none"\nquiet_s = 0.0\n',
    }  # fmt: skip


def _report_part(folder: Path) -> None:
    """A part's report in the records, and the entry of one that the machine 77 measured."""
    import pytest

    from cmm_uq.app.commands.parts.part import PartOptions, write_part
    from cmm_uq.laboratory.records import open_records
    from tests.laboratory.records.test_parts import part
    from tests.part_machines import THERE, by_results, plate_files
    from tests.part_reports import nothing_foreseen
    from tests.shared import put

    with open_records(folder / RECORDS) as records:
        records.append_all([(*part(dt.date(2026, 5, 31), "77", "Optical digitizer")[:2], None)])
    put(folder / "plate", plate_files(by_results(), np.zeros((60, 3)), **THERE))
    with pytest.MonkeyPatch.context() as patched:
        nothing_foreseen(patched)  # no command reads it again
        write_part(folder / "plate", folder / PART, options=PartOptions(trials=1000), records=folder / RECORDS)


def unaltered(number: int) -> Case:
    """A command line on the files as they are."""
    line = LINES[number]
    return Case(number, line.command, line.words, dict(files()), (), line.arguments)


def case(seed: int, number: int) -> Case:
    """The case of this number: command lines in turn, each with one of its files, or its words, altered."""
    random_ = random.Random(f"commands:{seed}:{number}")
    line = LINES[number % len(LINES)]
    held, arguments = dict(files()), list(line.arguments)
    odd: dict[str, str] = {}
    roll = random_.random()
    names = [one for one in sorted(held) if one.startswith(line.reads)] if line.reads else []
    name = random_.choice(names) if names else ""
    if not names:
        place, word = random_.randrange(1, len(arguments)), random_.choice(WORDS)
        arguments[place : place + random_.randrange(2)] = [word.replace("\0", "")]
        what = f"word {place} is {word[:60]!r}"
    elif roll < 0.12:
        odd = {name: random_.choice(KINDS)}
        what = f"{name} is a {odd[name]}"
    elif roll < 0.24:
        other = random_.choice(sorted(held))
        held[name], what = held[other], f"{name} is {other}"
    elif name == RECORDS and roll < 0.85:
        held[name], what = altered(held[name], random_)
    elif name.endswith((".toml", ".csv")):
        like = next(content for other, content in held.items() if Path(other).suffix == Path(name).suffix)
        how, held[name] = mutate(Path(name).name, held[name], like, random_)
        what = f"{how} of {name}"
    else:
        held[name], what = raw_bytes(held[name], held[SET[1]], random_), f"raw_bytes of {name}"
    return Case(number, line.command, f"{line.words}: {what}", held, (), tuple(arguments), odd)


def lay_out(case: Case, folder: Path) -> None:
    """As :func:`benchmarks.hostile.cases.lay_out`, with folders; records are found where their reports lie."""
    for name in case.files:
        (folder / "job" / name).parent.mkdir(parents=True, exist_ok=True)
    os.environ["CMM_UQ_SIGN_PASSPHRASE"] = "open"
    cases.lay_out(case, folder, exist_ok=True)
