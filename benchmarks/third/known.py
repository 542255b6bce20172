"""What effects of a catalogue look like in a recording: those of the second study and what machines have besides."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.concealed.physics import SECOND, TRAVEL, Error, component, lobes, place
from benchmarks.second.cases import UNSEEN, Seen, visible
from benchmarks.third.cases import Hidden

SETTLING = np.geomspace(0.05, 20.0, 40)
"""Times, h, over which what settles may do so."""
LAGS = np.geomspace(0.05, 5.0, 25)
"""Times, h, by which a scale may be behind its thermometer."""
AT = np.linspace(0.04, 0.96, 93)
"""Places in a travel, at which a guideway is worn or a scale joined."""
DECAYS = np.geomspace(0.05, 20.0, 30)
"""Ways, mm, after which what stuck at a reversal has caught up."""


def _settling(a: int, hours: float, scale: bool, p: np.ndarray, c: dict) -> np.ndarray:
    value = 1 - np.exp(-c["time_s"] / 3600 / hours)
    return component(a, 1e-3 * value * (1e-3 * p[:, a] if scale else 1.0))


def _warm_angle(moves: int, by: int, p: np.ndarray, c: dict) -> np.ndarray:
    warm = np.mean([c[f"temp_{a}_c"] for a in "xyz"], axis=0) - 20
    return component(moves, -SECOND * warm * p[:, by])


def _play(a: int, b: int, grows: bool, p: np.ndarray, c: dict) -> np.ndarray:
    size = 1e-3 * (p[:, a] - TRAVEL[a].mean()) if grows else 1.0
    return component(b, 5e-4 * size * c[f"approach_{'xyz'[a]}"])


def _arch(p: np.ndarray, a: int) -> np.ndarray:
    return 4 * place(p, a) * (1 - place(p, a))


def _twisted(a: int, p: np.ndarray, c: dict) -> np.ndarray:
    """The carriage X carries y and z, Y carries z; each rolls about itself."""
    roll = SECOND * _arch(p, a)
    return component(1, -roll * p[:, 2]) + component(2, roll * p[:, 1]) if a == 0 else component(0, roll * p[:, 2])


def _worn(a: int, b: int, at: float, p: np.ndarray, c: dict) -> np.ndarray:
    return component(b, 1e-3 * np.exp(-72 * (place(p, a) - at) ** 2))


def _joined(a: int, at: float, p: np.ndarray, c: dict) -> np.ndarray:
    return component(a, 1e-3 * (place(p, a) > at))


def _behind(a: int, hours: float, p: np.ndarray, c: dict) -> np.ndarray:
    """A body that follows its thermometer, in steps of a thousandth of the whole time."""
    t, warm = c["time_s"] / 3600, c[f"temp_{'xyz'[a]}_c"]
    fine = np.linspace(t.min(), t.max(), 4001)
    moments = np.unique(t)
    of_room = np.interp(fine, moments, [warm[t == one].mean() for one in moments])
    body = np.full_like(fine, of_room[0])
    kept = np.exp(-(fine[1] - fine[0]) / hours)
    for k in range(1, len(fine)):
        body[k] = kept * body[k - 1] + (1 - kept) * 0.5 * (of_room[k] + of_room[k - 1])
    return component(a, 1e-6 * (np.interp(t, fine, body) - warm) * p[:, a])


def _daily(a: int, phase: float, scale: bool, p: np.ndarray, c: dict) -> np.ndarray:
    value = np.sin(2 * np.pi * c["time_s"] / 86400 + phase)
    return component(a, 1e-3 * value * (1e-3 * p[:, a] if scale else 1.0))


def _spike(a: int, decay: float, p: np.ndarray, c: dict) -> np.ndarray:
    axis = "xyz"[a]
    return component(a, 1e-3 * c[f"approach_{axis}"] * np.exp(-c[f"since_reversal_{axis}_mm"] / decay))


def _head(a: int, p: np.ndarray, c: dict) -> np.ndarray:
    tip = np.column_stack([c[f"tip_{b}_mm"] for b in "xyz"])
    return SECOND * np.cross(np.eye(3)[a], tip)


def _structure(recorded: dict) -> dict[str, list[Error]]:
    """Surfaces, twist, wear, joints, loads: what a catalogue of machines has beyond straight lines."""
    planes = {"xy": (0, 1, 2), "yz": (1, 2, 0), "zx": (2, 0, 1)}
    found: dict[str, list[Error]] = {
        f"bowl_{plane}": [lambda p, c, a=a, b=b, o=o: component(o, 1e-3 * _arch(p, a) * _arch(p, b))]  # type: ignore[misc]
        for plane, (a, b, o) in planes.items()
    }
    found |= {f"twist_{'xyz'[a]}": [partial(_twisted, a)] for a in range(2)}
    found |= {f"wear_{'xyz'[a]}_{'xyz'[b]}": [partial(_worn, a, b, at) for at in AT]
              for a in range(3) for b in range(3) if a != b}  # fmt: skip
    found |= {f"scale_joint_{'xyz'[a]}": [partial(_joined, a, at) for at in AT] for a in range(3)}
    for a, name in enumerate("xyz"):
        if "tip_x_mm" in recorded:
            found.setdefault("head_alignment", []).append(partial(_head, a))
        if f"acceleration_{name}_m_s2" in recorded:
            found[f"inertia_{name}"] = [
                lambda p, c, a=a, name=name: component(a, 1e-3 * c[f"acceleration_{name}_m_s2"])  # type: ignore[misc]
            ]
        if f"since_reversal_{name}_mm" in recorded:
            found[f"reversal_spike_{name}"] = [partial(_spike, a, decay) for decay in DECAYS]
        if "load_kg" in recorded and name != "z":
            found[f"ram_sag_{name}"] = [
                lambda p, c, a=a: component(2, -1e-3 * c["load_kg"] * place(p, a) ** 3)  # type: ignore[misc]
            ]
    return found


def _probing(recorded: dict) -> dict[str, list[Error]]:
    if "nx" not in recorded:
        return {}
    turns = np.linspace(0, np.pi, 36, False)
    return {
        f"probe_lobing_{n}": [lambda p, c, n=n, turn=turn: lobes(n)(p, c | {"phase": turn}) for turn in turns]  # type: ignore[misc]
        for n in (2, 4, 6)
    }


def further(recorded: dict) -> dict[str, list[Error]]:
    """Effects beyond those of the second study, each with the forms that it may take."""
    found = _structure(recorded) | _probing(recorded)
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
            if np.ptp(recorded["time_s"]) >= 43200:
                for family in ("daily", "daily_scale"):
                    turns = np.linspace(0, np.pi, 36, False)
                    found[f"{family}_{name}"] = [partial(_daily, a, turn, "scale" in family) for turn in turns]
            if f"temp_{name}_c" in recorded:
                found[f"thermal_lag_{name}"] = [partial(_behind, a, hours) for hours in LAGS]
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
