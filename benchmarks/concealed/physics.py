"""Errors of a machine and of an artefact, written a second time from the definitions of the effects alone.

Each takes points p (n, 3), mm, and what is recorded beside them, and gives e (n, 3), mm, for one unit of its parameter:
true = indicated + e. Nothing here comes from the package.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])
SECOND = np.pi / 648000
Error = Callable[[np.ndarray, dict], np.ndarray]


def component(axis: int, value: np.ndarray) -> np.ndarray:
    e = np.zeros((len(value), 3))
    e[:, axis] = value
    return e


def place(p: np.ndarray, a: int) -> np.ndarray:
    """Where in its travel an axis stands, 0 … 1."""
    low, high = TRAVEL[a]
    return (p[:, a] - low) / (high - low)


def bow(a: int, b: int) -> Error:
    return lambda p, c: component(b, 1e-3 * (1 - (2 * place(p, a) - 1) ** 2))


def turn(a: int, b: int) -> Error:
    def e(p: np.ndarray, c: dict) -> np.ndarray:
        angle = np.zeros_like(p)
        angle[:, b] = SECOND * (p[:, a] - TRAVEL[a, 0]) / 1000
        carried = p.copy()
        carried[:, 0] = 0
        if a == 1:
            carried[:, 1] = 0
        return np.cross(angle, carried)

    return e


def backlash(a: int) -> Error:
    return lambda p, c: component(a, 5e-4 * c[f"approach_{'xyz'[a]}"])


def warm(a: int) -> Error:
    return lambda p, c: component(a, 1e-6 * (c[f"temp_{'xyz'[a]}_c"] - 20) * p[:, a])


def wave(a: int) -> Error:
    return lambda p, c: component(a, 1e-3 * np.sin(2 * np.pi * p[:, a] / c["period"] + c["phase"]))


def drift(a: int) -> Error:
    return lambda p, c: component(a, 1e-3 * c["time_s"] / 3600)


def bending(p: np.ndarray, c: dict) -> np.ndarray:
    angle = np.zeros_like(p)
    angle[:, 1] = SECOND * (c["temp_table_top_c"] - c["temp_table_bottom_c"]) * (p[:, 0] - TRAVEL[0, 0]) / 1000
    return np.cross(angle, p * [0.0, 1.0, 1.0])


def longer(c: dict, change: np.ndarray) -> np.ndarray:
    """A bar that is longer by ``change``: each end indicated that much further out, half each."""
    return -0.5 * change[:, None] * c["outward"]


def lobes(count: int) -> Error:
    return lambda p, c: 1e-3 * np.cos(count * np.arctan2(c["ny"], c["nx"]) + c["phase"])[:, None] * normal(c)


def normal(c: dict) -> np.ndarray:
    return np.column_stack([c["nx"], c["ny"], c["nz"]])


BAR: dict[str, Error] = {
    "thermal_artefact": lambda p, c: longer(c, 1e-6 * c["length"] * (c["temp_artefact_c"] - 20)),
    "artefact_sag": lambda p, c: longer(c, -1e-3 * (1 - c["outward"][:, 2] ** 2)),
}
PROBE: dict[str, Error] = {"probe_radius": lambda p, c: 1e-3 * normal(c), "probe_lobing": lobes(3)}
TABLE: dict[str, Error] = {"thermal_gradient": bending}
PLACE: dict[str, Error] = {
    **{f"scale_{a}": (lambda p, c, i=i: component(i, 1e-6 * p[:, i])) for i, a in enumerate("xyz")},
    "squareness_xy": lambda p, c: component(0, -SECOND * p[:, 1]),
    "squareness_yz": lambda p, c: component(1, -SECOND * p[:, 2]),
    "squareness_zx": lambda p, c: component(0, -SECOND * p[:, 2]),
    **{f"straightness_{'xyz'[a]}_{'xyz'[b]}": bow(a, b) for a in range(3) for b in range(3) if a != b},
    **{f"rotation_{'xyz'[a]}_{'xyz'[b]}": turn(a, b) for a in range(2) for b in range(3)},
    **{f"periodic_scale_{a}": wave(i) for i, a in enumerate("xyz")},
}
DRIVE: dict[str, Error] = {f"hysteresis_{a}": backlash(i) for i, a in enumerate("xyz")}
WARM: dict[str, Error] = {f"thermal_scale_{a}": warm(i) for i, a in enumerate("xyz")}
TIME: dict[str, Error] = {f"drift_{a}": drift(i) for i, a in enumerate("xyz")}
KNOWN = PLACE | DRIVE | WARM | TIME | TABLE | BAR | PROBE

LARGEST = {
    "scale": 200, "squareness": 250, "straightness": 80, "rotation": 60, "periodic_scale": 15, "hysteresis": 30,
    "thermal_scale": 40, "drift": 25, "thermal_gradient": 60, "thermal_artefact": 40, "artefact_sag": 40,
    "probe_radius": 30, "probe_lobing": 10,
}  # fmt: skip
"""Sizes beyond which an effect is no longer hidden but absurd, in the parameter's unit."""

UNIT = {"thermal_scale": 1e-6, "thermal_artefact": 1e-6}
"""What one unit here is in the unit of results.json."""


def kind_of(name: str) -> str:
    return max((k for k in LARGEST if name.startswith(k)), key=len)


ELSEWHERE: dict[str, Error] = {
    "step in x": lambda p, c: component(1, 1e-3 * (p[:, 0] > 450)),
    "three waves of y along z": lambda p, c: component(2, 1e-3 * np.sin(3 * np.pi * p[:, 1] / 600)),
    "growing waves of x along x": lambda p, c: component(0, 1e-3 * np.sin(4 * np.pi * (p[:, 0] / 900) ** 2)),
    "cubic of z along y": lambda p, c: component(1, 4e-3 * ((p[:, 2] + 250) / 250) ** 3),
    "kink of y along y": lambda p, c: component(1, 1e-3 * np.abs(p[:, 1] - 300) / 100),
    "dent at one place": lambda p, c: component(2, 1e-3 * np.exp(-0.5 * np.sum(((p - [450, 300, -250]) / 130) ** 2, axis=1))),
    "bump in x": lambda p, c: component(0, 1e-3 * np.exp(-0.5 * ((p[:, 0] - 300) / 70) ** 2)),
    "cubic of x along z": lambda p, c: component(2, 4e-3 * (2 * place(p, 0) - 1) ** 3),
}  # fmt: skip
IN_TIME: dict[str, Error] = {
    "jump in time": lambda p, c: component(0, 1e-3 * (c["time_s"] > 0.55 * c["time_s"].max()) * p[:, 0] / 450),
    "a load nobody modelled": lambda p, c: 1e-6 * c["load_kg"][:, None] ** 2 * (p - [450, 300, -250]),
}
AROUND: dict[str, Error] = {"two lobes": lobes(2), "five lobes": lobes(5), "seven lobes": lobes(7)}

ROUGHLY: dict[str, Error] = {
    **{
        f"straightness_{'xyz'[a]}_{'xyz'[b]}": (
            lambda p, c, a=a, b=b: bow(a, b)(p, c) * (1 + 1.3 * (place(p, a) - 0.5))[:, None]
        )
        for a in range(3) for b in range(3) if a != b
    },
    **{f"hysteresis_{'xyz'[a]}": (lambda p, c, a=a: backlash(a)(p, c) * (0.5 + place(p, a))[:, None]) for a in range(3)},
    **{
        f"periodic_scale_{'xyz'[a]}": (
            lambda p, c, a=a: wave(a)(p, c) + component(a, 4e-4 * np.sin(4 * np.pi * p[:, a] / c["period"] + 1.0))
        )
        for a in range(3)
    },
}  # fmt: skip
"""Right mechanisms, shapes somewhat off: a bow with its top off the middle, backlash that grows, a second harmonic."""


def holds(truth: dict, name: str, size: float, parameter: str, low: float, high: float) -> bool:
    """Whether an interval holds the true parameter of an effect of this size; phases are taken above its lower end."""
    value = size * UNIT.get(kind_of(name), 1.0)
    if parameter == "amplitude_um":
        value = abs(size)
    elif parameter == "period_mm":
        value = truth["period"]
    elif parameter == "phase_rad":
        value = truth["phase"] + (np.pi if size < 0 else 0.0)
        value = low + (value - low) % (2 * np.pi)
    return bool(low <= value <= high)
