"""A session without threads or terminals: a clock that a test moves, and a conductor of a small job."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.app.commands.laboratory.acquire import begin_acquisition
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.instruments.source import Reading
from cmm_uq.laboratory.live.running import Acquisition

JOB = """
[job]
id = "bar"
date = 2026-05-31

[machine]
name = "Bridge"
travel_mm = {{ x = [0, 900], y = [0, 800], z = [-600, 0] }}

[artefact]
kind = "ballbar"
length_mm = 500.0
u_um = 0.5

[recording]
file = "bar.csv"
u_coordinate_um = 1.0

[model]
effects = ["squareness_xy"]

[acquire]
plan = "plan.csv"
{more}
"""
PLAN = """# planned, nothing is measured yet: nominal coordinates
measurement,point,repeat,x_mm,y_mm,z_mm,time_s
1,1,1,100,100,-300,0
1,2,1,600,100,-300,0
1,1,2,100,100,-300,0
1,2,2,600,100,-300,0
2,1,1,100,100,-300,0
2,2,1,100,600,-300,0
3,1,1,100,100,-300,0
3,2,1,500,400,-300,0
"""


@dataclass
class FakeClock:
    utc: int = 1_700_000_000_000_000_000
    monotonic: int = 5_000_000_000

    def utc_ns(self) -> int:
        return self.utc

    def monotonic_ns(self) -> int:
        return self.monotonic

    def sleep(self, s: float) -> None:
        self.go(s)

    def go(self, s: float) -> None:
        self.utc += round(s * 1e9)
        self.monotonic += round(s * 1e9)


def job_folder(folder: Path, more: str = "", plan: str = PLAN) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "job.toml").write_text(JOB.format(more=more), encoding="utf-8")
    (folder / "plan.csv").write_text(plan, encoding="utf-8")
    return folder


def session(folder: Path, clock: FakeClock, **options: bool) -> Acquisition:
    return begin_acquisition(folder, clock=clock, **options)


def said(conductor: Conductor) -> list[str]:
    told = [str(text) for text in conductor.said]
    conductor.said.clear()
    return told


def type_in(acquisition: Acquisition, clock: FakeClock, *lines: str) -> list[str]:
    told = []
    for line in lines:
        clock.go(5)
        acquisition.conductor.line(line)
        acquisition.conductor.tick()
        told += said(acquisition.conductor)
    return told


def temperature(clock: FakeClock, number: int, value: float, source: str = "t", column: str = "temp_c") -> Reading:
    raw = f"{value:.4f}\r\n".encode()
    return Reading(source, number, clock.utc, clock.monotonic, raw, {column: value})


def probed(clock: FakeClock, number: int, xyz: tuple[float, float, float]) -> Reading:
    values = dict(zip(("x_mm", "y_mm", "z_mm"), xyz, strict=True))
    return Reading("cmm", number, clock.utc, clock.monotonic, b"00002 # PtMeas(...)\r\n", values, point="PtMeas")
