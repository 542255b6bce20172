"""Which artefact determines which factor: ``python benchmarks/planning/artefact_table.py [DOCS.md]``.

For the ready plan of every artefact the whole catalogue is taken to act at once, and the table follows from the design. With a
file, the table between its two marks is replaced.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cmm_uq.analysis.planning.candidates import FAINT, certified, cosines, gram, imitators, left_of, ready_plan, visible
from cmm_uq.analysis.planning.identifiability import NOT_TOLD_APART, identifiability
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.analysis.planning.setting import Planning, Setting, Volume
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import CATALOGUE, effects

BEGIN, END = "<!-- generated: artefact × factor -->", "<!-- end of generated -->"
MACHINE = Machine("bridge machine", "XYZ", np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]]))
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ARTEFACTS: dict[str, tuple[dict[str, object], dict[str, object]]] = {
    "ballbar": ({"length_mm": 500.0, "u_um": 0.5}, {}),
    "bryan": ({"length_mm": 280.0, "u_um": 0.5}, {}),
    "step_gauge": ({"u_um": 0.4}, {"length_mm": 1000.0, "both_ways": True}),
    "gauge_blocks": ({"u_um": 0.2}, {"lengths_mm": [30.0, 150.0, 300.0, 450.0, 560.0]}),
    "plate": ({"u_um": 0.5}, {"pitch_mm": 100.0}),
    "triangle": ({"blocks_mm": [480.0, 280.0, 380.0], "u_blocks_um": 0.1, "cylinders_mm": [20.0, 20.0, 20.0],
                  "u_cylinders_um": 0.1}, {}),
    "sphere": ({"length_mm": 25.0, "u_um": 0.1}, {}),
    "plane": ({}, {}),
}  # fmt: skip
SHORT = {"artefact_sag": "sag", "probe_radius": "probe radius", "probe_lobing": "probe lobing"}


def short(name: str) -> str:
    """A name that fits a table."""
    return SHORT.get(name, name.replace("_", " "))


def column(kind: str) -> dict[str, str]:
    """What the ready plan of one artefact says of every factor, told of the six classical ones.

    A factor that the job names is determined or not; one that it does not name would be seen apart from all others, be
    mistaken for some, or not be seen.
    """
    facts, wishes = ARTEFACTS[kind]
    plan, of = PlanFacts.model_validate(wishes), artefact_facts(kind=kind, **facts)
    known = kind_named(kind)
    assert known is not None
    setting = Setting(
        of, known.observing("planned"), known.needs("plan", Planning, "planned"), plan, Volume.of(MACHINE, plan),
        effects(SIX), 1e-3, 1e-3,
    )  # fmt: skip
    points = join(ready_plan(setting)[1])
    found = identifiability(setting.model(points))
    cells = {}
    for parameter in found.parameters:
        owner = parameter.unknown.key[0]
        if owner == ARTEFACT:
            continue
        partners = sorted({key[0] for parts in found.free if parameter.unknown.key in parts for key in parts} - {owner})
        cells[owner] = "not seen" if parameter.u is None and not partners else (
            f"with {', '.join(map(short, partners))}" if parameter.u is None
            else f"**{parameter.u:.2g} {parameter.unknown.unit}**"
        )  # fmt: skip
    return cells | others(setting, points)


def others(setting: Setting, points: object) -> dict[str, str]:
    """The factors that a job of the six does not name."""
    rivals = setting.rivals(points)
    model = setting.model(points, rivals)
    names = [unknown.key[0] for unknown in model.unknowns]
    information = gram(model, np.array([u.prior_mean for u in model.unknowns])) + certified(model.unknowns)
    base = [i for i, name in enumerate(names) if name in (*SIX, ARTEFACT)]
    rows = [i for i in range(len(names)) if i not in base]
    left, alone = left_of(information, rows, base), np.diag(information)[rows]
    cosine, seen = cosines(left, alone), visible(left, alone)
    cells = dict.fromkeys(CATALOGUE, "–")
    for a, i in enumerate(rows):
        alike = {names[rows[b]] for b in range(len(rows)) if b != a and seen[b] and cosine[a, b] > NOT_TOLD_APART}
        hidden = imitators(information, i, base) if information[i, i] > FAINT else []
        if seen[a] and alike - {names[i]}:
            said = f"like {', '.join(sorted(map(short, alike - {names[i]})))}"
        elif seen[a]:
            said = f"**{model.unknowns[i].prior_sd / np.sqrt(left[a, a]):.2g} {model.unknowns[i].unit}**"
        else:
            said = f"as {', '.join(dict.fromkeys(short(names[j]) for j in hidden))}" if hidden else "not seen"
        cells[names[i]] = said
    return {name: cell for name, cell in cells.items() if name not in SIX}


def table() -> str:
    """The table as Markdown."""
    columns = {kind: column(kind) for kind in ARTEFACTS}
    listed = [name for name in CATALOGUE if any(cells[name] != "–" for cells in columns.values())]
    lines = [f"| factor | {' | '.join(short(kind) for kind in columns)} |", "| --- |" + " --- |" * len(columns)]
    lines += [f"| {short(name)} | {' | '.join(cells[name] for cells in columns.values())} |" for name in listed]
    return "\n".join(lines)


def main() -> None:
    text = table()
    if len(sys.argv) < 2:
        print(text)
        return
    path = Path(sys.argv[1])
    page = path.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    path.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
