"""The error map of Harris 2004 (tables 7 to 10, 20 °C) as readings of runs along axes, and what this program makes of them.

Run:  python benchmarks/compensation/harris_runs.py FOLDER       writes FOLDER/runs, a job, and FOLDER/bar-printed, the thesis'
                                                                 ballbar with the printed map
      cmm-uq report FOLDER/runs --out FOLDER/certificate
      cmm-uq compensate FOLDER/runs --new-map --out FOLDER/map
      python benchmarks/compensation/harris_runs.py FOLDER       again: writes FOLDER/bar-new, with that map, and compares
      cmm-uq compensate FOLDER/bar-printed --out FOLDER/printed  and the same of bar-new

One value a target and no direction, as the tables have it. Lines go through x = y = z = 0, where the other carriages do not
err, so that readings are the tables' figures. Squarenesses, by a ballbar in the thesis, are put into the straightnesses
along the two legs of a square. Rolls were not measured, and have no run.
"""

from __future__ import annotations

import csv
import re
import shutil
import sys
import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import AXES
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.error_map import ErrorMap, read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps

ROOT = Path(__file__).parents[2]
MAP = ROOT / "tests/machine/physics/harris2004/error_map_20C.csv"
SQUARENESS = {"xy": -173.0, "yz": -19.0, "zx": 21.0}  # table 7
LEG = {frozenset("xy"): 1, frozenset("yz"): 2, frozenset("zx"): 3}  # setting of a square
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ROTATIONS = ("rotation_x_y", "rotation_x_z", "rotation_y_x", "rotation_y_z", "rotation_z_x", "rotation_z_y")
BARS = ROOT / "examples" / "iota-1102-20C"
HEADER = (
    "measurement,point,repeat,x_mm,y_mm,z_mm,reading_um,reading_arcsec,read_x,read_y,read_z,turn_x,turn_y,turn_z,square"
)
TOML = f"""\
# Readings of Harris 2004, tables 7 to 10, put together by benchmarks/compensation/harris_runs.py.

[job]
id = "iota-1102-20C-runs"
date = 2004-09-01
place = "McMaster University, Hamilton, Ontario"
procedure = "Laser interferometer, every 25 mm, mean of three or five runs; squarenesses of table 7"

[machine]
name = "DEA Iota 1102"
manufacturer = "DEA"
owner = "McMaster University"
chain = "XYZ"
travel_mm = {{ x = [0, 900], y = [0, 550], z = [-500, 0] }}

[artefact]
kind = "axis_runs"
name = "Laser interferometer"
u_scale_um_per_m = 0.5     # not stated in the source
u_square_arcsec = 1.0      # the same

[recording]
file = "recording.csv"

[model]
effects = {[*SIX, *ROTATIONS]}
""".replace("'", '"')


def rows_of_table(table: ErrorMap) -> list[str]:
    """Five runs of each carriage: its position, two straightnesses with what the squareness adds, pitch and yaw."""
    found, number = [], 0
    for i, axis in enumerate(table.axes):
        along = AXES[i]
        for column in range(6):
            kind, other = divmod(column, 3)
            if kind == 1 and other == i:
                continue
            number += 1
            values = axis.errors[:, column] / (ARCSECOND if kind else 1e-3)
            pair = "".join(sorted((along, AXES[other]))) if other != i else ""
            plane = "zx" if pair == "xz" else pair
            square = LEG[frozenset(plane)] if plane and kind == 0 else 0
            if plane and kind == 0 and (along == "z" or (plane == "xy" and along == "y")):  # the axis that leans
                values = values - SQUARENESS[plane] * ARCSECOND * axis.positions * 1e3
            vector = np.eye(3, dtype=int)[other]
            read, turn = (vector, 0 * vector) if kind == 0 else (0 * vector, vector)
            for point, (at, value) in enumerate(zip(axis.positions, values, strict=True), 1):
                xyz = np.where(np.arange(3) == i, at, 0.0)
                both = (f"{value:.4f}", "0") if kind == 0 else ("0", f"{value:.4f}")
                found.append(",".join(map(str, [number, point, 1, *xyz, *both, *read, *turn, square])))
    return found


def bar_job(folder: Path, source: Path, keys: str) -> None:
    """The thesis' twenty positions with an error map: a job that ``compensate`` takes."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in source.iterdir() if source.is_dir() else [source]:
        if file.suffix in (".csv", ".npy"):
            shutil.copy(file, folder / ("printed.csv" if file == MAP else file.name))
    shutil.copy(BARS / "ballbar.csv", folder)
    toml = (BARS / "job.toml").read_text(encoding="utf-8")
    toml = re.sub(r"(origin_mm = .*\n)", lambda found: found.group(1) + keys + "\n", toml)
    (folder / "job.toml").write_text(toml, encoding="utf-8")


def seen(maps: ErrorMaps, at: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """What five runs would read along an axis: displacements, mm, and rotations, rad, (n, 6)."""
    xyz = np.zeros((len(at), 3))
    xyz[:, axis] = at
    moved, _ = Compensation(maps).error(xyz)
    return np.hstack([moved, maps.at(xyz).errors[:, axis, 3:]])


def squarenesses(maps: ErrorMaps, table: ErrorMap) -> dict[str, float]:
    """Angles between the axes less 90°, ″, of straight lines through what is read along them."""
    slopes = np.zeros((3, 3))  # of what moves along b while a moves
    for i, axis in enumerate(table.axes):
        off = seen(maps, axis.positions, i)[:, :3]
        slopes[i] = np.polyfit(axis.positions, off, 1)[0]
    pairs = {"xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}
    return {name: -float(slopes[i, j] + slopes[j, i]) / ARCSECOND for name, (i, j) in pairs.items()}


def both_maps(folder: Path) -> tuple[ErrorMaps, ErrorMaps]:
    """The printed map, and that of the runs."""
    keys = tomllib.loads((folder / "map" / "error-map.toml").read_text(encoding="utf-8"))["error_map"][0]
    ours = read_error_map(folder / "map" / "error-map.csv").with_squareness_arcsec(**keys["squareness_arcsec"])
    return ErrorMaps([read_error_map(MAP).with_squareness_arcsec(**SQUARENESS)]), ErrorMaps([ours])


def differences(printed: ErrorMaps, ours: ErrorMaps) -> dict[str, tuple[float, float, float]]:
    """By error in VDI/VDE 2617: range in the tables, largest and rms difference, µm or ″, less a zero, across also a line."""
    found = {}
    for i, axis in enumerate(read_error_map(MAP).axes):
        read = [seen(each, axis.positions, i) for each in (printed, ours)]
        for column in range(6):
            kind, other = divmod(column, 3)
            free = np.vander(axis.positions, 2 if kind == 0 and other != i else 1)
            values = [one[:, column] / (ARCSECOND if kind else 1e-3) for one in read]
            left = [one - free @ np.linalg.lstsq(free, one, rcond=None)[0] for one in values]
            off = left[1] - left[0]
            sizes = np.ptp(left[0]), np.abs(off).max(), np.sqrt(np.mean(off**2))
            found[f"{AXES[i]}{'tr'[kind]}{AXES[other]}"] = tuple(float(size) for size in sizes)
    return found


def distance_errors(maps: ErrorMaps) -> NDArray[np.float64]:
    """Errors by a map of distances of 4000 pairs of points, µm."""
    random = np.random.default_rng(1)
    ends = [random.uniform([0, 0, -500], [900, 550, 0], (4000, 3)) for _ in range(2)]
    first, second = (one + Compensation(maps).error(one)[0] for one in ends)
    return 1e3 * (np.linalg.norm(second - first, axis=1) - np.linalg.norm(ends[1] - ends[0], axis=1))


def bar_lengths(maps: ErrorMaps | None) -> NDArray[np.float64]:
    """Of the twenty positions, mm, all in one pose at scale readings of coordinate + (805, 303, −294) mm."""
    bars = read_bars(BARS / "ballbar.csv")
    if maps is not None:
        readings = (bars + np.array([805.0, 303.0, -294.0])).reshape(-1, 3)
        bars = bars + Compensation(maps, beyond="extrapolate").error(readings)[0].reshape(20, 2, 3)
    return np.asarray(np.linalg.norm(np.diff(bars, axis=1)[:, 0], axis=1))


def compare(folder: Path) -> None:
    printed, ours = both_maps(folder)
    print(f"{'':8}{'thesis, range':>16}{'largest difference':>21}{'rms':>8}")
    for name, (size, most, rms) in differences(printed, ours).items():
        print(f"{name:8}{size:>13.1f} {'″' if name[1] == 'r' else 'µm':2}{most:21.2f}{rms:8.2f}")
    angles = [squarenesses(each, read_error_map(MAP)) for each in (printed, ours)]
    for name, arcsec in SQUARENESS.items():
        lines = (f"{each[name]:.2f}″" for each in angles)
        print(f"{name[0]}w{name[1]}: printed {arcsec:g}″; of lines through the tables {', through ours '.join(lines)}")
    theirs, off = distance_errors(printed), distance_errors(ours) - distance_errors(printed)
    print(f"4000 distances: errors by the thesis' map {np.sqrt(np.mean(theirs**2)):.1f} µm rms, ours less these "
          f"{np.sqrt(np.mean(off**2)):.2f} µm rms, {np.abs(off).max():.1f} µm at most")  # fmt: skip
    for name, maps in (("as read", None), ("by the printed map", printed), ("by ours", ours)):
        length = bar_lengths(maps)
        print(f"ballbar {name}: mean {length.mean():.4f} mm, standard deviation {1e3 * length.std(ddof=1):.1f} µm")


def read_bars(file: Path) -> NDArray[np.float64]:
    rows = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))
    return np.array([[float(row[f"{a}_mm"]) for a in AXES] for row in rows]).reshape(20, 2, 3)


def main() -> None:
    folder = Path(sys.argv[1])
    runs = folder / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    (runs / "job.toml").write_text(TOML, encoding="utf-8")
    (runs / "recording.csv").write_text(
        "\n".join([HEADER, *rows_of_table(read_error_map(MAP))]) + "\n", encoding="utf-8"
    )
    angles = ", ".join(f"{name} = {value}" for name, value in SQUARENESS.items())
    bar_job(
        folder / "bar-printed",
        MAP,
        f'error_map = [{{ file = "printed.csv", temperature_c = 20.0, squareness_arcsec = {{ {angles} }} }}]',
    )
    if (folder / "map" / "error-map.toml").exists():
        bar_job(folder / "bar-new", folder / "map", (folder / "map" / "error-map.toml").read_text(encoding="utf-8"))
        compare(folder)


if __name__ == "__main__":
    main()
