"""The measurement plan of a part's job, as the virtual measurement takes it."""

from __future__ import annotations

import numpy as np

from cmm_uq.jobs.part.characteristic import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.parts.plan import Alignment, Characteristic, Feature, Nominal, Plan, Stylus


def plan_of(job: PartJob) -> Plan:
    """The plan of a job that was read: geometry alone, in mm and rad, in the frame of the part."""
    facts, styli = job.facts, [one.name for one in job.facts.stylus]
    features = tuple(_feature(one, one.facts.stylus or styli[0]) for one in job.features)
    names = [one.name for one in features]
    ends = np.cumsum([0, *(len(one.points) for one in features)])
    order = [names.index(name) for name in facts.probing.order] or list(range(len(names)))
    rows = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in order])
    times = np.zeros(0)
    if facts.probing.seconds_per_point:
        times = np.empty(len(rows))
        times[rows] = facts.probing.seconds_per_point * np.arange(len(rows))
    return Plan(
        features,
        tuple(_characteristic(one) for one in facts.characteristic),
        tuple(
            Stylus(one.name, np.array(one.offset_mm), one.diameter_mm, one.u_diameter_um, np.array(one.u_offset_um),
                   one.lobing_um)
            for one in facts.stylus
        ),
        Alignment(tuple(facts.alignment.datums), facts.alignment.best_fit),
        rows.astype(np.int64),
        times,
    )  # fmt: skip


def _feature(one: Probed, stylus: str) -> Feature:
    facts = one.facts
    half = None if facts.angle_deg is None else float(np.radians(facts.angle_deg / 2))
    sized = facts.diameter_mm if facts.kind != "plane" else None
    nominal = Nominal(np.array(facts.point_mm), one.direction, sized, half)
    return Feature(facts.name, facts.kind, one.points, one.normals, stylus, nominal, facts.association)


def _characteristic(one: CharacteristicFacts) -> Characteristic:
    lower, upper = one.lower_mm, one.upper_mm
    if one.asks.limits == "angles":
        lower, upper = (None if limit is None else float(np.radians(limit)) for limit in (one.lower_deg, one.upper_deg))
    elif one.asks.limits == "zone":
        upper = one.tolerance_mm
    return Characteristic(one.name, one.what, tuple(one.features), tuple(one.datums), lower, upper, one.association)
