"""Jobs still to be measured, for tests."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.setting import Planning, Setting, Volume
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.physics.catalogue import effects

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
TRAVEL = np.array([[0.0, 900.0], [0.0, 800.0], [-600.0, 0.0]])
MACHINE = Machine("bridge", "XYZ", TRAVEL, np.array([10.0, -20.0, 30.0]))


def setting(
    facts: ArtefactFacts, named: tuple[str, ...] = SIX, sigma: float = 1e-3, machine: Machine = MACHINE, **plan: object
) -> Setting:
    wishes = PlanFacts.model_validate(plan)
    kind = kind_named(facts.kind)
    assert kind is not None
    planning = kind.needs("plan", Planning, "planned")
    observe = kind.observing("planned") if planning.free is None else None
    return Setting(facts, observe, planning, wishes, Volume.of(machine, wishes), effects(named), sigma, sigma)


BALLBAR = artefact_facts(kind="ballbar", length_mm=400.0, u_um=0.5)
GAUGE = artefact_facts(kind="step_gauge", u_um=0.4)
EVERY_KIND = {
    "ballbar": (BALLBAR, {}),
    "step_gauge": (GAUGE, {"length_mm": 820.0}),
    "gauge_blocks": (artefact_facts(kind="gauge_blocks", u_um=0.2), {"lengths_mm": [25.0, 100.0, 200.0, 300.0, 400.0]}),
    "plate": (artefact_facts(kind="plate", u_um=0.5), {"pitch_mm": 90.0}),
    "triangle": (
        artefact_facts(kind="triangle", blocks_mm=[380.0, 240.0, 300.0], cylinders_mm=[20.0, 20.0, 20.0]), {},
    ),
    "sphere": (artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1), {}),
    "plane": (artefact_facts(kind="plane"), {}),
    "bryan": (artefact_facts(kind="bryan"), {"length_mm": 300.0}),
    "shift": (
        artefact_facts(kind="shift", axis="x", shifts_mm=[0.0, 20.0, 50.0],
                       known={"from": 1, "to": 23, "length_mm": 440.0, "u_um": 0.5}), {},
    ),
}  # fmt: skip
"""Facts of each kind of artefact, and what its plan needs besides."""
