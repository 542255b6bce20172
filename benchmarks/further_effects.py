"""Whether effects beyond straight lines are named: ``python -m benchmarks.further_effects FILE [--each 3] [--seed 0]``.

Machines err by the equations of ``benchmarks/third/known.py``, which share no code with the package; noise, designs and jobs
are the third study's. Every effect is hidden at √λ of 8 to 15, in the artefacts that show it. FILE gets a line a case.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.concealed.physics import Error
from benchmarks.second import artefacts, noises
from benchmarks.second.artefacts import SIX, Placed
from benchmarks.second.cases import UNSEEN, Case, Seen, indicated, job, of_effects
from benchmarks.third.cases import DESIGNS
from benchmarks.third.judging import group_of
from benchmarks.third.known import further, versions
from benchmarks.third.running import diagnosed

NEW = ("bowl", "twist", "wear", "scale_joint", "ram_sag", "inertia", "reversal_spike", "thermal_lag", "daily", "daily_scale",
       "probe_lobing_", "head_alignment")  # fmt: skip
PLACED = {**DESIGNS, "sphere": artefacts.sphere}


def recorded_besides(random: np.random.Generator, placed: Placed) -> dict[str, np.ndarray]:
    """Columns that few recordings have: days, accelerations, ways since a reversal, three styli."""
    n = len(placed.true)
    styli = np.array([[0.0, 0, -60], [100, 0, -60], [0, -80, -90]])[(placed.measurement + placed.repeat) % 3]
    return {
        "time_s": placed.recorded["time_s"] * 108000 / np.ptp(placed.recorded["time_s"]),
        **{f"acceleration_{a}_m_s2": random.uniform(-2, 2, n) for a in "xyz"},
        **{f"since_reversal_{a}_mm": 60 * random.random(n) ** 3 for a in "xyz"},
        **{f"tip_{a}_mm": styli[:, i] for i, a in enumerate("xyz")},
    }


def case(random: np.random.Generator, name: str, number: int) -> tuple[Case, dict, float] | None:
    """One effect in one recording; nothing where this artefact does not show it."""
    probing = name.startswith(("probe", "head"))
    design = "sphere" if probing else ("ballbar", "plate", "step gauge")[number % 3]
    placed = PLACED[design](random)
    placed.recorded = placed.recorded | recorded_besides(random, placed)
    placed.recorded = {k: v for k, v in placed.recorded.items() if name.startswith("head") or not k.startswith("tip_")}
    noise = noises.drawn(random, str(random.choice(noises.KINDS[:-1])), placed)
    covariance = noises.of_observations(noises.of_coordinates(noise, placed), placed)
    named = ("probe_radius",) if probing else SIX
    seen = Seen(
        placed, named, False, covariance, placed.recorded | placed.extra | {"period": 97.0, "phase": 0.3}, noise.sigma
    )
    forms = further(placed.recorded).get(name, [])
    error: Error = forms[int(random.integers(len(forms)))]
    signal = seen.seen(error)
    largest = max(float(np.linalg.norm(seen.seen(form))) for form in forms)
    wanted, length = float(random.uniform(8, 15)), float(np.linalg.norm(signal))
    size = float(random.choice([-1, 1])) * wanted / max(length, 1e-300)
    moved = size * error(placed.true, seen.context)
    if length < 0.3 * largest or np.abs(moved).max() > 0.1:
        return None
    more = of_effects({name: error}, {name: size}, seen.context)
    shown = noises.displayed(noise, indicated(placed.true, more) + noises.readings(random, noise, placed))
    y = placed.D @ (shown - placed.true).ravel()
    one = Case(f"{name}-{number}", placed, noise, named, False, None, seen.context, shown, y,
               {"hidden": {name: size}}, None, np.arange(len(shown)))  # fmt: skip
    every = {key: columns for key, columns in versions(seen).items() if key not in named}
    alike = [
        key
        for key, columns in every.items()
        if key != name and min(seen.left(size * signal, [v]) for v in columns) < UNSEEN
    ]
    return one, {"design": design, "noise": noise.kind, "root_lambda": wanted, "largest_um": 1e3 * float(np.abs(moved).max()),
                 "alike": alike}, size  # fmt: skip


def said_of(folder: Path, name: str, alike: list[str]) -> dict[str, object]:
    """What a diagnosis names, and whether it is the effect, one of a group with it, or one that nobody could tell from it."""
    said = diagnosed(folder)
    names = {each["effect"]: group_of(each, said) for each in said.get("effects", ())}
    right = {key: name == key or name in group or key in alike for key, group in names.items()}
    return {"verdict": said["verdict"], "names": sorted(names), "named": name in names, "together": any(right.values()),
            "wrong": [key for key, good in right.items() if not good]}  # fmt: skip


def cases(seed: int, each: int) -> Iterator[dict[str, object]]:
    """Every effect so often, one line each."""
    random = np.random.default_rng(seed)
    full = {"time_s": np.array([0.0, 1e6]), "load_kg": 0, "approach_x": 0, "nx": 0, "tip_x_mm": 0, "temp_x_c": 0}
    full |= {f"{kind}_{a}{unit}": 0 for a in "xyz" for kind, unit in (("acceleration", "_m_s2"), ("since_reversal", "_mm"),
                                                                      ("temp", "_c"))}  # fmt: skip
    for name in (key for key in further(full) if key.startswith(NEW)):
        for number in range(each):
            found = next((one for _ in range(40) if (one := case(random, name, number)) is not None), None)
            if found is None:
                yield {"hidden": name, "skipped": True}
                continue
            one, truth, _ = found
            with tempfile.TemporaryDirectory() as folder:
                job(one, Path(folder), one.order)
                yield {"hidden": name, **truth, **said_of(Path(folder), name, truth["alike"])}


def main() -> None:
    """Run and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--each", type=int, default=3, help="cases of each effect")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    with chosen.file.open("w", encoding="utf-8") as out:
        for line in cases(chosen.seed, chosen.each):
            out.write(json.dumps(line) + "\n")
            out.flush()
            print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
