"""Writes examples/part-iota: distances between balls that stood in different places of a real machine's calibration.

    python -m benchmarks.examples.part_iota

The machine is that of examples/iota-1102-20C, reported by this package from its twenty bars. Each distance is from a ball of
one bar to a ball of another: no length that the calibration knew. Both bars were measured with the digitizer in one pose,
since its offset would else be in the distance (docs/machine/harris-2004.md). Of each main direction and diagonal of the
volume, the longest is taken that lies within 20° of it. What the same distances are by the recording that a laser
interferometer's error map of this machine compensated (examples/iota-1102-20C-compensated) is not in the job:
:mod:`benchmarks.parts.iota` compares.
"""

from __future__ import annotations

import datetime as dt
import tempfile
from itertools import product
from pathlib import Path

import numpy as np

import cmm_uq
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.points import Floats, Points

ROOT = Path(__file__).parents[2]
FOLDER, MACHINE = ROOT / "examples" / "part-iota", ROOT / "examples" / "iota-1102-20C"
COPY = 18
"""Of measurement 14 to the last digit."""
POSES = ({1, 2, 3, 4, 11, 12, 13, 14}, {5, 6, 7, 8, 9, 10, 15}, {16, 17}, {19, 20})
"""Measurements with the digitizer in one pose."""
WITHIN = np.cos(np.radians(20.0))
DIRECTIONS = {
    "along x": (1, 0, 0), "along y": (0, 1, 0), "along z": (0, 0, 1), "diagonal of x and y": (1, 1, 0),
    "diagonal of y and x": (1, -1, 0), "diagonal of x and z": (1, 0, 1), "diagonal of z and x": (1, 0, -1),
    "diagonal of y and z": (0, 1, 1), "diagonal of z and y": (0, 1, -1), "diagonal of space": (1, 1, 1),
    "diagonal of space, y turned": (1, -1, 1), "diagonal of space, z turned": (1, 1, -1),
    "diagonal of space, x turned": (-1, 1, 1),
}  # fmt: skip
SOURCE = (
    'J. O. Harris, "Geometric and Quasi-static Thermal Error Compensation of a Laser Digitizer on a Coordinate Measuring '
    'Machine", Ph.D. thesis, McMaster University, 2004, figures C 1 and C 2.'
)
REMARKS = (
    "Centres of spheres as the machine's laser digitizer reported them, uncompensated; each distance is between balls of two "
    "different positions of the ballbar with the digitizer in one pose. The thesis gives year and month of publication, "
    "not the day of the measurement."
)


def ends(points: Points) -> dict[str, Floats]:
    """Centres of all balls by name, without those of the copied row."""
    rows = [i for i, number in enumerate(points.measurement.tolist()) if number != COPY]
    return {f"{points.measurement[i]}-{points.point[i]}": points.xyz[i] for i in rows}


def chosen(balls: dict[str, Floats]) -> dict[str, tuple[str, str]]:
    """The longest distance near each direction, as far as there is one that is not taken already."""
    found: dict[str, tuple[str, str]] = {}
    for name, direction in DIRECTIONS.items():
        along = np.array(direction) / np.linalg.norm(direction)
        best, longest = None, 0.0
        for one, other in product(balls, balls):
            apart = balls[other] - balls[one]
            length = float(np.linalg.norm(apart))
            if not _comparable(one, other) or length <= longest or apart @ along < WITHIN * length:
                continue
            best, longest = (one, other), length
        if best is not None and set(best) not in [set(each) for each in found.values()]:
            found[name] = best
    return found


def _comparable(one: str, other: str) -> bool:
    """Whether two balls are of different bars and of one pose."""
    bars = {int(name.split("-")[0]) for name in (one, other)}
    return len(bars) == 2 and any(bars <= pose for pose in POSES)


def main() -> None:
    """Write the folder anew."""
    balls = ends(cmm_uq.read(MACHINE).points)
    (FOLDER / "machine").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        pdf = cmm_uq.report(MACHINE).write(Path(folder) / "report")["certificate.pdf"]
        (FOLDER / "machine" / pdf.name).write_bytes(pdf.read_bytes())
    pairs = chosen(balls)
    used = [name for name in balls if any(name in pair for pair in pairs.values())]
    features = [
        {
            "name": f"ball {name}",
            "kind": "point",
            "point_mm": np.round(balls[name], 1).tolist(),
            "direction": [0.0, 0.0, 1.0],
        }
        for name in used
    ]
    asked = [
        {"name": name, "what": "distance", "features": [f"ball {one}", f"ball {other}"]}
        for name, (one, other) in pairs.items()
    ]
    tables = {
        "job": {"id": FOLDER.name, "date": dt.date(2004, 9, 1), "place": "McMaster University, Hamilton, Ontario",
                "procedure": "Laser digitizer on painted balls", "conditions": "20 °C, controlled", "remarks": REMARKS},
        "part": {"name": "Balls in the volume of a DEA Iota 1102"},
        "machine_state": {"certificate": "machine", "corrected": False, "origin_mm": [805.0, 303.0, -294.0]},
        "stylus": [{"name": "digitizer", "diameter_mm": 0.0}],
        "placing": {"origin_mm": [0.0, 0.0, 0.0]},
        "feature": features, "characteristic": asked, "recording": {"file": "points.csv"},
    }  # fmt: skip
    (FOLDER / "job.toml").write_bytes(f"# Source: {SOURCE}\n\n".encode() + as_toml(tables, "job.toml"))
    rows = [f"# Source: {SOURCE}", "feature,point,x_mm,y_mm,z_mm"]
    rows += ["ball {},1,{:.4f},{:.4f},{:.4f}".format(name, *balls[name]) for name in used]
    (FOLDER / "points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
