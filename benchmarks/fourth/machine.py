"""What a machine's errors do, written a third time: carriages that shift and turn what they carry, put together as bodies.

Each effect takes points (n, 3), mm, and the columns beside them, and gives true less indicated points for one unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.concealed.physics import Error

LOW, HIGH = np.array([0.0, 0.0, -500.0]), np.array([900.0, 600.0, 0.0])
"""Of the travels, mm."""
UM, ARCSEC = 1e-3, np.pi / 180 / 3600
CARRIED = np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
"""What of a point's place each carriage carries: X the axes Y and Z, Y the axis Z."""
NEEDS = {
    "hysteresis": "approach_x", "play": "approach_x", "windup": "approach_x", "drift": "time_s", "settling": "time_s",
    "scale_drift": "time_s", "scale_settling": "time_s", "thermal_scale": "temp_x_c", "thermal_squareness": "temp_x_c",
    "thermal_gradient": "temp_table_top_c", "thermal_artefact": "temp_artefact_c", "ram_sag": "load_kg", "probe": "nx",
    "artefact_sag": "outward",
}  # fmt: skip
"""Beginnings of names, and the column without which an effect could not be."""


def _u(p: np.ndarray, a: int) -> np.ndarray:
    return np.asarray((p[:, a] - LOW[a]) / (HIGH[a] - LOW[a]))


def _arch(p: np.ndarray, a: int) -> np.ndarray:
    return 4 * _u(p, a) * (1 - _u(p, a))


def _hours(c: Any) -> np.ndarray:
    return np.asarray(c["time_s"] / 3600)


def _settled(c: Any) -> np.ndarray:
    return -np.expm1(-_hours(c) / c["hours"])


def _moved(b: int, part: Any) -> Error:
    """Along an axis, by so many micrometres."""
    return lambda p, c: np.outer(UM * part(p, c), np.eye(3)[b])


def _scaled(a: int, part: Any) -> Error:
    """One unit of a scale is a millionth."""
    return lambda p, c: np.outer(1e-6 * p[:, a] * part(c), np.eye(3)[a])


def _turned(carriage: int, about: int, part: Any) -> Error:
    """A carriage by so many seconds of arc, with all that it carries."""
    return lambda p, c: np.cross(np.outer(ARCSEC * part(p, c), np.eye(3)[about]), p * CARRIED[carriage])


def _leaning(moves: int, by: int, part: Any) -> Error:
    return lambda p, c: np.outer(-ARCSEC * p[:, by] * part(c), np.eye(3)[moves])


def _probing(part: Any) -> Error:
    def e(p: np.ndarray, c: Any) -> np.ndarray:
        normal = np.stack([c["nx"], c["ny"], c["nz"]], axis=1)
        return UM * normal * np.asarray(part(np.arctan2(c["ny"], c["nx"]), c))[:, None]

    return e


def _of_axis(a: int, name: str) -> dict[str, Error]:
    middle, sense = (LOW[a] + HIGH[a]) / 2, f"approach_{name}"
    return {
        "scale": _scaled(a, lambda c: 1.0),
        "scale_curvature": _moved(a, lambda p, c: _arch(p, a)),
        "scale_joint": _moved(a, lambda p, c: np.heaviside(_u(p, a) - c["at"], 0.0)),
        "periodic_scale": _moved(a, lambda p, c: np.sin(2 * np.pi * p[:, a] / c["period"] + c["phase"])),
        "hysteresis": _moved(a, lambda p, c: c[sense] / 2),
        "windup": _moved(a, lambda p, c: c[sense] * (p[:, a] - middle) / 2000),
        "drift": _moved(a, lambda p, c: _hours(c)),
        "settling": _moved(a, lambda p, c: _settled(c)),
        "scale_drift": _scaled(a, _hours),
        "scale_settling": _scaled(a, _settled),
        "thermal_scale": _scaled(a, lambda c: c[f"temp_{name}_c"] - 20),
    } | ({
        "twist": _turned(a, a, lambda p, c: _arch(p, a)),
        "ram_sag": _moved(2, lambda p, c: -c["load_kg"] * _u(p, a) ** 3),
    } if a < 2 else {})  # fmt: skip


def _of_two(a: int, b: int) -> dict[str, Error]:
    found = {
        "straightness": _moved(b, lambda p, c: _arch(p, a)),
        "wear": _moved(b, lambda p, c: np.exp(-((_u(p, a) - c["at"]) ** 2) * 72)),
        "play": _moved(b, lambda p, c: c[f"approach_{'xyz'[a]}"] / 2),
    }
    turned = {"rotation": _turned(a, b, lambda p, c: (p[:, a] - LOW[a]) / 1000)} if a < 2 else {}
    return turned if a == b else found | turned


def _of_plane(a: int, b: int, out: int) -> dict[str, Error]:
    low, high = sorted((a, b))
    return {
        "squareness": _leaning(low, high, lambda c: 1.0),
        "thermal_squareness": _leaning(low, high, lambda c: sum(c[f"temp_{name}_c"] for name in "xyz") / 3 - 20),
        "bowl": _moved(out, lambda p, c: _arch(p, a) * _arch(p, b)),
    }


def effects(has: Mapping[str, Any]) -> dict[str, Error]:
    """All that could act on a recording that has some columns, by the name that it has in a catalogue."""
    found = {f"{key}_{name}": e for a, name in enumerate("xyz") for key, e in _of_axis(a, name).items()}
    found |= {f"{key}_{'xyz'[a]}_{'xyz'[b]}": e for a in range(3) for b in range(3) for key, e in _of_two(a, b).items()}
    for name, axes in {"xy": (0, 1, 2), "yz": (1, 2, 0), "zx": (2, 0, 1)}.items():
        found |= {f"{key}_{name}": e for key, e in _of_plane(*axes).items()}
    for count, end in ((2, "_2"), (3, ""), (4, "_4"), (6, "_6")):
        found[f"probe_lobing{end}"] = _probing(lambda turn, c, k=count: np.cos(k * turn + c["phase"]))
    found["probe_radius"] = _probing(lambda turn, c: np.ones_like(turn))
    warmer = lambda p, c: (c["temp_table_top_c"] - c["temp_table_bottom_c"]) * p[:, 0] / 1000  # noqa: E731
    found["thermal_gradient"] = _turned(0, 1, warmer)
    found["thermal_artefact"] = lambda p, c: 1e-6 * (20 - c["temp_artefact_c"])[:, None] * c["about"]
    found["artefact_sag"] = lambda p, c: UM * c["outward"] * (c["outward"][:, :2] ** 2).sum(axis=1)[:, None] / 2
    lacks = tuple(name for name, column in NEEDS.items() if column not in has)
    lacks += ("thermal_artefact",) if "nx" in has else ()  # of a sphere that is its size
    return {name: e for name, e in found.items() if not name.startswith(lacks)}
