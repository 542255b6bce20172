"""Good certificates: one of each kind of job to be altered, and as many as are asked for to be verified as they are."""

from __future__ import annotations

import csv
import datetime as dt
import io
import random
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.tampering.cases import SEED, SIGNED
from benchmarks.tampering.signatures import ROOT as ROOT_PEM, signed
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.languages.translation import Code

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
REPORTED = (
    "iota-1102-20C", "iota-1102-20C-compensated", "iota-1102-20C-against-simulation", "bryan-simulated", "digitizer-simulated",
    "gauge-blocks-simulated", "plane-simulated", "plate-simulated", "plate-two-dates-simulated", "shift-plate-simulated",
    "shift-simulated", "sphere-simulated", "step-gauge-simulated", "triangle-simulated",
)  # fmt: skip
DIAGNOSED = ("iota-1102-20C", "iota-1102-maps", "plane-simulated")
GOOD = {name: 4.0 if name in ("digitizer-simulated", "gauge-blocks-simulated", "sphere-simulated") else 1.0
        for name in REPORTED if "against" not in name and "compensated" not in name}  # fmt: skip
"""How often each is made and verified as it is: the cheap ones more often."""
LANGUAGES: tuple[Code, ...] = ("en", "de", "fr", "ja")
_TEXTS = ("", "Prüfung nach Auftrag 17/3", "Étalonnage n° 5 & <3>", "検査", "Řízení “jakosti”")


@dataclass(frozen=True)
class Good:
    """What is made and verified as it is.

    Parameters
    ----------
    number : of the case.
    name : example that its job is made of.
    job : folder.
    command : report or diagnose.
    language, seed : of the command.
    signed : whether the report is signed, by a person for whom a trusted authority vouches.
    """

    number: int
    name: str
    job: Path
    command: str
    language: Code
    seed: int
    signed: bool

    @property
    def facts(self) -> dict[str, Any]:
        """For its record."""
        return {"number": self.number, "base": self.name, "command": self.command, "language": self.language,
                "signed": self.signed}  # fmt: skip


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


def good_job(number: int, folder: Path, seed: int = SEED) -> Good:
    """A job of another recording: noise on its readings, another seed, other words and language, perhaps signed."""
    rng = random.Random(f"good {seed}:{number}")
    name = rng.choices(list(GOOD), list(GOOD.values()))[0]
    job = folder / f"job-{number}"
    shutil.rmtree(job, ignore_errors=True)
    shutil.copytree(EXAMPLES / name, job)
    toml = (job / "job.toml").read_text(encoding="utf-8")
    text = rng.choice(_TEXTS)
    if text and "remarks" not in toml:
        toml = toml.replace("[job]\n", f'[job]\nremarks = "{text}"\n', 1)
    (job / "job.toml").write_text(toml, encoding="utf-8")
    recording = next(job.glob("*.csv")) if not (job / "recording.csv").exists() else job / "recording.csv"
    noise = 10 ** rng.uniform(-5, -3)
    recording.write_text(_noisy(recording.read_text(encoding="utf-8"), rng, noise), encoding="utf-8")
    command = "diagnose" if rng.random() < 0.1 and not name.startswith("shift") else "report"
    signed_ = command == "report" and rng.random() < 0.3
    return Good(number, name, job, command, rng.choice(LANGUAGES), rng.randrange(1000), signed_)


def write_good(this: Good, out: Path) -> None:
    """Its certificate or diagnosis, in this process."""
    if this.command == "diagnose":
        write_diagnosis(this.job, out, seed=this.seed, language=this.language)
        return
    from cmm_uq.app.commands.certificates.signing import Signing
    from cmm_uq.certificate.sign import signing_time

    signing = Signing(person()[0].signer, signing_time()) if this.signed else None
    write_report(this.job, out, seed=this.seed, language=this.language, signing=signing)


@cache
def person() -> tuple[Any, bytes]:
    """Who signs, with a key of this process, and the certificate of the authority that vouches for that one."""
    from tests.certificate.sign.authority import curve_key, issued, root

    now, anchor = dt.datetime.now(dt.UTC), root()
    days = dt.timedelta(days=1), dt.timedelta(days=300)
    return issued("A. Huber", curve_key(), anchor, first=now - days[0], last=now + days[1]), anchor.pem


def _noisy(text: str, rng: random.Random, noise: float) -> str:
    """Coordinates with a little noise more, in mm."""
    comments = [line for line in text.splitlines() if line.startswith("#")]
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))
    moved = [i for i, name in enumerate(rows[0]) if name in ("x_mm", "y_mm", "z_mm", "reading_mm")]
    for row in rows[1:]:
        for i in moved:
            if row[i]:
                row[i] = f"{float(row[i]) + rng.gauss(0, noise):.5f}"
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return "\n".join([*comments, out.getvalue()])
