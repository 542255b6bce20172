"""What effects of a catalogue look like in a recording: those of the second study and what machines have besides."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.concealed.physics import SECOND, TRAVEL, Error, component, place
from benchmarks.second.cases import UNSEEN, Seen, visible
from benchmarks.third.cases import Hidden

SETTLING = np.geomspace(0.05, 20.0, 40)
"""Times, h, over which what settles may do so."""


def _settling(a: int, hours: float, scale: bool, p: np.ndarray, c: dict) -> np.ndarray:
    value = 1 - np.exp(-c["time_s"] / 3600 / hours)
    return component(a, 1e-3 * value * (1e-3 * p[:, a] if scale else 1.0))


def _warm_angle(moves: int, by: int, p: np.ndarray, c: dict) -> np.ndarray:
    warm = np.mean([c[f"temp_{a}_c"] for a in "xyz"], axis=0) - 20
    return component(moves, -SECOND * warm * p[:, by])


def _play(a: int, b: int, grows: bool, p: np.ndarray, c: dict) -> np.ndarray:
    size = 1e-3 * (p[:, a] - TRAVEL[a].mean()) if grows else 1.0
    return component(b, 5e-4 * size * c[f"approach_{'xyz'[a]}"])


def further(recorded: dict) -> dict[str, list[Error]]:
    """Effects beyond those of the second study, each with the forms that it may take."""
    found: dict[str, list[Error]] = {}
    for a, name in enumerate("xyz"):
        found[f"scale_curvature_{name}"] = [
            lambda p, c, a=a: component(a, 1e-3 * (1 - (2 * place(p, a) - 1) ** 2))  # type: ignore[misc]
        ]
        if "time_s" in recorded:
            found[f"settling_{name}"] = [partial(_settling, a, hours, False) for hours in SETTLING]
            found[f"scale_settling_{name}"] = [partial(_settling, a, hours, True) for hours in SETTLING]
            found[f"scale_drift_{name}"] = [
                lambda p, c, a=a: component(a, 1e-6 * c["time_s"] / 3600 * p[:, a])  # type: ignore[misc]
            ]
        if "approach_x" in recorded:
            found |= {f"play_{name}_{'xyz'[b]}": [partial(_play, a, b, False)] for b in range(3) if b != a}
            found[f"windup_{name}"] = [partial(_play, a, a, True)]
    if "temp_x_c" in recorded:
        planes = {"xy": (0, 1), "yz": (1, 2), "zx": (0, 2)}
        found |= {f"thermal_squareness_{plane}": [partial(_warm_angle, *axes)] for plane, axes in planes.items()}
    return found


def versions(seen: Seen) -> dict[str, list[np.ndarray]]:
    """Columns (m, c), whitened, of every effect, once for each form that it may take."""
    among = visible(seen.design)
    found = {name: seen.versions(name, among) for name in among}
    return found | {
        name: [seen.seen(error)[:, None] for error in errors] for name, errors in further(seen.design.recorded).items()
    }


def rivals(found: Hidden) -> dict[str, list[str]]:
    """Of each effect that is hidden, those that could stand in its place without anyone noticing."""
    every = {name: columns for name, columns in versions(found.seen).items() if name not in found.one.named}
    signals = {name: found.sizes[name] * found.seen.seen(error) for name, error in found.errors.items()}
    return {
        name: [
            rival for rival, forms in every.items() if rival not in signals
            and min(found.seen.left(signal, [*others(signals, name), v]) for v in forms) < UNSEEN
        ]
        for name, signal in signals.items()
    }  # fmt: skip


def others(signals: dict[str, np.ndarray], name: str) -> list[np.ndarray]:
    """Signals of all that is hidden but one."""
    return [signal for key, signal in signals.items() if key != name]


def left_by(
    found: Hidden, names: list[str], every: dict[str, list[np.ndarray]], seen: np.ndarray | None = None
) -> float:
    """√λ of what effects, each of the form that suits best, leave of all that is hidden, or of what was ``seen``."""
    signal = found.signal if seen is None else seen
    columns: list[np.ndarray] = []
    for name in names:
        if name in every:
            columns.append(min(every[name], key=lambda v: found.seen.left(signal, [*columns, v])))
    return found.seen.left(signal, columns)
