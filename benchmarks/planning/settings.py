"""Jobs still to be measured, for the studies of this folder."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.setting import Planning, Setting, Volume
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.physics.catalogue import effects

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
MACHINE = Machine("bridge machine", "XYZ", np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]]))


def setting(facts: ArtefactFacts, named: tuple[str, ...] = SIX, sigma: float = 1e-3, **plan: object) -> Setting:
    wishes = PlanFacts.model_validate(plan)
    kind = kind_named(facts.kind)
    assert kind is not None
    planning = kind.needs("plan", Planning, "planned")
    observe = kind.observing("planned") if planning.free is None else None
    return Setting(facts, observe, planning, wishes, Volume.of(MACHINE, wishes), effects(named), sigma, sigma)


def ballbar() -> Setting:
    return setting(artefact_facts(kind="ballbar", length_mm=500.0, u_um=0.5))


def step_gauge() -> Setting:
    return setting(artefact_facts(kind="step_gauge", u_um=0.4), pitch_mm=20.0, length_mm=1000.0, repeats=1)


def plate() -> Setting:
    return setting(artefact_facts(kind="plate", u_um=0.5), repeats=2, pitch_mm=100.0)


def triangle() -> Setting:
    return setting(artefact_facts(kind="triangle", blocks_mm=[480.0, 280.0, 380.0], u_blocks_um=0.1,
                                 cylinders_mm=[20.0, 20.0, 20.0], u_cylinders_um=0.1))  # fmt: skip


def bryan() -> Setting:
    bar = artefact_facts(kind="bryan", length_mm=280.0, u_um=0.5)
    return setting(bar)


SETTINGS = {
    "ballbar, twenty positions": ballbar,
    "step gauge, seven lines": step_gauge,
    "plate, six placings": plate,
    "triangle, seven placings": triangle,
    "bryan, twenty-five positions": bryan,
}
