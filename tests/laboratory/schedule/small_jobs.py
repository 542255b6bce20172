"""Small jobs for tests of many: ten points of the example's surface plate."""

from __future__ import annotations

import re
from pathlib import Path

from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "plane-simulated"


def small_job(folder: Path, name: str, remarks: str = "", *, shift_um: float = 0.0) -> Path:
    job = folder / name
    job.mkdir(parents=True)
    toml = (EXAMPLE / "job.toml").read_text(encoding="utf-8")
    toml = re.sub(r'(?s)remarks = """.*?"""', f'remarks = "{remarks}"', toml)
    toml = toml.replace('id = "plane-simulated"', f'id = "{name}"')
    toml = toml.replace(', "straightness_y_z"', "")
    (job / "job.toml").write_text(toml, encoding="utf-8")
    head, *rows = (EXAMPLE / "recording.csv").read_text(encoding="utf-8").splitlines()
    some = rows[:10]
    *cells, z = some[4].split(",")
    some[4] = ",".join([*cells, f"{float(z) + shift_um / 1000:.5f}"])
    (job / "recording.csv").write_text("\n".join([head, *some]) + "\n", encoding="utf-8")
    return job
