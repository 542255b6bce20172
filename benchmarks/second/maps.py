"""The real machine: its errors as a laser interferometer found them, put together as a rigid body's (chain XYZ), and sets of
its maps at three temperatures in which an expansion is concealed."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.concealed.physics import SECOND
from benchmarks.second.artefacts import EXAMPLES

SQUARENESS = {20: (-173.0, -19.0, 21.0), 25: (-178.0, -4.0, 42.0), 30: (-172.0, -20.0, 1.0)}
"""XY, YZ, ZX in seconds of arc, table 7 of the source."""
JUMPS = {"y": (25.0,), "z": (-125.0, -100.0, -50.0)}
"""Positions, mm, of readings of scales at 30 °C that jump by 3 to 15 µm off their neighbours."""
COLUMNS = ("dx_um", "dy_um", "dz_um", "rx_arcsec", "ry_arcsec", "rz_arcsec")


@cache
def tables(temperature: int) -> dict[str, np.ndarray]:
    """(places, 7) of each axis: position in mm, displacements in mm, rotations in rad."""
    with (EXAMPLES / "iota-1102-maps" / f"error_map_{temperature}C.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    factors = np.array([1.0, 1e-3, 1e-3, 1e-3, SECOND, SECOND, SECOND])
    return {
        axis: np.array(
            [[float(row[name]) for name in ("position_mm", *COLUMNS)] for row in rows if row["axis"] == axis]
        )
        * factors
        for axis in "xyz"
    }


def error(p: np.ndarray, temperature: int) -> np.ndarray:
    """e (n, 3), mm, at readings p; methods.md, equations 11 to 13. Beyond the tables their last value holds."""
    d, r = np.zeros((3, len(p), 3)), np.zeros((3, len(p), 3))
    for i, axis in enumerate("xyz"):
        table = tables(temperature)[axis]
        table = table[np.argsort(table[:, 0])]
        for b in range(3):
            d[i, :, b] = np.interp(p[:, i], table[:, 0], table[:, 1 + b])
            r[i, :, b] = np.interp(p[:, i], table[:, 0], table[:, 4 + b])
    xy, yz, zx = (SECOND * angle for angle in SQUARENESS[temperature])
    y, z = p[:, 1], p[:, 2]
    e = d.sum(axis=0)
    e[:, 0] += -y * r[0, :, 2] + z * (r[0, :, 1] + r[1, :, 1]) - y * xy - z * zx
    e[:, 1] += -z * (r[0, :, 0] + r[1, :, 0]) - z * yz
    e[:, 2] += y * r[0, :, 0]
    return e


@dataclass(frozen=True)
class Maps:
    """A set of maps with something concealed: the folder's name, its files, and the truth."""

    name: str
    files: Mapping[str, str]
    truth: dict


def without_expansion(temperature: int) -> dict[str, np.ndarray]:
    """The tables of a map, their own expansion taken off: the least-squares one of all maps' differences from their mean,
    each map starting anywhere, without the readings that jump."""
    found = {axis: table.copy() for axis, table in tables(temperature).items()}
    away = np.array([each - np.mean(list(SQUARENESS)) for each in SQUARENESS])
    for i, axis in enumerate("xyz"):
        kept = ~np.isin(found[axis][:, 0], JUMPS.get(axis, ()))
        values = np.array([tables(each)[axis][kept, 1 + i] for each in SQUARENESS])
        values = values - values.mean(axis=0)
        place = found[axis][kept, 0] - found[axis][kept, 0].mean()
        column = away[:, None] * place
        slope = np.sum(column * (values - values.mean(axis=1, keepdims=True))) / np.sum(column**2)
        found[axis][:, 1 + i] -= slope * (temperature - 20) * found[axis][:, 0]
    return found


def concealed(seed: int, number: int, name: str) -> Maps:
    """The real maps with their differences dealt anew among the temperatures, and in most an expansion of one scale."""
    random = np.random.default_rng([seed, 99, number])
    sets = [without_expansion(temperature) for temperature in SQUARENESS]
    scale = int(random.integers(3))
    alpha = 0.0 if number % 4 == 3 else float(random.choice([-1, 1]) * random.uniform(3, 15))
    for i, axis in enumerate("xyz"):
        values = np.array([each[axis] for each in sets])
        middle = values.mean(axis=0)
        for column in range(1, 7):
            dealt = random.choice([-1, 1]) * (values - middle)[random.permutation(3), :, column]
            for each, part in zip(sets, dealt, strict=True):
                each[axis][:, column] = middle[:, column] + part
        if i == scale:
            for each, temperature in zip(sets, SQUARENESS, strict=True):
                each[axis][:, 1 + i] += 1e-6 * alpha * (temperature - 20) * each[axis][:, 0]
    files = {f"map_{t}.csv": _text(each) for t, each in zip(SQUARENESS, sets, strict=True)}
    listed = ", ".join(f'{{ file = "map_{t}.csv", temperature_c = {t}.0 }}' for t in SQUARENESS)
    files["job.toml"] = (
        '[job]\nid = "concealed"\ndate = 2026-01-01\norigin = "simulated"\n[machine]\nname = "simulated"\nchain = "XYZ"\n'
        f"travel_mm = {{ x = [0, 900], y = [0, 550], z = [-500, 0] }}\nerror_map = [{listed}]\n"
        '[artefact]\nkind = "error_map"\n[model]\neffects = []\n'
    )
    hidden = {f"thermal_scale_{'xyz'[scale]}": alpha} if alpha else {}
    truth = {"kind": "maps", "design": "error maps", "hidden": hidden, "rivals": {}, "wanted": {}, "simulated": False,
             "named": [], "noise": {"kind": "real"}}  # fmt: skip
    return Maps(name, files, truth)


def _text(set_of: Mapping[str, np.ndarray]) -> str:
    factors = np.array([1.0, 1e-3, 1e-3, 1e-3, SECOND, SECOND, SECOND])
    rows = [",".join(("axis", "position_mm", *COLUMNS))]
    rows += [",".join([axis, *(f"{value:.4f}" for value in row / factors)]) for axis in "xyz" for row in set_of[axis]]
    return "\n".join(rows) + "\n"
