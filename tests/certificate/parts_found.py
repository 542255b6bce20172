"""What is found of parts, for tests of their page: few draws on a machine that a test states, and no files."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.state import MachineState, StatedNoise, unmodelled_errors
from cmm_uq.analysis.parts.budget import point_errors, variance_shares
from cmm_uq.analysis.parts.result import conforming, evaluated, stated
from cmm_uq.analysis.parts.setup import circumstances_of, plan_of
from cmm_uq.analysis.parts.virtual import Virtual
from cmm_uq.analysis.parts.ways import ways
from cmm_uq.app.commands.parts.part import COVERAGE, decide_limits
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Machine
from cmm_uq.certificate.part.measurement import CertificateStatus, PartMeasurement, UnseenError, VerificationCheck
from cmm_uq.certificate.wording import effect_title
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.uncertainty.propagation import Source, simulate
from tests.jobs.part.parts import plate

ERRORS = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_zx", "squareness_yz")
TRAVEL = np.array([[0.0, 700.0], [0.0, 1000.0], [-600.0, 0.0]])
DRAWS = 4000

STANDING = CertificateStatus(
    source="certificate",
    files=("machine/certificate.pdf",),
    number="K-2031",
    laboratory="Calibration laboratory",
    machine="Portal 7",
    serial="1102",
    origin="measured",
    date=dt.date(2026, 3, 1),
    age=dt.timedelta(days=91),
    valid_until=dt.date(2027, 2, 28),
    verdict="VERIFIED",
    checked=(VerificationCheck("files", 3), VerificationCheck("figures", 52)),
    again=False,
    trusted=False,
    draft=False,
    given_recording=True,
    path=say("All errors are drawn together."),
    drift=say("What changed since then is not reckoned with."),
    temperature_c=20.1,
)


def machine(
    scale_ppm: float = 3.0, *, unmodelled: Sequence[str] = ("straightness_x_y", "hysteresis_y")
) -> MachineState:
    """One with uncertain scales and squarenesses, and errors that its calibration did not model."""
    sizes = np.array([scale_ppm] * 3 + [1.0] * 3)
    draws = np.random.default_rng(1).standard_normal((DRAWS, len(sizes))) * sizes
    further = tuple(one for one in unmodelled_errors(ERRORS, {}) if one.effect.name in unmodelled)
    return MachineState(
        Machine("m", travel_mm=TRAVEL), effects(ERRORS), draws, StatedNoise(np.full(3, 1e-3)), unmodelled=further,
        prior_share={"scale_z": 0.9},
    )  # fmt: skip


def measured_points(job: PartJob, moved: Mapping[str, Sequence[float]] | None = None, seed: int = 2) -> Floats:
    """Nominal points of a job with noise of 2 µm; those of some features moved, mm."""
    plan = plan_of(job)
    points = plan.points + 2e-3 * np.random.default_rng(seed).standard_normal(plan.points.shape)
    for name, shift in (moved or {}).items():
        points[plan.rows[name]] += shift
    return np.asarray(points)


def found_of(
    job: PartJob | None = None, *, points: Floats | None = None, state: MachineState | None = None, draws: int = DRAWS,
    **changes: Any,
) -> PartMeasurement:  # fmt: skip
    """A part's measurement; without points one that is planned."""
    job = replace(job or plate(), measured=points)
    plan = plan_of(job)
    given = circumstances_of(job, state or machine(), plan, 3)
    if points is not None:
        given = replace(given, measured=points)
    virtual = Virtual(plan, given)
    errors = virtual.errors(np.random.default_rng(0), draws)
    blocks = iter((errors.T,))
    simulated = simulate(Source(virtual.names, lambda _random, _n: next(blocks)), draws, COVERAGE, 0)
    values = None if points is None else evaluated(plan, points)
    shares = variance_shares(virtual, 1024)
    unseen = tuple(
        UnseenError(name, line, line.partition(": ")[2], effect_title(line.partition(": ")[2]), share, why)
        for name in shares.characteristics for line, share, why in shares.told(name, virtual.named, 0.05)
    )  # fmt: skip
    together = None if values is None else conforming(plan, errors, values)[1]
    found = PartMeasurement(
        job, plan, given, virtual, simulated, stated(simulated, values), values, shares, unseen, None,
        decide_limits(job, plan, errors, values), None if together is None or np.isnan(together) else together,
        tuple(ways(plan, given, 1000)), point_errors(virtual, 200), (300.0, 450.0, -500.0), STANDING,
    )  # fmt: skip
    return replace(found, **changes)
