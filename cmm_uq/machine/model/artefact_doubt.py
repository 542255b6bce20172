"""What is in doubt of an artefact: its temperature, expansion, alignment and fixturing, and what may be wrong with it.

What a job states of the artefact's temperature, expansion, alignment and fixturing, as errors of the observations.

The sensitivities are those of the test uncertainty of a length L (ISO/TS 23165): L·(t − 20 °C) for the coefficient of
expansion, L·α for the temperature; what is stated of a length by alignment and fixturing is that of the longest of a set-up,
of others in proportion. The artefact, grown by a part of its size, shows what each observation has of the length.

What may be wrong with an artefact itself, as large and as likely as what is known of it allows.

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

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.circumstances import Circumstances
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_body import Body
from cmm_uq.machine.physics.effects.own_errors import GEOMETRY, PATTERN, FaultyArtefact, OwnFault, deformations
from cmm_uq.machine.physics.effects.own_states import BENDING, FIXTURE, FORM, LOBES, SET_UP_TEMPERATURE, TEMPERATURE
from cmm_uq.maths.inference.doubt import Cause


def causes_of(artefact: Artefact, circumstances: Circumstances) -> tuple[Cause, ...]:
    """Causes that the observations (m,) of an artefact err by; none where nothing is stated, or it has no dimension.

    The coefficient of expansion is one; whether the others err alike in all set-ups is not known. Of the calibration a size of
    the artefact has what all its lengths have in common; here is what is more where each has an error of its own.
    """
    stated, along = circumstances.uncertainty, growth(artefact)
    if along is None:
        return ()
    set_up, excess = artefact.measurement, np.zeros(len(along))
    if (recorded := artefact.points.columns.get("temp_artefact_c")) is not None:
        excess = recorded[artefact.rows].mean(axis=1) - REFERENCE_TEMPERATURE
    of_length = stated.u_alignment_um or stated.u_fixturing_um
    part = along / longest_lengths(artefact) * MICROMETRE if of_length else np.zeros(len(along))
    changes = (
        (say("temperature of the artefact"), stated.u_temperature_k * (circumstances.cte_per_k or 0.0) * along),
        (say("alignment of the artefact"), stated.u_alignment_um * part),
        (say("fixturing of the artefact"), stated.u_fixturing_um * part),
    )
    expansion = Cause(say("expansion coefficient of the artefact"), (stated.u_cte_per_k * excess * along)[:, None])
    calibration = artefact.calibration()
    every = (expansion, *(Cause.of_blocks(name, change, set_up) for name, change in changes))
    stated_causes = tuple(cause for cause in every if np.any(cause.common))
    return stated_causes if calibration is None else (calibration, *stated_causes)


def growth(artefact: Artefact) -> Floats | None:
    """Change of the observations (m,), mm, if the artefact were twice its size; ``None`` without a dimension."""
    dimensions = [i for i, size in enumerate(artefact.sizes) if size.role == "dimension"]
    if not dimensions:
        return None
    nominal = np.array([artefact.sizes[i].nominal for i in dimensions])
    return np.asarray(artefact.size_change()[:, dimensions] @ nominal, dtype=np.float64)


def longest_lengths(artefact: Artefact) -> Floats:
    """Longest length, (m,) mm, in the set-up of each observation, the artefact's largest dimension at the most."""
    largest = max(size.nominal for size in artefact.sizes if size.role == "dimension")
    found, of_point = np.empty(len(artefact.measurement)), artefact.points.measurement
    for number in np.unique(artefact.measurement):
        xyz = artefact.points.xyz[of_point == number]
        away = np.linalg.norm(xyz - xyz[0], axis=1)
        extent = np.linalg.norm(xyz - xyz[np.argmax(away)], axis=1).max()
        found[artefact.measurement == number] = min(extent, largest) if extent > 0 else largest
    return found


STEEL = 11.5e-6  # expansion of an artefact whose own is not stated, 1/K
_CERTIFICATES = 3.0  # standard uncertainties by which a certificate may be wrong
_LEAST_UM = 0.1  # however small the uncertainty that a certificate states: balls have dirt on them, and glue creeps
# weights of faults: of a certified artefact, of one compared with itself at an earlier date, of an uncalibrated one, and of a
# sphere's form
_CERTIFIED, _CHANGED, _UNKNOWN, _ROUND = 0.3, 0.3, 2.0, 0.1
# standard deviation of the artefact's temperature where it was recorded, and where it was not
_MEASURED_KELVIN, _ASSUMED_KELVIN = 0.3, 1.0
# the same, one time in three, where a thermometer is wrong, hangs elsewhere, or the artefact came from another room
_FAR_KELVIN = 3.0
# weight of the artefact's temperature: rooms and thermometers are mostly right; of two dates, nothing is likelier
_TEMPERATURE = 0.3
_BENDING_UM, _FIXTURE_UM, _HELD = 10.0, 10.0, 0.1  # µm, and weight, of how an artefact is supported and clamped
MOST_ERRORS = 120  # coefficients of a pattern: with more of them a diagnosis would take minutes
# form deviation over its standard deviation; the least that a certificate is believed; the latter without a certificate
_FORM, _LEAST_FORM_UM, _UNKNOWN_FORM_UM = 4.0, 0.05, 0.3
_FLAT = 0.05  # extent across a flat artefact over that along it


@dataclass(frozen=True)
class Known:
    """What is known of an artefact's own places."""

    um: float  # largest plausible standard deviation of a place from where it should be, µm
    weight: float  # how readily it is thought of, beside the machine's errors
    mostly: float = 1.0  # part of it that a certificate leaves
    kelvin_weight: float = _TEMPERATURE  # the same of its temperature


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
    own = FaultyArtefact(body, points, known.um, known.weight, axes, expansion_of(facts), known.mostly)
    if axes * len(body.places) <= MOST_ERRORS and deformations(own).shape[1]:
        yield PATTERN.made(own)
    for fault in geometry:
        yield fault.made(own)
    yield from temperatures(own, known.kelvin_weight)
    extents = np.linalg.svd(body.about_middle(), compute_uv=False)
    if axes == len(extents) and len(body.places) > axes and extents[2] < _FLAT * extents[1]:
        yield BENDING.made(replace(own, size=_BENDING_UM, weight=_HELD, mostly=1.0))
        yield FIXTURE.made(replace(own, size=_FIXTURE_UM, weight=_HELD, mostly=1.0))


def temperatures(own: FaultyArtefact, weight: float) -> Iterable[Effect]:
    """That the artefact had another temperature than is known: in all set-ups, or in each its own."""
    kelvin = _MEASURED_KELVIN if "temp_artefact_c" in own.points.columns else _ASSUMED_KELVIN
    far = replace(own, size=_FAR_KELVIN, weight=weight, mostly=kelvin / _FAR_KELVIN)
    yield TEMPERATURE.made(far)
    if len(np.unique(own.points.measurement)) > 1:
        yield SET_UP_TEMPERATURE.made(replace(far, weight=weight * _TEMPERATURE))


def temperature_of(facts: ArtefactFacts, points: Points) -> Effect:
    """That an artefact of one length had another temperature than is known, or another length than is certified."""
    own = FaultyArtefact(Body.of(points, points.xyz), points, 0.0, _TEMPERATURE, 1, expansion_of(facts))
    return next(iter(temperatures(own, _TEMPERATURE)))


def form_faults(facts: ArtefactFacts, form_um: float | None, points: Points) -> Iterable[Effect]:
    """That a sphere is not round.

    ``form_um``: form deviation by its certificate, µm, which is about four standard deviations of it.
    """
    um = _UNKNOWN_FORM_UM if form_um is None else max(form_um, _LEAST_FORM_UM) / _FORM
    own = FaultyArtefact(Body.of(points, points.xyz), points, um, _ROUND, 3, expansion_of(facts))
    yield LOBES.made(own)
    yield FORM.made(replace(own, size=um / len(FORM.made(own).coefficients) ** 0.5))


def expansion_of(facts: ArtefactFacts) -> float:
    return facts.cte_per_k or STEEL
