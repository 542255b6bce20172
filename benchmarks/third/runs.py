"""Positioning runs of real axes, as a public report of their acceptance has them, with play concealed in them or nothing.

The reports are of slit axes of an instrument at the European Spallation Source (stepper motors against a laser triangulation
sensor, 12 positions there and back): github.com/anderssandstrom/ecmc_bifrost_slits_sat at 26767461, whose files name no
licence. They are no part of this project: ``--runs FOLDER`` of the study reads ``*.md`` of a copy.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.third.judging import QUIET, covariates_of, forms_of
from benchmarks.third.running import diagnosed

PLAY = 40.0
"""Concealed, µm."""
_ROW = re.compile(r"^\d+ \| ([-\d.]+) \| [-\d.]+ \| [-\d.]+ \| ([-\d.]+) \| ", re.MULTILINE)


def runs(folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Names, and rows of set position and reading, mm, and direction of travel; what was out of range is left out."""
    for file in sorted(folder.rglob("report*.md")):
        parts = file.read_text(encoding="utf-8").split("## Accuracy based on ")[1:]
        ways = {
            sense: part for part in parts for sense in ("Positive", "Negative") if f"{sense} Direction" in part[:80]
        }
        if len(ways) == 2:
            yield file.relative_to(folder).with_suffix("").as_posix(), np.array([
                (float(place), float(reading), sign)
                for sense, sign in (("Positive", 1.0), ("Negative", -1.0)) for place, reading in _ROW.findall(ways[sense])
            ])  # fmt: skip


def repeats(run: np.ndarray) -> tuple[float, float, float]:
    """Standard deviation of positions' mean errors and of one reading, µm, the mean of each way and a straight line taken out;
    and the p-value of the first being no more than the second makes it."""
    places = [p for p in np.unique(run[:, 0]) if np.sum(run[:, 0] == p) == 2]
    error = np.array(
        [[float(np.diff(run[(run[:, 0] == p) & (run[:, 2] == s), :2])[0, 0]) for s in (1, -1)] for p in places]
    )
    error = 1e3 * (error - error.mean(axis=0))
    means, apart = error.mean(axis=1), error[:, 0] - error[:, 1]
    means = means - np.polyval(np.polyfit(places, means, 1), places)
    n = len(places)
    of_means, of_one = float(np.sum(means**2)) / (n - 2), float(np.sum(apart**2)) / (2 * (n - 1))
    return float(np.sqrt(of_means)), float(np.sqrt(of_one)), float(stats.f.sf(2 * of_means / of_one, n - 2, n - 1))


def written(folder: Path, run: np.ndarray, play_um: float) -> Path:
    """The job folder of a run in which play is concealed: there, and back in the order in which it was gone."""
    folder.mkdir(parents=True, exist_ok=True)
    there, back = run[run[:, 2] > 0], run[run[:, 2] < 0][::-1]
    rows = ["measurement,point,repeat,x_mm,y_mm,z_mm,reference_mm,approach_x"]
    for k, (place, reading, sense) in enumerate(np.concatenate([there, back]), 1):
        reference = place - run[:, 0].min()
        rows.append(f"1,{k},1,{reading - 5e-4 * play_um * sense:.4f},0,0,{reference:.4f},{int(sense)}")
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "job.toml").write_text(
        '[job]\nid = "run"\ndate = 2020-12-13\n[machine]\nname = "slit axis"\nchain = "XYZ"\n'
        "travel_mm = { x = [0, 65], y = [0, 1], z = [0, 1] }\n"
        '[artefact]\nkind = "step_gauge"\n[recording]\nfile = "recording.csv"\n[model]\neffects = ["scale_x"]\n',
        encoding="utf-8",
    )
    return folder


def table(folder: Path, jobs: Path) -> list[str]:
    """Diagnose every run as it was recorded and with play, and what is said of each."""
    lines = ["## Positioning runs of real axes", "",
             "Slit axes of an instrument against a laser triangulation sensor, twelve positions there and back (a public "
             "report of their acceptance, `benchmarks/third/runs.py`), as recorded and with 40 µm of play concealed.", "",
             "| axis | positions | one reading | p of no difference | as recorded | with play | play said | others |",
             "| --- | --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for name, run in runs(folder):
        means, one, p = repeats(run)
        said = [diagnosed(written(jobs / name / str(play), run, play)) for play in (0.0, PLAY)]
        own = [each for each in said[1]["effects"] if each["effect"] == "hysteresis_x"]
        gap = own[0]["parameters"]["gap_um"] if own else None
        before = [
            each["parameters"]["gap_um"]["value"] for each in said[0]["effects"] if each["effect"] == "hysteresis_x"
        ]
        lines.append(
            f"| {name} | ±{means:.1f} µm | ±{one:.1f} µm | {p:.1g} | {_words(said[0])} | {said[1]['verdict']} | "
            f"{_gap(gap, own[0] if own else {})}{f' ({before[0]:.1f} before)' if before else ''} | "
            f"{', '.join(e['effect'] for e in said[1]['effects'] if e['effect'] != 'hysteresis_x') or '–'} |"
        )
    return lines


def _gap(gap: dict[str, Any] | None, effect: dict[str, Any]) -> str:
    return (
        "–" if gap is None else f"{gap['value']:.1f}, u = {gap['u']:.1f} µm (probability {effect['probability']:.2f})"
    )


def _words(said: dict[str, Any]) -> str:
    names = [each["effect"] for each in said["effects"]]
    functions = (said.get("empirical") or {}).get("functions", ())
    names += [f"a function of {' and '.join(sorted(covariates_of(each)))}" for each in functions]
    names += [str(each["form"]["name"]) for each in forms_of(said)]
    return f"{said['verdict']}{': ' + ', '.join(names) if names and said['verdict'] not in QUIET else ''}"
