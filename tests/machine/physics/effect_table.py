"""The table of all effects in docs/machine/effects.md: ``python -m tests.machine.physics.effect_table`` writes it anew."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import CATALOGUE, EVERY, FURTHER, OWN
from cmm_uq.machine.physics.effect import Effect, Parameter, Shape
from cmm_uq.maths.inference.linear_model import Freedoms
from tests.recordings import with_columns

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "machine" / "effects.md"
START, END = "<!-- table of effects: begin -->", "<!-- table of effects: end -->"

EXAMPLES = {
    "ballbar": "iota-1102-20C", "Bryan gauge": "bryan-simulated", "step gauge": "step-gauge-simulated",
    "gauge blocks": "gauge-blocks-simulated", "plate": "plate-simulated", "triangle": "triangle-simulated",
    "sphere": "sphere-simulated", "plane": "plane-simulated", "spheres on a table": "table-spheres-simulated",
}  # fmt: skip
BY_HEAD = "spheres under a head"
SURFACES = ("step gauge", "gauge blocks", "sphere", "plane")
"""Artefacts that are touched; of the others the centres of balls or cylinders are recorded, which have no normal."""

SEEN_UM = 0.05
"""rms of what the observations show of an effect of its prior's size, the placing taken out, below which it is not seen."""


def recorded(kind: str) -> Artefact:
    """An example's artefact with every column that its kind can have."""
    job = read_job(ROOT / "examples" / EXAMPLES[kind])
    points, random = job.points, np.random.default_rng(4)
    n = len(points)
    normals = surface_normals(kind, points)
    places = (
        "x", "y", "z", "artefact", "air", "table_top", "table_bottom", "bridge_top", "bridge_bottom", "ram_front",
        "ram_back",
    )  # fmt: skip
    approach = random.choice([-1.0, 1.0], (n, 3)) if normals is None else -np.sign(np.round(normals, 1))
    columns = {
        **{f"temp_{place}_c": 20 + np.cumsum(random.normal(0, 0.3, n)) for place in places},
        **{f"approach_{a}": approach[:, i] for i, a in enumerate("xyz")},
        **{f"tip_{a}_mm": random.uniform(-120, 120, n) for a in "xyz"},
        "time_s": 300.0 * np.arange(n), "pressure_hpa": 1000 + np.cumsum(random.normal(0, 2, n)),
        "humidity_pct": 50 + np.cumsum(random.normal(0, 1, n)), "speed_mm_s": random.uniform(2, 80, n),
        "gamma_deg": random.choice([0.0, -60.0, 90.0], n), "depth_mm": random.uniform(-30, 30, n),
        "load_kg": random.uniform(0, 5, n), **{f"acceleration_{a}_m_s2": random.uniform(-2, 2, n) for a in "xyz"},
        **{f"since_reversal_{a}_mm": random.uniform(0, 30, n) for a in "xyz"},
    }  # fmt: skip
    if normals is not None:
        columns |= {f"n{a}": normals[:, i] for i, a in enumerate("xyz")}
    return artefact_of(job.facts.artefact, with_columns(points, **{**columns, **points.columns}))


def surface_normals(kind: str, points: Points) -> Floats | None:
    """Outward normals (n, 3) where a surface was touched."""
    if kind not in SURFACES:
        return None
    if "nx" in points.columns:
        return np.column_stack([points.columns[f"n{a}"] for a in "xyz"])
    if kind == "plane":
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))
    travel = np.column_stack([points.columns[f"approach_{a}"] for a in "xyz"])
    return np.asarray(-travel / np.linalg.norm(travel, axis=1, keepdims=True))


def seen_by(effect: Effect, artefact: Artefact) -> bool:
    """Whether observations show an effect of its prior's size, once the freedoms of every placing are taken out."""
    points = artefact.points
    if any(column not in points.columns for column in effect.columns) or effect.unfit(points) is not None:
        return False
    if effect.of_artefact and effect.name not in artefact.faults:
        return False
    sizes = [c.prior_sd for c in effect.coefficients]
    effect = artefact.acting(effect)
    model = RecordingModel(artefact, ())
    values = np.array([size.nominal for size in artefact.sizes])
    shape = list(effect.trials())[-4 if effect.shape else 0]
    basis = effect.basis(points, shape) * (sizes if len(sizes) == len(effect.coefficients) else sizes[0])
    shown = model.seen(basis, values)
    free = Freedoms.of(artefact.placing(model.placed(values))).dense()
    left = shown - free @ np.linalg.lstsq(free, shown, rcond=None)[0] if free.shape[1] else shown
    return bool(np.sqrt(np.mean(left**2, axis=0)).max() > 1e-3 * SEEN_UM)


def families(names: dict[str, Effect]) -> list[list[Effect]]:
    """Effects of one class, and of one motion of a table, in order."""
    found: dict[object, list[Effect]] = {}
    for effect in names.values():
        found.setdefault((type(effect), effect.__doc__), []).append(effect)
    return list(found.values())


def row(family: list[Effect], artefacts: dict[str, Artefact]) -> str:
    """One line of the table."""
    effect = family[0]
    summary = (inspect.getdoc(effect) or "").split("\n\n")[0].replace("\n", " ").replace("``", "`").rstrip(".")
    parameters = ", ".join(parameter(p) for p in effect.reported)
    columns = ", ".join(f"`{c}`" for c in dict.fromkeys(c for e in family for c in e.columns)) or "–"
    heads = [True, False] if getattr(effect, "head", False) else [False]
    seen = [kind for kind, artefact in artefacts.items() if any(seen_by(e, artefact) for e in family)]
    seen = [kind for kind in seen if (kind == BY_HEAD) in heads]
    names = ", ".join(f"`{e.name}`" for e in family)
    return f"| {names} | {summary} | {effect.formula} | {parameters} | {columns} | {', '.join(seen)} |"


def parameter(given: Parameter | Shape) -> str:
    """A parameter with its prior."""
    if isinstance(given, Shape):
        return f"`{given.name}` {given.low:g}…{given.high:g}"
    return f"`{given.name}` ±{given.prior_sd:.3g}" if given.name != "phase_rad" else "`phase_rad`"


def table() -> str:
    """Both tiers, and what every effect points to."""
    artefacts = {kind: recorded(kind) for kind in EXAMPLES}
    job = read_job(ROOT / "examples" / EXAMPLES["spheres on a table"])
    stylus, travel = np.array([60.0, 0.0, -200.0]), job.points.machine.travel_mm
    head = RotaryMachine(travel_mm=travel, rotary=(RotaryAxis("c", head=True),), stylus_mm=stylus)
    artefacts[BY_HEAD] = artefact_of(job.facts.artefact, replace(job.points, machine=head))
    parts = []
    tiers = {"Effects of every job": CATALOGUE, "Further effects": FURTHER, "Faults of the artefact itself": OWN}
    for title, tier in tiers.items():
        rows = [row(family, artefacts) for family in families(dict(tier))]
        head = "| effect | what it does | formula | parameters, prior | columns | seen by |\n|" + 6 * " --- |"
        parts.append(f"## {title}\n\n{head}\n" + "\n".join(rows))
    head = "| effect | cause in | what it points to |\n| --- | --- | --- |"
    parts.append(
        "## What each points to\n\n" + "\n".join([head, *(line for f in families(dict(EVERY)) for line in causes(f))])
    )
    return "\n\n".join(parts)


def causes(family: list[Effect]) -> list[str]:
    """Lines of what the effects of a class point to, one for each text."""
    said: dict[str, list[str]] = {}
    for effect in family:
        said.setdefault(effect.points_to, []).append(f"`{effect.name}`")
    return [f"| {', '.join(names)} | {family[0].mechanism} | {text} |" for text, names in said.items()]


def main() -> None:
    """Write the table into the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(START)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{START}\n\n{table()}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
    print(f"{len(EVERY)} effects")
