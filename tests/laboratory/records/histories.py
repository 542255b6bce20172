"""Histories made up for tests and studies: machines that drift, calibrated year by year, in one transaction."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Engine

from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.opening import KNOWN
from cmm_uq.laboratory.records.store import New, Records

BEGINNING = dt.date(2016, 1, 4)

VALUES = (
    ("scale_x.ppm", "Scale error of x", "ppm", 8.0),
    ("scale_y.ppm", "Scale error of y", "ppm", 8.0),
    ("scale_z.ppm", "Scale error of z", "ppm", 8.0),
    ("squareness_xy.angle_arcsec", "Squareness of x and y", "″", 4.0),
    ("squareness_yz.angle_arcsec", "Squareness of y and z", "″", 4.0),
    ("squareness_zx.angle_arcsec", "Squareness of z and x", "″", 4.0),
    ("performance:E0", "Length measurement error E0", "µm", 9.0),
)
"""Name, quantity, unit, limit."""


def certificate(
    serial: str = "1102",
    day: dt.date = dt.date(2026, 3, 2),
    values: Sequence[Sequence[Any]] = (("scale_x.ppm", "Scale error of x", "ppm", 2.0, 0.5, 1.0, 3.0, 0.2, 8.0),),
    **further: Any,
) -> dict[str, Any]:
    content = {
        "command": "report", "job": f"{serial}-{day}", "number": f"K-{serial}-{day}",
        "machine": {"serial": serial, "name": f"Machine {serial}", "manufacturer": "DEA", "model": "Iota", "place": "Hall 1"},
        "artefact": {"serial": "BB-7", "name": "Ballbar", "certificate": "PTB 1", "laboratory": "PTB",
                     "calibrated": "2025-06-01", "due": "2027-06-01"},
        "kind": "ballbar", "origin": "measured", "day": day.isoformat(), "adjusted_since": None, "decision": "pass",
        "diagnosis": "consistent", "interim": False, "folder": f"{serial}-{day}", "version": "0.5.0",
        "values": [list(value) for value in values], "covariance": None, **further,
    }  # fmt: skip
    content.setdefault("results_sha256", sha256(repr(sorted(content.items())).encode()).hexdigest())
    return content


def moment(day: dt.date) -> dt.datetime:
    return dt.datetime.combine(day, dt.time(15), dt.UTC)


def history(
    machines: int, each: int, *, seed: int = 0, models: int = 5, places: int = 7, artefacts: int = 20, released: bool = False
) -> Iterator[New]:  # fmt: skip
    random = np.random.default_rng(seed)
    count = len(VALUES)
    limits = np.array([limit for *_, limit in VALUES])
    start = random.normal(0.0, 0.15, (machines, count)) * limits
    rate = random.normal(0.03, 0.03, (machines, count)) * limits
    offset = random.integers(0, 365, machines)
    number = 0
    for year in range(each):
        for machine in np.argsort(offset, kind="stable"):
            day = BEGINNING + dt.timedelta(days=int(365 * year + offset[machine]))
            adjusted = machine % 10 == 0 and year >= each // 2 > 0
            years = year - each // 2 if adjusted else year
            truth = (0.0 if adjusted else start[machine]) + rate[machine] * years
            u = 0.05 * limits
            value = np.round(truth + random.normal(0.0, 1.0, count) * u, 4)
            stated = [
                (name, quantity, unit, float(v), float(s), float(v - 2 * s), float(v + 2 * s), float(0.4 * s), limit)
                for (name, quantity, unit, limit), v, s in zip(VALUES, value, u, strict=True)
            ]
            serial = f"{100000 + machine}"
            worst = float(np.max(np.abs(value) / limits))
            content = certificate(
                serial, day, stated,
                job=f"m{serial}-{year}", folder=f"m{serial}-{year}",
                machine={"serial": serial, "name": f"CMM {serial}", "manufacturer": f"Maker {machine % models % 3}",
                         "model": f"Model {machine % models}", "place": f"Hall {machine % places}"},
                artefact={"serial": f"BB-{machine % artefacts}", "certificate": f"C-{machine % artefacts}-{day.year}",
                          "laboratory": "PTB", "calibrated": f"{day.year}-01-01", "due": f"{day.year + 1}-12-31"},
                decision="pass" if worst < 0.9 else "fail" if worst > 1.1 else "undecided",
                adjusted_since=None if not (adjusted and years == 0) else (day - dt.timedelta(days=1)).isoformat(),
                results_sha256=sha256(f"{seed} {machine} {year}".encode()).hexdigest(),
            )  # fmt: skip
            number += 1
            yield "report", content, moment(day)
            if released and year < each - 1:
                signed = {"certificate": number, "by": "A. Releaser", "reason": "checked", "complete": True}
                number += 1
                yield "release", signed, moment(day) + dt.timedelta(hours=1)


def take_back(engine: Engine) -> None:
    """Tables of empty records as the first revision had them."""
    with engine.connect().execution_options(writing=True) as connection, connection.begin():
        for column in ("certificates DROP COLUMN artefact_due", "machines DROP COLUMN calibrate"):
            connection.exec_driver_sql(f"ALTER TABLE {column}")
        connection.exec_driver_sql(f"UPDATE alembic_version SET version_num = '{KNOWN[0]}'")
    engine.dispose()


def made(place: Path | str, machines: int, each: int, **how: Any) -> Records:
    records = open_records(place, create=True)
    records.append_all(history(machines, each, **how))
    return records
