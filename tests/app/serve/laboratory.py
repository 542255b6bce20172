"""A small laboratory's records to look at: what is overdue, fails, is withdrawn, simulated or hostile, each once."""

from __future__ import annotations

import datetime as dt
import json
from hashlib import sha256
from pathlib import Path
from typing import Any

from cmm_uq.laboratory.records import open_records
from tests.laboratory.records.histories import certificate, made, moment

TODAY = dt.date(2026, 11, 22)
HOSTILE = "<script>alert(1)</script>"
TURNED = "Mill \u202egnp.exe"
"""What would be read from right to left."""

RESULTS = {
    "schema": "cmm-uq/results/1",
    "job": {"id": "k-1"},
    "diagnosis": {
        "verdict": "explained",
        "p_value": 0.0004,
        "effects": [
            {"effect": "hysteresis_x", "probability": 0.98,
             "parameters": {"gap_um": {"value": 5.2, "u": 0.3, "interval95": [4.6, 5.8]}}},
        ],
        "indistinguishable": [["scale_z", "artefact_sag"]],
        "suggested_measurements": [{"what": "the bar upright in two places"}],
    },
}  # fmt: skip

PAGE = b'<!doctype html><p class="identity"><span class="number">No. <bdi>%s</bdi></span></p>'


def files(number: str) -> dict[str, bytes]:
    return {
        "certificate.html": PAGE % number.encode(),
        "certificate.pdf": b"%%PDF-1.7 <pdf:Keywords>%s</pdf:Keywords>" % number.encode(),
        "posterior.npz": b"PK" + number.encode(),
        "results.json": json.dumps(RESULTS | {"job": {"id": number}}).encode(),
    }


def hashes(of: dict[str, bytes]) -> dict[str, str]:
    return {name: sha256(content).hexdigest() for name, content in of.items()}


def values(*figures: tuple[str, str, str, float, float, float | None]) -> list[list[Any]]:
    return [
        [name, what, unit, value, u, value - 2 * u, value + 2 * u, 0.4 * u, limit]
        for name, what, unit, value, u, limit in figures
    ]


def opened_in(folder: Path) -> Path:
    place = folder / "records.db"
    with made(place, 4, 3, released=True) as records:
        latest = moment(dt.date(1970, 1, 1))

        def add(serial: str, day: dt.date, number: str, state: str = "draft", **further: Any) -> int:
            there = files(number)
            (folder / number).mkdir(exist_ok=True)
            for name, content in there.items():
                (folder / number / name).write_bytes(content)
            known = hashes(there)
            content = certificate(serial, day, job=number, number=number, folder=number, files=known,
                                  results_sha256=known["results.json"], **further)  # fmt: skip
            nonlocal latest
            at = latest = max(latest, moment(day))  # the clock of the records does not run backwards
            entry = records.append("report", content, at=at).number
            if state != "draft":
                signed = {"certificate": entry, "by": "A. Prüfer", "reason": "checked", "complete": True}
                records.append("release", signed, at=at)
            if state in ("withdrawal", "replacement"):
                records.append(state, {"certificate": entry, "by": "B. Leiter", "reason": "artefact was damaged"},
                               at=at)  # fmt: skip
            return entry

        good = values(
            ("scale_x.ppm", "Scale error of X", "ppm", 1.234, 0.5, 8.0),
            ("squareness_xy.angle_arcsec", "Squareness X–Y", "″", -2.0, 0.2, None),
        )
        beyond = values(("performance:E0", "Length measurement error E0", "µm", 9.5, 0.5, 9.0))
        add("K1", dt.date(2026, 6, 1), "k-1", "released", values=good)
        add("K2", dt.date(2025, 12, 1), "k-2", "released", values=good)
        add("K3", dt.date(2026, 8, 1), "k-3", "released", values=beyond, decision="fail")
        add("K4", dt.date(2026, 7, 1), "k-4", "withdrawal", values=good)
        add("K1", dt.date(2026, 6, 2), "sim-1", origin="simulated", values=good)
        add("K1", dt.date(2026, 9, 1), "check-1", interim=True, values=good)
        still = values(("performance:E0", "Length measurement error E0", "µm", 9.4, 0.5, 9.0))
        add("K3", dt.date(2026, 9, 3), "check-3", interim=True, values=still)
        add("K5", dt.date(2026, 9, 1), "k-5", decision="undecided", diagnosis="explained")
        add(HOSTILE, dt.date(2026, 9, 2), "h-1", "released", machine={"serial": HOSTILE, "name": TURNED, "place": HOSTILE},
            artefact={"serial": HOSTILE, "due": "2026-01-01"},
            values=[["x", HOSTILE, HOSTILE, 1.0, 0.1, 0.8, 1.2, 0.0, None]])  # fmt: skip
        records.append(
            "machine",
            {"serial": "NEW", "name": "Just bought", "manufacturer": "M", "model": "P", "place": "Hall 2"},
            at=latest,
        )
    return place


def entry_of(place: Path, number: str) -> int:
    with open_records(place, read_only=True) as records:
        return records.named(number)[0].entry
