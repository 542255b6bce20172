"""What a user waits for, beside what it cannot do without: ``python -m benchmarks.waiting [--times N] [--page]``.

Each command is a process of its own, and so is the floor: a process that imports the libraries of a report alone.
All take turns, so that what else runs on the machine is the same to all; a figure is the least of their user and system times.
``--page`` writes the tables into docs/waiting.md, and the picture of where a report's time goes, by rooms, beside them.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from benchmarks.marked import put

ROOT = Path(__file__).parents[1]
DOMAINS = ("base", "maths", "jobs", "machine", "analysis", "laboratory", "certificate", "artefacts", "app")
PAGE, PICTURE = ROOT / "docs" / "waiting.md", ROOT / "docs" / "images" / "waiting.svg"
BEGIN, END = "<!-- written by python -m benchmarks.waiting --page: edit that instead -->", "<!-- end of waiting -->"
JOB = ROOT / "examples" / "iota-1102-20C"
FLOOR = "import numpy, scipy.linalg, scipy.optimize, matplotlib.figure, pydantic, sqlalchemy"
MACHINES, EACH, JOBS = 40, 5, (1, 4)
DATES = "dates.json"  # what is kept of dates by drift
LANGUAGES = {"de": "German", "fr": "French", "ja": "Japanese"}


def commands(place: Path) -> dict[str, list[str]]:
    """What is timed, by name: arguments of Python."""
    lab, out = ["--records", str(place / "fixed.db")], str(place / "report")
    return {
        "imports of the libraries alone": ["-c", FLOOR],
        "`report`, 20 bars": _of("report", str(JOB), "--out", out, "--quiet", "--force"),
        **{f"`report` in {name}": _of("report", str(place / code), "--out", str(place / "out" / code), "--quiet", "--force")
           for code, name in LANGUAGES.items()},
        "`verify`": _of("verify", out),
        "`verify --no-rerun`": _of("verify", "--no-rerun", out),
        "`check`": _of("check", str(JOB)),
        "`new ballbar`": _of("new", "ballbar", str(place / "new")),
        "`due`, 40 machines at fixed intervals": _of("due", *lab),
        **{f"`due`, 40 machines by drift, {when}": _of("due", "--records", str(place / "drift.db"))
           for when in ("found anew", "as kept")},
        "`history` with pictures": _of("history", "100005", *lab, "--out", str(place / "history"), "--force"),
        "`fleet`, 40 machines, one value": _of("fleet", *lab, "--name", "scale_x.ppm", "--out", str(place / "f"), "--force"),
        **{f"`batch` of {n}, one worker": _of("batch", str(place / f"jobs{n}"), "--workers", "1", "--out", str(place / "b"))
           for n in JOBS},
    }  # fmt: skip


def _of(*arguments: str) -> list[str]:
    return ["-m", "cmm_uq", *arguments]


def prepare(place: Path) -> None:
    """Records of forty machines, and jobs."""
    from cmm_uq.laboratory.records import open_records
    from tests.laboratory.records.histories import history

    for name, rule in (("fixed", None), ("drift", {"method": "drift", "reliability": 0.95, "every_months": 12})):
        entries = list(history(MACHINES, EACH))
        for _, content, _ in entries:
            content["machine"] |= {"calibrate": rule} if rule else {}
        with open_records(place / f"{name}.db", create=True) as records:
            records.append_all(iter(entries))
    open_records(place / "own.db", create=True).close()
    for code in (*LANGUAGES, *(f"jobs{n}/{i}" for n in JOBS for i in range(n))):
        shutil.copytree(JOB, place / code)
        file = place / code / "job.toml"
        said = f'language = "{code}"' if code in LANGUAGES else ""
        text = file.read_text(encoding="utf-8").replace('id = "iota-1102-20C"', f'id = "{Path(code).name}"')
        file.write_text(text.replace("[job]", f"[job]\n{said}", 1), encoding="utf-8")


def spent(arguments: list[str], place: Path) -> tuple[float, float]:
    """User and system time in s of a process and of those that it started, and its peak memory in MiB; with records."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "CMM_UQ_RECORDS": str(place / "own.db"),
                   "CMM_UQ_DATES": str(place / DATES)}  # fmt: skip
    process = subprocess.Popen([sys.executable, *arguments], env=environment, stdout=subprocess.DEVNULL, cwd=ROOT)
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 3):  # 3: verified, but not all of it
        raise RuntimeError(f"{arguments} ended with {os.waitstatus_to_exitcode(status)}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def measured(place: Path, times: int) -> dict[str, tuple[float, float]]:
    """Least time and largest memory of each command, all in turn."""
    every = commands(place)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in every}
    for _ in range(times):
        shutil.rmtree(place / "new", ignore_errors=True)
        (place / DATES).unlink(missing_ok=True)
        for name, arguments in every.items():
            found[name].append(spent(arguments, place))
            shutil.rmtree(place / "b", ignore_errors=True)
    return {name: (min(t for t, _ in each), max(m for _, m in each)) for name, each in found.items()}


def table(found: dict[str, tuple[float, float]], times: int) -> str:
    floor = next(iter(found.values()))[0]
    rows = [f"| {name} | {s:.2f} | {s / floor:.2f} | {m:.0f} |" for name, (s, m) in found.items()]
    few, many = (s for name, (s, _) in found.items() if "batch" in name)
    load = os.getloadavg()[0]
    head = "| what | CPU, s | of the imports | memory, MiB |\n| --- | ---: | ---: | ---: |"
    after = (f"The least of {times} runs in turn, Python {platform.python_version()}, {os.cpu_count()} processors, load "
             f"{load:.1f} at the end. One report more in a warm process takes {(many - few) / (JOBS[1] - JOBS[0]):.2f} s "
             "with its certificate.")  # fmt: skip
    return "\n".join([head, *rows, "", after])


Stack = tuple[str, ...]


def rooms(frame: FrameType | None) -> Stack:
    """Rooms and libraries that a stack goes through, from the outside, each once where it follows itself."""
    found: list[str] = []
    while frame is not None:
        parts = Path(frame.f_code.co_filename).parts
        if "cmm_uq" in parts:
            domain = Path(parts[len(parts) - 1 - parts[::-1].index("cmm_uq") + 1]).stem
            if domain in DOMAINS and domain != "app" and parts[-1] != "stated.py":  # which only hand on
                found.append(domain)
        elif "site-packages" in parts and "typer" not in parts:
            found.append(Path(parts[parts.index("site-packages") + 1]).stem)
        elif frame.f_code.co_filename.startswith("<frozen importlib"):
            found.append("import")
        frame = frame.f_back
    inner = [one for i, one in enumerate(found[::-1]) if one != "import" or "import" not in found[::-1][:i]]
    return tuple(one for i, one in enumerate(inner) if i == 0 or one != inner[i - 1])


def sampled(run: Callable[[], Any]) -> Counter[Stack]:
    """How often a stack was met, as the processor's time went by."""
    found: Counter[Stack] = Counter()
    last = [time.process_time()]

    def look(_: int, frame: FrameType | None) -> None:
        now = time.process_time()  # what computes without Python is met once, with all of its time
        found[rooms(frame)] += round(1e4 * (now - last[0]))
        last[0] = now

    signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, 0.002, 0.002)
    run()
    signal.setitimer(signal.ITIMER_PROF, 0)
    return found


COLOURS = {"import": "#d9d9d9", **dict(zip(DOMAINS, ("#dbe7f3", "#cfe8cf", "#f3e6c4", "#f3d6c4", "#e3d3ee", "#cde8ea",
                                                     "#f0cfd6", "#e8e8c0", "#d5d5f0"), strict=False))}  # fmt: skip


def drawn(found: Counter[Stack], seconds: float) -> str:
    """Rooms by what calls them, from above, as wide as the time that is spent in them and in what they call."""
    width, row, parts = 980.0, 20.0, list[str]()
    deepest = 0

    def place(stacks: Counter[Stack], left: float, depth: int) -> None:
        nonlocal deepest
        inner: dict[str, Counter[Stack]] = {}
        for stack, count in stacks.items():
            if stack:
                inner.setdefault(stack[0], Counter())[stack[1:]] += count
        for name, of in sorted(inner.items(), key=lambda pair: -pair[1].total()):
            share = of.total() / found.total()
            wide = width * share
            if wide >= 3:
                deepest = max(deepest, depth)
                box = f'x="{left:.1f}" y="{row * depth:.0f}" width="{wide:.1f}" height="{row - 1:.0f}"'
                title = f"<title>{name}: {seconds * share:.2f} s</title>"
                parts.append(f'<rect {box} fill="{COLOURS.get(name, "#ececec")}">{title}</rect>')
                if wide > 6.5 * len(name) + 4:
                    parts.append(f'<text x="{left + 3:.1f}" y="{row * depth + 14:.0f}">{name}</text>')
                place(of, left, depth + 1)
            left += wide

    place(found, 0.0, 0)
    begin = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {row * (deepest + 1):.0f}" role="img">'
    title = "<title>Where the processor's time of a report goes, by rooms of the package and by libraries</title>"
    return "\n".join([begin, "<style>text{font:12px sans-serif;fill:#222}</style>", title, *parts, "</svg>", ""])


def picture(place: Path) -> str:
    """Of one cold report in this process."""
    from cmm_uq.app.cli import lighten

    lighten()
    sys.argv = ["cmm-uq", "report", str(JOB), "--out", str(place / "sampled"), "--quiet"]

    def run() -> None:
        from cmm_uq.app.cli.commands import run as run_command

        run_command()

    begun = time.process_time()
    found = sampled(run)
    return drawn(found, time.process_time() - begun)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--times", type=int, default=9)
    asked.add_argument("--page", action="store_true", help="write docs/waiting.md and its picture")
    asked.add_argument("--picture", type=Path, help="write the picture alone, there")
    chosen = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if chosen.picture:
            chosen.picture.write_text(picture(place), encoding="utf-8")
            return
        prepare(place)
        text = table(measured(place, chosen.times), chosen.times)
    print(text)
    if chosen.page:
        subprocess.run([sys.executable, "-m", "benchmarks.waiting", "--picture", str(PICTURE)], check=True, cwd=ROOT)
        put(PAGE, BEGIN, END, text)


if __name__ == "__main__":
    main()
