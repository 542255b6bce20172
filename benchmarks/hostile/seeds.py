"""What the mutations start from: every example, and what examples lack: truths, budgets, maps beside a recording, columns."""

from __future__ import annotations

import csv
import io
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
NOTES = "notes.txt"
"""A file of the user's own that lies in every job folder."""


@dataclass(frozen=True)
class Seed:
    """A folder to start from.

    Parameters
    ----------
    name : of the folder.
    files : its contents, by name.
    reads : what reads it: job, maps, truth, budget.
    commands : that run on it in full and end well.
    """

    name: str
    files: Mapping[str, bytes]
    reads: str
    commands: tuple[str, ...]


TRUTH = b"""seed = 1
[effects.scale_x]
ppm = 9.0
[effects.squareness_xy]
angle_arcsec = -173.0
[effects.probe_lobing]
cosine_um = 0.9
sine_um = 0.4
[noise]
coordinate_um = 1.2
placing_um = 0.5
[columns]
temp_x_c = 22.5
time_s = 3.0
"""

BUDGETS = {
    "sum": b"""[model]
outputs = { y = "x1**2 + x2**2" }
coverage = 0.95
method = "auto"
digits = 1
seed = 1
[inputs.x1]
distribution = "normal"
value = 0.05
u = 0.005
unit = "mm"
source = "certificate 123"
[inputs.x2]
distribution = "normal"
value = 0.0
u = 0.005
unit = "mm"
[correlation]
"x1,x2" = 0.9
""",
    "every-distribution": b"""[model]
outputs = { y = "sqrt(abs(a)) + exp(-b) * c - atan2(d, f) + log(g) + h / k", z = "sin(a) ** 2 + cos(a) ** 2 + e + pi" }
method = "first"
title = "Every distribution"
[inputs]
a = { distribution = "t", value = 1.0, u = 0.1, dof = 9 }
b = { distribution = "rectangular", low = 0.0, high = 1.0 }
c = { distribution = "rectangular_uncertain", low = 0.0, high = 1.0, limit = 0.1 }
d = { distribution = "trapezoidal", low = 0.0, high = 1.0, beta = 0.5 }
e = { distribution = "triangular", value = 2.0, half_width = 0.1 }
f = { distribution = "arcsine", low = 1.0, high = 2.0 }
g = { distribution = "exponential", value = 3.0 }
h = { samples = [1.2, 1.3, 1.25, 1.28] }
k = { distribution = "normal", value = 2.0, expanded = 0.2, coverage_factor = 2.0 }
""",
    "units": b"""[model]
outputs = { l = "l0 * (1 + alpha * (t - 20))" }
digits = 1
units = { l = "mm" }
[inputs.l0]
distribution = "normal"
value = 100.0
u = "0.2 um"
unit = "mm"
[inputs.alpha]
distribution = "rectangular"
value = 11.5e-6
half_width = 1e-6
[inputs.t]
distribution = "triangular"
value = 20.3
half_width = 0.5
""",
}

COLUMNS = ("time_s", "temp_x_c", "temp_y_c", "temp_z_c", "temp_artefact_c", "temp_table_top_c",
           "temp_table_bottom_c", "temp_air_c", "pressure_hpa", "humidity_pct", "speed_mm_s",
           "tip_x_mm", "tip_y_mm", "tip_z_mm", "covariate")  # fmt: skip
USUAL = {"pressure_hpa": 1000.0, "humidity_pct": 40.0}
"""About which a column varies, where that is not 20."""

FULL = ("report", "diagnose", "plan", "simulate")
COMMANDS = {"iota-1102-maps": ("diagnose",), "plan-ballbar": ("plan",), "plan-step-gauge": ("plan",),
            "shift-plate-simulated": ("report",), "shift-simulated": ("report", "plan")}  # fmt: skip


@cache
def seeds() -> dict[str, Seed]:
    """Every seed, by name."""
    found = [_example(folder) for folder in sorted(EXAMPLES.iterdir()) if not folder.name.startswith("part-")]
    iota = next(seed for seed in found if seed.name == "iota-1102-20C")
    found += [_compensable(iota), _with_columns(iota), _drawn(iota)]
    found += [Seed(f"budget-{name}", {"budget.toml": content, NOTES: b"mine\n"}, "budget", ("budget",))
              for name, content in BUDGETS.items()]  # fmt: skip
    return {seed.name: seed for seed in found}


def _example(folder: Path) -> Seed:
    files = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
    maps = folder.name == "iota-1102-maps"
    return Seed(folder.name, {**files, NOTES: b"mine\n"}, "maps" if maps else "job", COMMANDS.get(folder.name, FULL))


def _compensable(iota: Seed) -> Seed:
    """The real recording beside the error map of its machine, with a travel that the map covers."""
    line = (
        b'error_map = [ { file = "error_map_20C.csv", temperature_c = 20.0 } ]\nsquareness_arcsec = { xy = -173.0 }\n'
    )
    toml = iota.files["job.toml"].replace(b"[artefact]", line + b"\n[artefact]", 1)
    files = {**iota.files, "job.toml": toml,
             "error_map_20C.csv": (EXAMPLES / "iota-1102-maps" / "error_map_20C.csv").read_bytes()}  # fmt: skip
    return Seed("compensable", files, "maps", ("compensate", "compensate", *FULL))


def _with_columns(iota: Seed) -> Seed:
    """The real recording with a time, temperatures, air, stylus and a covariate, and effects that use them."""
    rows = list(csv.reader(io.StringIO(iota.files["ballbar.csv"].decode())))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*rows[0], *COLUMNS])
    for i, row in enumerate(rows[1:]):
        other = (USUAL.get(name, 20.0) + 0.1 * ((i * k) % 7) for k, name in enumerate(COLUMNS[1:], 1))
        writer.writerow([*row, 60 * i, *(f"{value:.1f}" for value in other)])
    toml = iota.files["job.toml"].replace(b'"squareness_zx"]', b'"squareness_zx", "thermal_scale_x", "drift_y"]')
    return Seed("with-columns", {**iota.files, "job.toml": toml, "ballbar.csv": text.getvalue().encode()}, "job", FULL)


def _drawn(iota: Seed) -> Seed:
    """The real job beside a truth to simulate from."""
    truth = TRUTH.split(b"[effects.probe_lobing]")[0] + b"[noise]" + TRUTH.split(b"[noise]")[1]
    return Seed("drawn", {**iota.files, "truth.toml": truth}, "truth", ("simulate",))


def small_truth() -> bytes:
    """A truth that serves every recorded job."""
    return b"seed = 1\n[noise]\ncoordinate_um = 1.2\n"


def parsed(content: bytes) -> dict[str, object]:
    """A TOML file of a seed as tables."""
    return tomllib.loads(content.decode("utf-8-sig"))
