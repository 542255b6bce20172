"""``cmm-uq acquire`` killed while points are accepted: each that it said is kept, and the next session goes on.

Points are typed; every other session has an instrument at a pseudo-terminal too, which may vanish, be silent or babble.
"""

from __future__ import annotations

import contextlib
import os
import queue
import random
import re
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.hostile.invariants import Outcome
from benchmarks.hostile.warm import Warm
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.simulated_line import Lines
from cmm_uq.laboratory.live.story import read_story
from tests.laboratory.live.instruments.mischief import UnreliableLine
from tests.laboratory.live.session import job_folder

SIGNALS = ("SIGKILL", "SIGKILL", "SIGTERM", "SIGINT")
MISCHIEF = (
    "vanishes",
    "vanishes and comes back",
    "is silent",
    "babbles",
    "sends halves",
    "sends other bytes",
    "is let alone",
)
BARS = 40
PLAN = [(m, p) for m in range(1, BARS + 1) for p in (1, 2)]
SOURCE = """
[[acquire.source]]
name = "air"
profile = "line-logger"
port = "{port}"
values = {{ value1 = "temp_air_c" }}
"""
PATIENCE_S = 60.0
TYPED_S = 0.004
STOPS = 2.0
Place = tuple[int, int]


def job(folder: Path, port: str | None) -> Path:
    """A job of many bars, each of two points."""
    rows = [f"{m},{p},1,{100 if p == 1 else 600},100,-300,0" for m, p in PLAN]
    plan = "measurement,point,repeat,x_mm,y_mm,z_mm,time_s\n" + "\n".join(rows) + "\n"
    return job_folder(folder, "" if port is None else SOURCE.format(port=port), plan=plan)


def typed(place: Place) -> str:
    """The point of a place, as its operator types it; no two are the same."""
    m, p = place
    return f"{100 if p == 1 else 600} 100 {-300 - (2 * m + p) / 1000:.3f}\n"


class Session:
    """A session with a pipe in place of a keyboard."""

    def __init__(self, warm: Warm, folder: Path, number: int) -> None:
        self._warm, self.told = warm, list[str]()
        names = [folder.parent / f"{name}-{number}" for name in ("keyboard", "screen")]
        for name in names:
            os.mkfifo(name)
        self.errors = folder.parent / f"errors-{number}"
        self.errors.touch()
        self.process = warm.start(["acquire", str(folder), "--plain"], folder.parent, streams=(*names, self.errors))
        self._keyboard = os.open(names[0], os.O_WRONLY)
        self._screen = names[1].open(encoding="utf-8", errors="replace")
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._ended, self._typing = threading.Event(), threading.Thread(target=self._listen, daemon=True)
        self._typing.start()

    def type(self, *lines: str) -> None:
        """What the operator types; nobody may read it any more."""
        with contextlib.suppress(BrokenPipeError):
            os.write(self._keyboard, "".join(lines).encode())

    def keep_typing(self, lines: list[str]) -> None:
        """Lines one after another, as fast as the disk takes points, while the session does what it does."""

        def one_by_one() -> None:
            with contextlib.suppress(OSError):
                for line in lines:
                    if self._ended.wait(TYPED_S):
                        break
                    os.write(self._keyboard, line.encode())

        self._typing = threading.Thread(target=one_by_one, daemon=True)
        self._typing.start()

    def hear(self, wanted: str) -> bool:
        """Lines until one has what is wanted; whether one had."""
        with contextlib.suppress(queue.Empty):
            while (line := self._lines.get(timeout=PATIENCE_S)) is not None:
                self.told.append(line)
                if re.search(wanted, line):
                    return True
        return False

    def end(self, sign: signal.Signals | None = None) -> Outcome:
        """To the end of the process, by a signal where one is meant."""
        began = time.monotonic()
        if sign is not None:
            os.kill(self.process, sign)
        ended = self._warm.ended(PATIENCE_S)
        took = time.monotonic() - began
        if ended is None:
            os.killpg(self.process, signal.SIGKILL)
            self._warm.ended(PATIENCE_S)
        self._ended.set()
        self.hear("(?!)")
        self._typing.join()
        os.close(self._keyboard)
        self._screen.close()
        said = self.errors.read_text(encoding="utf-8", errors="replace")
        return Outcome(ended[0] if ended else None, "\n".join(self.told), said, took)

    @property
    def accepted(self) -> list[Place]:
        """What it said."""
        found = (re.match(r"accepted: measurement (\d+), point (\d+)", line) for line in self.told)
        return [(int(one[1]), int(one[2])) for one in found if one]

    def _listen(self) -> None:
        with contextlib.suppress(ValueError):
            for line in self._screen:
                self._lines.put(line.rstrip("\n"))
        self._lines.put(None)


def kept(folder: Path) -> dict[Place, float]:
    """The height of each point that is on the disk."""
    points = read_story(folder / "acquisition").points.values()
    return {(point.place[0], point.place[1]): point.columns["z_mm"] for point in points}


def what(seed: int, number: int) -> str:
    """The case in words."""
    sign, mischief, points, after = _case(seed, number)
    line = f", an instrument {mischief}" if mischief else ""
    return f"{sign} {1000 * after:.0f} ms after {points} accepted points{line}"


def _case(seed: int, number: int) -> tuple[str, str, int, float]:
    random_ = random.Random(f"acquisitions:{seed}:{number}")
    mischief = random_.choice(MISCHIEF) if number % 2 else ""
    return random_.choice(SIGNALS), mischief, random_.randint(1, 30), random_.expovariate(1 / 0.03)


@contextlib.contextmanager
def instrument(folder: Path, mischief: str) -> Iterator[UnreliableLine | None]:
    """A logger at a pseudo-terminal, where there is to be one."""
    if not mischief:
        yield None
        return
    with UnreliableLine(Lines(), "pty", folder) as line:
        yield line


def misbehave(line: UnreliableLine, mischief: str) -> None:
    """The instrument does wrong from now on."""
    wrong = line.mischief
    wrong.hangs, wrong.halves, wrong.garbled = (
        mischief == f"{name}" for name in ("is silent", "sends halves", "sends other bytes")
    )
    wrong.noise = b"\x00\xff\x1b[2J%s" * 200 if mischief == "babbles" else b""
    if mischief.startswith("vanishes"):
        line.unplug()
        if mischief.endswith("back"):
            line.plug_in()


def strike(seed: int, number: int, folder: Path, warm: Warm) -> tuple[Outcome, list[str], int]:
    """Kill a session, look at what is kept, go on to the end of the plan; the end, what does not hold, and points accepted."""
    sign, mischief, points, after = _case(seed, number)
    found: list[str] = []
    folder.mkdir(parents=True)
    with instrument(folder, mischief) as line:
        place = job(folder / "job", None if line is None else line.port)
        session = Session(warm, place, 1)
        session.type(*map(typed, PLAN[: points // 2]))
        for _ in range(points // 2):
            session.hear("^accepted: ")
        if line is not None:
            misbehave(line, mischief)
        session.keep_typing(list(map(typed, PLAN[points // 2 :])))
        for _ in range(points - points // 2):
            if not session.hear("^accepted: "):
                found.append("a point is not accepted")
                break
        time.sleep(after)
        outcome = session.end(signal.Signals[sign])
        found += _of_signal(sign, outcome)
        said, there = session.accepted, kept(place)
        if lost := [one for one in said if one not in there]:
            found.append(f"an accepted point is lost ({len(lost)} of {len(said)})")
        found += _as_typed(there)
        if line is not None and mischief == "vanishes":
            line.plug_in()
        found += _goes_on(place, there, warm)
    return outcome, found, len(said)


def _of_signal(sign: str, outcome: Outcome) -> list[str]:
    if "Traceback" in outcome.stdout + outcome.stderr:
        return ["a traceback"]
    if outcome.code is None:
        return ["hangs"]
    if sign == "SIGKILL":
        return [] if outcome.code == -signal.SIGKILL else [f"exit code {outcome.code}"]
    told = outcome.stderr.startswith("cmm-uq: interrupted") and outcome.stderr.count("\n") == 1
    late = [f"ends later than {STOPS:g} s after the signal"] if outcome.seconds > STOPS else []
    if outcome.code != 128 + signal.Signals[sign]:
        return [f"exit code {outcome.code}", *late]
    return late + ([] if told else ["does not say that it was interrupted"])


def _as_typed(there: dict[Place, float]) -> list[str]:
    wrong = [one for one, z in there.items() if f"{z:.3f}" != typed(one).split()[2]]
    gap = list(there) != PLAN[: len(there)]
    return ["a point is kept that was not typed so"] * bool(wrong) + ["a point between others is missing"] * gap


def _goes_on(place: Path, there: dict[Place, float], warm: Warm) -> list[str]:
    """Why a further session, with the rest of the plan, does not end with all of it."""
    session = Session(warm, place, 2)
    session.type(*map(typed, PLAN[len(there) :]))
    for _ in range(len(PLAN) - len(there)):
        session.hear("^accepted: ")
    session.type("quit\n", "quit\n")
    outcome = session.end()
    if outcome.code != 0:
        return [f"the next session ends with {outcome.code}: {outcome.stderr[-100:]}"]
    found = _as_typed(kept(place))
    if {one: kept(place).get(one) for one in there} != there or len(kept(place)) != len(PLAN):
        found.append("the next session has not all points")
    try:
        if len(read_job(place).points) != len(PLAN):
            found.append("the recording has not all points")
    except CmmUqError as error:
        found.append(f"the recording is refused: {error}"[:100])
    return found
