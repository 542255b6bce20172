"""Runs along axes, damaged: ``python -m benchmarks.hostile.runs [COUNT] [SEED] [ONE]``.

Each case damages an ``.rtl`` or a CSV of runs and takes it through ``import`` (of an ``.rtl``), ``check`` and, of one in ten
that is accepted, ``report``: no traceback, no hang, a refusal in one line with its remedy. What is accepted reads as the file
says by a second reader below, and where nobody could take it for right it is refused. ``ONE`` repeats a case by its number.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.hostile.invariants import Outcome, problems
from benchmarks.hostile.mutators import dressed, lines_changed, raw_bytes
from benchmarks.hostile.table_mutators import cells, columns, rows_changed
from benchmarks.hostile.values import NUMBERS
from benchmarks.hostile.worker import Runner

SECONDS, REPORTED = 60, 1  # s of computing; of ten numbers, those of which what is accepted is reported
JOB = """[job]
id = "runs"
date = 2026-01-01
[machine]
name = "damaged"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
[artefact]
kind = "axis_runs"
u_scale_um_per_m = 0.3
[recording]
file = "{file}"
{more}
[test_uncertainty]
u_alignment_um = 0.2
u_repeat_um = 0.1
[model]
effects = ["scale_x", "hysteresis_x"]
[[conformity]]
standard = "ISO 230-2:2014"
characteristic = "A"
limit_um = 20.0
rule = "ISO 14253-1"
"""
LINE = "along X from 0,200,-300"
COLUMNS = [
    "measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", "reading_um", "reading_arcsec", "read_x", "read_y", "read_z",
    "turn_x", "turn_y", "turn_z", "approach_x", "approach_y", "approach_z",
]  # fmt: skip
TARGETS = np.linspace(50.0, 850.0, 9)


class Damaged(NamedTuple):
    """A file; whether it must be refused, may be read as it was, reads as it says, or anything but a fault will do."""

    content: bytes
    expected: str


# ---------------------------------------------------------------- what is damaged


def runs(random_: random.Random, repeats: int = 3) -> list[tuple[float, list[float]]]:
    """Sense and deviations, µm, of each run in turn there and back."""
    scale, gap = random_.gauss(0, 10), random_.gauss(0, 3)
    curve = [scale * t / 1000 + 4 * np.sin(t / 120) for t in TARGETS]
    return [
        (way, [float(c + 0.5 * way * gap + random_.gauss(0, 0.3)) for c in curve])
        for _ in range(repeats) for way in (1.0, -1.0)
    ]  # fmt: skip


class Rtl:
    """A file of runs before it is written."""

    def __init__(self, random_: random.Random) -> None:
        self.runs = runs(random_)
        self.targets = [f"{t:.3f}" for t in TARGETS]
        self.rows = [
            [(n, k + 1, f"{values[k]:.3f}") for k in (range(9) if way > 0 else range(8, -1, -1))]
            for n, (way, values) in enumerate(self.runs, 1)
        ]
        self.counts, self.owner = (9, len(self.runs)), "Linear"

    def bytes(self) -> bytes:
        targets = [" ".join(self.targets[i : i + 5]) + " " for i in range(0, len(self.targets), 5)]
        rows = [f"{n:5d}{k:5d}   {value}" for run in self.rows for n, k, value in run]
        return "\r\n".join([
            "HEADER::", "File type  : rtl", f"Owner      : {self.owner}", "Version no : V20.02.02", "", "TARGET DATA::",
            "Filetype  : ISO", f"Target-count: {self.counts[0]}", "Targets :", *targets, "Flags:", "", "USER-TEXT::",
            "Machine: Bridge", "Serial No: 12", "Date: 10:12 2026-01-02", "Axis: X", "RUNS::", f"Run-count: {self.counts[1]}",
            "", "DEVIATIONS::", "Run Target Data:", *rows, "EQUIPMENT::", "ENVIRONMENT::", "EOF::", "",
        ]).encode()  # fmt: skip


def csv_rows(random_: random.Random) -> list[list[str]]:
    """Position and straightness along X, a rotation twice on one line: 4 runs there and back, three times."""
    rows = [list(COLUMNS)]
    tilt = [2 * np.sin(t / 150) + 3 * t / 1000 for t in TARGETS]
    for number, sense in enumerate((0, 1, 2, 2), 1):
        for i, (way, values) in enumerate(runs(random_)):
            every = values if number < 3 else [t + random_.gauss(0, 0.05) for t in tilt]
            for k in range(9) if way > 0 else range(8, -1, -1):
                row = dict.fromkeys(COLUMNS, "0")
                row |= {
                    "measurement": str(number),
                    "point": str(k + 1 if way > 0 else 18 - k),
                    "repeat": str(i // 2 + 1),
                }
                row |= {"x_mm": f"{TARGETS[k]:.3f}", "y_mm": "200.0", "z_mm": "-300.0", "approach_x": f"{way:g}"}
                row["reading_um" if number < 3 else "reading_arcsec"] = f"{every[k]:.3f}"
                row[f"{'read' if number < 3 else 'turn'}_{'xyz'[sense]}"] = "1"
                rows.append([row[name] for name in COLUMNS])
    return rows


def written(rows: list[list[str]]) -> bytes:
    return "".join(",".join(row) + "\n" for row in rows).encode()


# ---------------------------------------------------------------- damage


def _odd(random_: random.Random) -> str:
    more = ("1,5", "12 3", "1.2.3", "--1", "1e", "１２", "٣.٥", "1\x000", "3\x1b", "µ", "12µm", "0.001mm")
    return random_.choice((*NUMBERS, *more))


def _plain(text: str) -> bool:
    return bool(re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", text, re.ASCII))


def _says(text: str, most: float) -> str:
    return "says" if _plain(text) and abs(float(text)) <= most else "refused"


def _cut(content: bytes, random_: random.Random) -> Damaged:
    return Damaged(content[: random_.randrange(len(content))], "same")


def _marked(content: bytes, random_: random.Random) -> Damaged:
    text, marks = (
        content.decode(),
        ("\0", "\x1b[2J", "\x0b", "\x0c", "\x1c", "\x85", "\u2028", "\u202e", "\ufeff", "\x7f", "\x08"),
    )
    at = random_.randrange(len(text))
    return Damaged((text[:at] + random_.choice(marks) + text[at:]).encode(), "same")


def _reversed(rows: list[tuple[int, int, str]], factor: float = -1.0) -> list[tuple[int, int, str]]:
    return [(n, k, f"{factor * float(value):.3f}") for n, k, value in rows]


def rtl_count(file: Rtl, random_: random.Random) -> Damaged:
    more = random_.choice((-8, -1, 1, 100, 10**9))
    file.counts = random_.choice(((9 + more, 6), (9, 6 + more)))
    return Damaged(file.bytes(), "refused")


def rtl_comma(file: Rtl, random_: random.Random) -> Damaged:
    part = random_.choice(("targets", "deviations", "all"))
    head, body = file.bytes().decode().split("USER-TEXT::")
    head = head.replace(".000", ",000") if part != "deviations" else head
    body = re.sub(r"(\d)\.(\d\d\d)\r", r"\1,\2\r", body) if part != "targets" else body
    return Damaged(f"{head}USER-TEXT::{body}".encode(), "refused")


def rtl_deviation(file: Rtl, random_: random.Random) -> Damaged:
    n, k, new = random_.randrange(6), random_.randrange(9), _odd(random_)
    file.rows[n][k] = (*file.rows[n][k][:2], new)
    return Damaged(file.bytes(), _says(new, 2000))


def rtl_target(file: Rtl, random_: random.Random) -> Damaged:
    file.targets[random_.randrange(9)] = new = _odd(random_)
    return Damaged(file.bytes(), _says(new, 1800))


def rtl_sections(file: Rtl, random_: random.Random) -> Damaged:
    parts = re.split(r"(?m)^(?=[A-Z][A-Z -]*::)", file.bytes().decode())
    change, i, j = random_.choice(("exchange", "twice", "gone")), random_.randrange(9), random_.randrange(9)
    i, j = i % len(parts), j % len(parts)
    if change == "exchange":
        parts[i], parts[j] = parts[j], parts[i]
    else:
        parts[i : i + 1] = [parts[i]] * 2 if change == "twice" else []
    return Damaged("".join(parts).encode(), "same")


def rtl_unit(file: Rtl, random_: random.Random) -> Damaged:
    factor = random_.choice((1e3, 1e6, 25400.0))
    file.rows = [_reversed(each, factor) for each in file.rows]
    return Damaged(file.bytes(), "refused")


def rtl_target_unit(file: Rtl, random_: random.Random) -> Damaged:
    factor = random_.choice((25.4, 1000.0))
    file.targets = [f"{float(target) * factor:.3f}" for target in file.targets]
    return Damaged(file.bytes(), "refused")


def rtl_kind(file: Rtl, random_: random.Random) -> Damaged:
    file.owner = random_.choice(("Angular", "Straightness", "Flatness", "Squareness", "Dynamic", "Rotary", "linear-x"))
    return Damaged(file.bytes(), "refused")


def rtl_no_direction(file: Rtl, random_: random.Random) -> Damaged:
    file.rows = [sorted(each) for each in file.rows]
    return Damaged(file.bytes(), "refused")


def rtl_run_gone(file: Rtl, random_: random.Random) -> Damaged:
    del file.rows[random_.randrange(6)]
    file.counts = (9, 5)
    return Damaged(file.bytes(), "refused")


def rtl_row(file: Rtl, random_: random.Random) -> Damaged:
    n, k = random_.randrange(6), random_.randrange(9)
    rows, (run, target, value) = file.rows[n], file.rows[n][k]
    moved = ((n + random_.randrange(1, 6)) % 6 + 1, target, value)
    other = (run, (target + random_.randrange(1, 8) - 1) % 9 + 1, value)
    rows[k : k + 1] = random_.choice(([], [rows[k]] * 2, [moved], [other]))
    return Damaged(file.bytes(), "refused")


def rtl_short(file: Rtl, random_: random.Random) -> Damaged:
    text = file.bytes().decode().split("\r\n")
    at = text.index("Run Target Data:") + 1 + random_.randrange(54)
    line = text[at]
    text[at] = random_.choice((line[:10], line[:4], line + "  1.0", line.replace(" ", ""), ";".join(line.split())))
    return Damaged("\r\n".join(text).encode(), "refused")


def rtl_sign(file: Rtl, random_: random.Random) -> Damaged:
    n = random_.randrange(6)
    for i in range(n - n % 2, n - n % 2 + 2) if random_.random() < 0.5 else [n]:
        file.rows[i] = _reversed(file.rows[i])
    return Damaged(file.bytes(), "refused")


def rtl_clothes(file: Rtl, random_: random.Random) -> Damaged:
    text = file.bytes().decode()
    texts = (
        text.replace("\r\n", "\n"), text.replace("\r\n", "\r"), "\ufeff" + text, text.replace("   ", "\t"), "\r\n" * 9 + text,
        text.replace("\r\n", "\r\n\r\n"), text + "\x1a", text.replace("\r\n", " \r\n"),
    )  # fmt: skip
    dressed_ = (*map(str.encode, texts), text.encode("utf-16"), text.encode("cp1252"))
    return Damaged(random_.choice(dressed_), "same")


def rtl_order(file: Rtl, random_: random.Random) -> Damaged:
    random_.shuffle(file.rows)
    return Damaged(file.bytes(), "any")


def rtl_bytes(file: Rtl, random_: random.Random) -> Damaged:
    mutator = random_.choice((raw_bytes, raw_bytes, lines_changed, dressed))
    return Damaged(mutator(file.bytes(), written(csv_rows(random_)), random_), "any")


RTL: dict[str, tuple[int, Callable[[Rtl, random.Random], Damaged]]] = {
    "cut": (3, lambda file, random_: _cut(file.bytes(), random_)),
    "control character": (3, lambda file, random_: _marked(file.bytes(), random_)),
    "count": (1, rtl_count), "decimal comma": (1, rtl_comma), "deviation": (3, rtl_deviation), "target": (2, rtl_target),
    "sections": (2, rtl_sections), "unit of deviations": (1, rtl_unit), "unit of targets": (1, rtl_target_unit),
    "kind": (1, rtl_kind), "no direction": (1, rtl_no_direction), "run gone": (1, rtl_run_gone), "row": (2, rtl_row),
    "short row": (1, rtl_short), "sign": (2, rtl_sign), "clothes": (2, rtl_clothes), "order of runs": (1, rtl_order),
    "bytes": (3, rtl_bytes),
}  # fmt: skip


Rows = list[list[str]]


def _set(rows: Rows, column: int, change: Callable[[str], str], **of: str) -> Damaged:
    """A column changed in the rows whose measurement, repeat or approach is so."""
    for row in rows[1:]:
        if all(row[COLUMNS.index(name)] == value for name, value in of.items()):
            row[column] = change(row[column])
    return Damaged(written(rows), "refused")


def _turned(cell: str) -> str:
    return f"{-float(cell):g}"


def _one(random_: random.Random) -> tuple[str, int]:
    """A measurement, and the column of what it reads."""
    number = random_.randrange(1, 5)
    return str(number), 6 if number < 3 else 7


def csv_cell(rows: Rows, random_: random.Random) -> Damaged:
    at, i, new = random_.randrange(1, len(rows)), random_.randrange(3, len(COLUMNS)), _odd(random_)
    rows[at][i] = new
    return Damaged(written(rows), _says(new, {6: 2000.0, 7: 3600.0}.get(i, 1e15)))


def csv_comma(rows: Rows, random_: random.Random) -> Damaged:
    return _set(rows, random_.choice((6, 7)), lambda cell: f'"{cell.replace(".", ",")}"')


def csv_exchanged(rows: Rows, random_: random.Random) -> Damaged:
    rows[0][6], rows[0][7] = rows[0][7], rows[0][6]
    return Damaged(written(rows), "refused")


def csv_column_gone(rows: Rows, random_: random.Random) -> Damaged:
    i = random_.choice((6, 7, 3, 14))
    return Damaged(written([[cell for k, cell in enumerate(row) if k != i] for row in rows]), "refused")


def csv_unit(rows: Rows, random_: random.Random) -> Damaged:
    (number, column), factor = _one(random_), random_.choice((1e3, 1e6))
    most = factor * max(abs(float(row[column])) for row in rows[1:] if row[0] == number)
    content = _set(rows, column, lambda cell: f"{factor * float(cell):.3f}", measurement=number).content
    return Damaged(content, "refused" if most > (2000 if column == 6 else 3600) else "any")


def csv_slope(rows: Rows, random_: random.Random) -> Damaged:
    return _set(rows, 7, lambda cell: f"{float(cell) / 0.20626:.3f}", measurement="4")


def csv_wrong_column(rows: Rows, random_: random.Random) -> Damaged:
    number, _ = _one(random_)
    for row in rows[1:]:
        if row[0] == number:
            row[6], row[7] = row[7], row[6]
    return Damaged(written(rows), "refused")


def csv_sign(rows: Rows, random_: random.Random) -> Damaged:
    (number, column), of = _one(random_), {"repeat": random_.choice("123")}
    of |= {"approach_x": random_.choice(("1", "-1"))} if random_.random() < 0.5 else {}
    return _set(rows, column, _turned, measurement=number, **of)


def csv_direction_gone(rows: Rows, random_: random.Random) -> Damaged:
    gone = random_.choice("123")
    return Damaged(written([row for row in rows if row[0] != "1" or row[2] != gone or row[14] != "-1"]), "refused")


def csv_reading_gone(rows: Rows, random_: random.Random) -> Damaged:
    rows.remove(random_.choice([row for row in rows[1:] if row[0] == "1"]))
    return Damaged(written(rows), "refused")


def csv_no_unit(rows: Rows, random_: random.Random) -> Damaged:
    number, _ = _one(random_)
    sense = {"1": 8, "2": 9}.get(number, 13)
    return _set(rows, sense, lambda _: random_.choice(("2", "0.7", "-3")), measurement=number)


def csv_oblique(rows: Rows, random_: random.Random) -> Damaged:
    _set(rows, 8, lambda _: "0.8", measurement="1")
    return _set(rows, 9, lambda _: "0.6", measurement="1")


def csv_both(rows: Rows, random_: random.Random) -> Damaged:
    rows[random_.randrange(1, len(rows))][random_.choice((9, 12))] = "1"
    return Damaged(written(rows), "any")


def csv_shuffled(rows: Rows, random_: random.Random) -> Damaged:
    body = rows[1:]
    random_.shuffle(body)
    return Damaged(written([rows[0], *body]), "same")


def csv_bytes(rows: Rows, random_: random.Random) -> Damaged:
    mutator = random_.choice((raw_bytes, lines_changed, dressed, cells, columns, rows_changed))
    try:
        return Damaged(mutator(written(rows), Rtl(random_).bytes(), random_), "any")
    except (ValueError, IndexError):
        return Damaged(random_.randbytes(300), "any")


CSV: dict[str, tuple[int, Callable[[Rows, random.Random], Damaged]]] = {
    "cut": (2, lambda rows, random_: _cut(written(rows), random_)),
    "control character": (2, lambda rows, random_: _marked(written(rows), random_)),
    "cell": (4, csv_cell), "decimal comma": (1, csv_comma), "columns exchanged": (1, csv_exchanged),
    "column gone": (1, csv_column_gone), "unit": (1, csv_unit), "µm/m for ″": (1, csv_slope),
    "wrong column": (1, csv_wrong_column), "sign": (3, csv_sign),
    "sign of a measurement": (1, lambda rows, random_: _set(rows, 7, _turned, measurement="4")),
    "no direction": (1, lambda rows, random_: _set(rows, 14, lambda _: "0")),
    "direction of a run gone": (1, csv_direction_gone),
    "direction turned": (1, lambda rows, random_: _set(rows, 14, _turned, measurement="1", repeat=random_.choice("123"))),
    "reading gone": (1, csv_reading_gone), "no unit vector": (1, csv_no_unit), "oblique": (1, csv_oblique),
    "both": (1, csv_both), "still": (1, lambda rows, random_: _set(rows, 3, lambda _: "50.000", measurement=_one(random_)[0])),
    "in inches": (1, lambda rows, random_: _set(rows, 3, lambda cell: f"{25.4 * float(cell):.3f}")),
    "shuffled": (1, csv_shuffled), "bytes": (4, csv_bytes),
}  # fmt: skip


def damaged(form: str, random_: random.Random) -> tuple[str, bytes, Damaged]:
    """What is done, a file before it, and after."""
    table: dict[str, tuple[int, Callable[[Any, random.Random], Damaged]]] = RTL if form == "rtl" else CSV
    how = random_.choices(list(table), [weight for weight, _ in table.values()])[0]
    file: Any = Rtl(random_) if form == "rtl" else csv_rows(random_)
    before = file.bytes() if form == "rtl" else written(file)
    return how, before, table[how][1](file, random_)


# ---------------------------------------------------------------- the second reader


def as_rtl(content: bytes) -> list[tuple[float, ...]] | None:
    """Place, deviation and sense of every reading that stands in the text, sorted; ``None`` where it is none."""
    text = content.decode("utf-8-sig", "replace")
    found = re.search(r"Targets :\s*([^A-Z]*)Flags", text)
    body = text.partition("Run Target Data:")[2].partition("EQUIPMENT")[0]
    try:
        targets = [float(t) for t in found[1].split()] if found else []
        rows = [line.split() for line in body.split("\n") if line.strip()]
        run = [int(row[0]) for row in rows]
        first = {n: [int(row[1]) for row in rows if row[0] == str(n)] for n in run}
        return sorted(
            (targets[int(row[1]) - 1], float(row[2]), float(np.sign(first[int(row[0])][-1] - first[int(row[0])][0])))
            for row in rows
        )
    except (ValueError, IndexError, KeyError):
        return None


def as_csv(content: bytes) -> list[tuple[float, ...]] | None:
    try:
        rows = [
            line.replace('"', "").split(",")
            for line in content.decode("utf-8-sig", "replace").splitlines()
            if line.strip()
        ]
        order = [rows[0].index(name) for name in COLUMNS]
        return sorted(tuple(float(row[i]) for i in order) for row in rows[1:])
    except (ValueError, IndexError):
        return None


def read_back(path: Path) -> list[tuple[float, ...]]:
    """What the package has read of a job, in the form of the second reader."""
    from cmm_uq.app.commands.reading import read_job

    points = read_job(path).points
    columns_ = points.columns | {"measurement": points.measurement, "point": points.point, "repeat": points.repeat}
    columns_ |= dict(zip(("x_mm", "y_mm", "z_mm"), points.xyz.T, strict=True))
    if path.joinpath("recording.rtl").exists():
        names: list[str] = ["x_mm", "reading_um", "approach_x"]
    else:
        names = COLUMNS
    zero = np.zeros(len(points.xyz))
    return sorted(tuple(map(float, row)) for row in np.column_stack([columns_.get(name, zero) for name in names]))


def alike(one: list[tuple[float, ...]] | None, other: list[tuple[float, ...]]) -> bool:
    return (
        one is not None
        and len(one) == len(other)
        and bool(np.allclose(np.array(one), np.array(other), rtol=1e-9, atol=1e-9))
    )


# ---------------------------------------------------------------- running


def stopped(*_: object) -> None:
    raise TimeoutError


def within(run: Runner, arguments: tuple[str, ...]) -> Outcome:
    """Run, but for no more than so many seconds of computing."""
    signal.signal(signal.SIGPROF, stopped)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        outcome = run(arguments)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return Outcome(None, "", "", SECONDS) if "TimeoutError" in outcome.stderr else outcome


def tried(number: int, seed: int, run: Runner, root: Path) -> tuple[str, str, list[str], str]:
    """What was done, how it ended, what does not hold, and what was said."""
    form = ("rtl", "csv")[number % 2]
    how, before, file = damaged(form, random.Random(f"runs:{seed}:{number}"))
    (job := root / "job").mkdir(parents=True)
    (job / f"recording.{form}").write_bytes(file.content)
    more = f'lines = {{ X = "{LINE}" }}' if form == "rtl" else ""
    (job / "job.toml").write_text(JOB.format(file=f"recording.{form}", more=more), encoding="utf-8")
    wrong, said, ended = list[str](), "", "accepted"
    if form == "rtl":
        outcome = within(
            run, ("import", "job/recording.rtl", "--line", f"X={LINE}", "--out", "recording.csv", "--quiet")
        )
        wrong += problems(outcome)
        if outcome.code:
            said, ended = outcome.stderr, "refused by import"
    outcome = within(run, ("check", "job"))
    if outcome.code not in (0, 2) or "Traceback" in outcome.stderr + outcome.stdout:
        wrong += problems(outcome, quiet=False) or ["check"]
    if outcome.code and ended == "accepted":
        said, ended = outcome.stdout + outcome.stderr, "refused by check"
    elif not outcome.code and ended != "accepted":
        wrong.append("refused by import and not by check")
    if ended == "accepted" and file.expected == "refused":
        wrong.append("accepted, and must not be")
    if ended == "accepted":
        wrong += misread(job, form, file, before)
        if number % 10 < REPORTED:
            outcome = within(run, ("report", "job", "--out", "out", "--quiet"))
            wrong += [each for each in problems(outcome) if each != "speaks on stderr"]
            if outcome.code:
                wrong.append("accepted by check and refused by report")
                said = outcome.stderr
    return f"{form}: {how}", ended, wrong, said


def misread(job: Path, form: str, file: Damaged, before: bytes) -> list[str]:
    """What does not hold of readings that are accepted."""
    now, second = read_back(job), as_rtl if form == "rtl" else as_csv
    says, was = (alike(second(content), now) for content in (file.content, before))
    if file.expected == "same" and not was and not says:
        return ["accepted with other readings"]
    return ["accepted, and does not read as it says"] if file.expected == "says" and not says else []


def main(count: int, seed: int, one: int | None) -> None:
    with (
        tempfile.TemporaryFile("w+") as stdout,
        tempfile.TemporaryFile("w+") as stderr,
        tempfile.TemporaryDirectory() as name,
    ):
        kept = os.dup(1), os.dup(2)
        os.dup2(stdout.fileno(), 1), os.dup2(stderr.fileno(), 2)
        told = os.fdopen(kept[0], "w", buffering=1)
        run = Runner(stdout, stderr, "runs")
        ends: Counter[tuple[str, str]] = Counter()
        faults: Counter[str] = Counter()
        for number in range(count) if one is None else [one]:
            root = Path(name) / "case"
            shutil.rmtree(root, ignore_errors=True)
            root.mkdir()
            os.chdir(root)
            how, ended, wrong, said = tried(number, seed, run, root)
            ends[how, ended] += 1
            if (number + 1) % 250 == 0:
                print(f"{number + 1} cases, {sum(faults.values())} violations", file=told)
            for fault in wrong:
                faults[fault] += 1
                if faults[fault] < 40 or one is not None:
                    print(f"{number}: {how}: {ended}: {fault}: {said[-300:]!r}", file=told)
            if one is not None:
                print(how, ended, wrong, said, file=told)
        os.chdir("/")
        for (how, ended), times in sorted(ends.items()):
            print(f"| {how} | {ended} | {times} |", file=told)
        print(f"{count} cases, seed {seed}: {sum(faults.values())} violations: {dict(faults)}", file=told)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:]]
    main(given[0] if given else 2000, given[1] if len(given) > 1 else 1, given[2] if len(given) > 2 else None)
