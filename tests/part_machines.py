"""A machine with its certificate, reported once for all processes of a run, and jobs of a plate that was measured on it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.job import PartJob, part_of
from tests.conftest import ROOT
from tests.jobs.part.parts import tables
from tests.shared import shared_files

MACHINE = "bryan-simulated"
PDF = "machine/certificate-simulated.pdf"
THERE = {"machine_state": {"certificate": "machine",
                           "travel_mm": {"x": [0.0, 900.0], "y": [0.0, 1200.0], "z": [-600.0, 0.0]}}}  # fmt: skip
"""What the machine's results do not say, and its certificate does."""


@shared_files
def report() -> Mapping[str, bytes]:
    """Files of the machine's report, by name."""
    contents = REPORT.contents(report_outcome(read_job(ROOT / "examples" / MACHINE)))
    return {name: content for name, content in contents.items() if not name.endswith(".html")}


def by_certificate() -> dict[str, bytes]:
    """The PDF alone."""
    return {PDF: report()["certificate-simulated.pdf"]}


def by_results() -> dict[str, bytes]:
    """Figures and draws alone, without the recording."""
    return {f"machine/{name}": report()[name] for name in ("results.json", "posterior-simulated.npz")}


def measured(points: Floats, names: list[str]) -> bytes:
    """The CSV of measured points (n, 3), each of the feature named."""
    count: dict[str, int] = {}
    rows = ["feature,point,x_mm,y_mm,z_mm"]
    for name, xyz in zip(names, points.tolist(), strict=True):
        count[name] = count.get(name, 0) + 1
        rows.append(",".join([name, str(count[name]), *(f"{value:.6f}" for value in xyz)]))
    return ("\n".join(rows) + "\n").encode()


def plate_files(machine: Mapping[str, bytes], points: Floats | None = None, **changes: Any) -> dict[str, bytes]:
    """Files of the job of a plate: nominal points moved by (n, 3) mm where something was measured."""
    given = {"job": {"id": "plate", "date": dt.date(2026, 5, 31), "origin": "simulated"}, **changes}
    files = dict(machine)
    if points is not None:
        given["recording"] = {"file": "points.csv"}
        plan = part_of({"job.toml": as_toml(tables(**{**given, "recording": None}), "job.toml")}, machine=False)
        names = [one.facts.name for one in plan.features for _ in one.points]
        nominal = np.concatenate([one.points for one in plan.features])
        files["points.csv"] = b"# origin: simulated\n" + measured(nominal + points, names)
    files["job.toml"] = as_toml(tables(**given), "job.toml")
    return files


def plate_of(machine: Mapping[str, bytes], points: Floats | None = None, **changes: Any) -> PartJob:
    """The same as it is read."""
    return part_of(plate_files(machine, points, **changes))


# tables of results.json whose keys are names, and what the reference writes for them.
_ANY = {"inputs_sha256": "FILE", "seen": "CAUSE"}


def results_keys(data: Any, path: str = "") -> Iterator[str]:
    """Keys of results.json as the reference writes them."""
    if isinstance(data, dict):
        own = _ANY.get(path.rpartition(".")[2])
        for key, value in data.items():
            yield from results_keys(value, f"{path}.{own or key}".lstrip("."))
    elif isinstance(data, list) and data and isinstance(data[0], dict):
        for one in data:
            yield from results_keys(one, f"{path}[]")
    else:
        yield path
