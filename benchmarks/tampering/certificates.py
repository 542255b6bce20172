"""Good certificates: one of each kind of job to be altered, and as many as are asked for to be verified as they are."""

from __future__ import annotations

import csv
import io
import random
import shutil
from pathlib import Path

from benchmarks.tampering.cases import SEED, SIGNED
from benchmarks.tampering.signatures import ROOT as ROOT_PEM, signed
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.report import write_report

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
REPORTED = (
    "iota-1102-20C", "iota-1102-20C-compensated", "iota-1102-20C-against-simulation", "bryan-simulated", "digitizer-simulated",
    "gauge-blocks-simulated", "plane-simulated", "plate-simulated", "plate-two-dates-simulated", "shift-plate-simulated",
    "shift-simulated", "sphere-simulated", "step-gauge-simulated", "triangle-simulated",
)  # fmt: skip
DIAGNOSED = ("iota-1102-20C", "iota-1102-maps", "plane-simulated")
_TEXTS = ("", "Prüfung nach Auftrag 17/3", "Étalonnage n° 5 & <3>", "検査", "Řízení “jakosti”")


def bases(folder: Path) -> dict[str, dict[str, bytes]]:
    """A certificate or a diagnosis of each kind with its inputs, made once and kept."""
    found = {}
    for write, names in ((write_report, REPORTED), (write_diagnosis, DIAGNOSED)):
        for name in names:
            label = name if write is write_report else f"{name}-diagnosis"
            out = folder / label
            if not (out / "manifest.json").exists():
                shutil.rmtree(out, ignore_errors=True)
                write(EXAMPLES / name, out)
            files = {one.name: one.read_bytes() for one in out.iterdir() if one.name != "manifest.json"}
            inputs = {one.name: one.read_bytes() for one in (EXAMPLES / name).iterdir() if one.is_file()}
            found[label] = {**inputs, **files}
    if not (folder / SIGNED / ROOT_PEM).exists():
        signed(folder / SIGNED, folder / REPORTED[0])
    return {**found, SIGNED: {one.name: one.read_bytes() for one in (folder / SIGNED).iterdir()}}


def good(number: int, folder: Path, seed: int = SEED) -> Path:
    """Folder of a certificate of another recording: noise on its readings, another seed, words of other languages."""
    rng = random.Random(f"good {seed}:{number}")
    name = rng.choice([one for one in REPORTED if "against" not in one and "compensated" not in one])
    job, out = folder / f"job-{number}", folder / f"report-{number}"
    shutil.rmtree(job, ignore_errors=True)
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(EXAMPLES / name, job)
    toml = (job / "job.toml").read_text(encoding="utf-8")
    text = rng.choice(_TEXTS)
    if text and "remarks" not in toml:
        toml = toml.replace("[job]\n", f'[job]\nremarks = "{text}"\n', 1)
    (job / "job.toml").write_text(toml, encoding="utf-8")
    recording = next(job.glob("*.csv")) if not (job / "recording.csv").exists() else job / "recording.csv"
    recording.write_text(_noisy(recording.read_text(encoding="utf-8"), rng), encoding="utf-8")
    write = write_diagnosis if rng.random() < 0.15 and not name.startswith("shift") else write_report
    write(job, out, seed=rng.randrange(1000))
    return out


def _noisy(text: str, rng: random.Random) -> str:
    """Coordinates with a little noise more."""
    comments = [line for line in text.splitlines() if line.startswith("#")]
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))
    moved = [i for i, name in enumerate(rows[0]) if name in ("x_mm", "y_mm", "z_mm", "reading_mm")]
    for row in rows[1:]:
        for i in moved:
            if row[i]:
                row[i] = f"{float(row[i]) + rng.gauss(0, 2e-4):.5f}"
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return "\n".join([*comments, out.getvalue()])
