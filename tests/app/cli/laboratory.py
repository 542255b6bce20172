"""A laboratory for the commands of the records: one cheap report, and records that it keeps."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from cmm_uq.laboratory.records import open_records
from tests.app.cli.process import run
from tests.conftest import ROOT
from tests.shared import files_below, put, shared_files

PLACE = Path("reports") / "records.db"
"""Of the records, in the laboratory's folder."""


STATED = """\
place = "Hall 3"
customer = "Works"
address = "Street 1"
conditions = "20 °C"
issued = 2026-01-02

[laboratory]
name = "Laboratory"
address = "Street 2"
signatory = "A. Huber"

"""
CHAIN = """\
[artefact.certificate]
number = "4711"
laboratory = "NMI"
issuer = "national institute"
arrangement = "CIPM MRA"
date = 2000-01-01
due = 2099-01-01

"""
"""What ISO/IEC 17025:2017, 7.8 asks for; without it a certificate is a draft that nobody releases."""


def reported(folder: Path) -> Path:
    """The folder of a laboratory with one certificate, K-1 of the machine 77: a digitizer."""
    return put(folder, _reported())


@shared_files
def _reported() -> Mapping[str, bytes]:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        job = Path(shutil.copytree(ROOT / "examples" / "digitizer-simulated", folder / "job"))
        toml = (job / "job.toml").read_text(encoding="utf-8")
        toml = toml.replace('id = "digitizer-simulated"', 'id = "mount"').replace(
            'origin = "simulated"', 'number = "K-1"'
        )
        toml = toml.replace("[machine]\n", f'{STATED}[machine]\nserial = "77"\n').replace(
            "[recording]\n", f"{CHAIN}[recording]\n"
        )
        (job / "job.toml").write_text(toml, encoding="utf-8")
        done = run("report", job, "--out", folder / "reports" / "mount", "--records", folder / PLACE, "--quiet")
        assert done.returncode == 0, done.stderr
        return files_below(folder)


def older(folder: Path, version: str, change: Callable[[dict[str, Any]], None] = lambda _: None) -> None:
    """Make a report's folder what an older version would have written, with what a change makes of its results."""
    results = json.loads((folder / "results.json").read_bytes())
    results["software"]["version"] = version
    change(results)
    data = json.dumps(results).encode()
    (folder / "results.json").write_bytes(data)
    manifest = json.loads((folder / "manifest.json").read_bytes())
    manifest["files"]["results.json"] = {"sha256": sha256(data).hexdigest(), "bytes": len(data)}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")


def kept(place: Path, *contents: dict[str, Any]) -> Path:
    """Records with these certificates, without their files."""
    with open_records(place, create=True) as records:
        for one in contents:
            records.append("report", one)
    return place
