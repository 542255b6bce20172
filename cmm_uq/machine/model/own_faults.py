"""What may be wrong with an artefact itself, as large and as likely as what is known of it allows.

Sizes and weights are judgements, stated here once. A certificate with an uncertainty leaves little: mostly three times its
standard uncertainty, and is less readily doubted than the machine. One time in three it is plainly wrong, or the artefact has
changed since, and may then be off like one without a certificate: what a single set-up shows beyond the certificate's
uncertainty is the artefact's with odds of one to ten, and both are named until another set-up tells. Where nothing is
certified it is the other way round: holes and balls were placed by a machine, and mostly by a worse one than the machine
that measures them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.own_body import Body
from cmm_uq.machine.physics.own_errors import GEOMETRY, PATTERN, Owner, OwnFault, deformations
from cmm_uq.machine.physics.own_states import BENDING, FIXTURE, FORM, LOBES, SET_UP_TEMPERATURE, TEMPERATURE

STEEL = 11.5e-6
"""Expansion of an artefact whose own is not stated, 1/K."""

_CERTIFICATES = 3.0
"""Standard uncertainties by which a certificate may be wrong."""

_LEAST_UM = 0.1
"""However small the uncertainty that a certificate states: balls have dirt on them, and glue creeps."""

_CERTIFIED, _CHANGED, _UNKNOWN, _ROUND = 0.3, 0.3, 2.0, 0.1
"""Weights of faults: of a certified artefact, of one compared with itself at an earlier date, of an uncalibrated one, and of
a sphere's form."""

_MEASURED_KELVIN, _ASSUMED_KELVIN = 0.3, 1.0
"""Standard deviation of the artefact's temperature where it was recorded, and where it was not."""

_FAR_KELVIN = 3.0
"""The same, one time in three, where a thermometer is wrong, hangs elsewhere, or the artefact came from another room."""

_TEMPERATURE = 0.3
"""Weight of the artefact's temperature: rooms and thermometers are mostly right; of two dates, nothing is likelier."""

_BENDING_UM, _FIXTURE_UM, _HELD = 10.0, 10.0, 0.1
"""µm, and weight, of how an artefact is supported and clamped."""

MOST_ERRORS = 120
"""Coefficients of a pattern: with more of them a diagnosis would take minutes."""

_FORM, _LEAST_FORM_UM, _UNKNOWN_FORM_UM = 4.0, 0.05, 0.3
"""Form deviation over its standard deviation; the least that a certificate is believed; the latter without a certificate."""

_FLAT = 0.05
"""Extent across a flat artefact over that along it."""


@dataclass(frozen=True)
class Known:
    """What is known of an artefact's own places.

    Parameters
    ----------
    um : largest plausible standard deviation of a place from where it should be, µm.
    mostly : part of it that a certificate leaves.
    weight : how readily it is thought of, beside the machine's errors.
    kelvin_weight : the same of its temperature.
    """

    um: float
    weight: float
    mostly: float = 1.0
    kelvin_weight: float = _TEMPERATURE


def by_certificate(u_um: float | None, uncalibrated_um: float) -> Known:
    """By the standard uncertainty, µm, that the artefact's certificate states; by its make where there is none."""
    if u_um is None:
        return Known(uncalibrated_um, _UNKNOWN)
    certified = max(_CERTIFICATES * u_um, _LEAST_UM)
    return Known(max(uncalibrated_um, certified), _CERTIFIED, min(certified / uncalibrated_um, 1.0))


def since_earlier(um: float) -> Known:
    """Of an artefact that is compared with itself at an earlier date: what it may have changed by since, µm."""
    return Known(um, _CHANGED, kelvin_weight=1.0)


def faults(
    facts: ArtefactFacts,
    points: Points,
    body: Body,
    known: Known,
    *,
    axes: int = 3,
    geometry: Iterable[OwnFault] = tuple(GEOMETRY.values()),
) -> Iterable[Effect]:
    """Faults of an artefact of several places.

    Parameters
    ----------
    facts : what the job says of it.
    points : as recorded.
    body : its places.
    known : of them.
    axes : how many of its own axes are seen.
    geometry : errors of machines that it may look like; all by default.
    """
    own = Owner(body, points, known.um, known.weight, axes, expansion_of(facts), known.mostly)
    if axes * len(body.places) <= MOST_ERRORS and deformations(own).shape[1]:
        yield PATTERN.made(own)
    for fault in geometry:
        yield fault.made(own)
    yield from temperatures(own, known.kelvin_weight)
    extents = np.linalg.svd(body.about_middle(), compute_uv=False)
    if axes == len(extents) and len(body.places) > axes and extents[2] < _FLAT * extents[1]:
        yield BENDING.made(replace(own, size=_BENDING_UM, weight=_HELD, mostly=1.0))
        yield FIXTURE.made(replace(own, size=_FIXTURE_UM, weight=_HELD, mostly=1.0))


def temperatures(own: Owner, weight: float) -> Iterable[Effect]:
    """That the artefact had another temperature than is known: in all set-ups, or in each its own."""
    kelvin = _MEASURED_KELVIN if "temp_artefact_c" in own.points.columns else _ASSUMED_KELVIN
    far = replace(own, size=_FAR_KELVIN, weight=weight, mostly=kelvin / _FAR_KELVIN)
    yield TEMPERATURE.made(far)
    if len(np.unique(own.points.measurement)) > 1:
        yield SET_UP_TEMPERATURE.made(replace(far, weight=weight * _TEMPERATURE))


def temperature_of(facts: ArtefactFacts, points: Points) -> Effect:
    """That an artefact of one length had another temperature than is known, or another length than is certified."""
    own = Owner(Body.of(points, points.xyz), points, 0.0, _TEMPERATURE, 1, expansion_of(facts))
    return next(iter(temperatures(own, _TEMPERATURE)))


def form_faults(facts: ArtefactFacts, form_um: float | None, points: Points) -> Iterable[Effect]:
    """That a sphere is not round.

    Parameters
    ----------
    form_um : form deviation by its certificate, µm, which is about four standard deviations of it.
    """
    um = _UNKNOWN_FORM_UM if form_um is None else max(form_um, _LEAST_FORM_UM) / _FORM
    own = Owner(Body.of(points, points.xyz), points, um, _ROUND, 3, expansion_of(facts))
    yield LOBES.made(own)
    yield FORM.made(replace(own, size=um / len(FORM.made(own).coefficients) ** 0.5))


def expansion_of(facts: ArtefactFacts) -> float:
    """The coefficient of expansion of an artefact, that of steel where it is not stated, 1/K."""
    return facts.cte_per_k or STEEL
