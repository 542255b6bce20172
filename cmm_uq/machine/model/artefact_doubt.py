"""What is in doubt of an artefact: its certified places, temperature, expansion, alignment and fixturing, and its faults.

A certificate states U of every length as a number or a formula of it, or of each place by itself, or with covariances.
Without these nobody knows whether the errors of several lengths have one cause or each their own: figures of several
lengths are taken with either, and the larger uncertainty stands. Sensitivities are those of the test uncertainty of a
length L (ISO/TS 23165).

Sizes and weights of faults are judgements, stated here once. A certificate with an uncertainty leaves little: mostly three
times its standard uncertainty, and is less readily doubted than the machine. One time in three it is plainly wrong, or the
artefact has changed since, and may then be off like one without a certificate: what a single set-up shows beyond the
certificate's uncertainty is the artefact's with odds of one to ten, and both are named until another set-up tells. Where
nothing is certified it is the other way round: holes and balls were mostly placed by a worse machine than the one that
measures them.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, PPM, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model.artefact import Artefact, Size, without_uncertainty
from cmm_uq.machine.model.recorded import stated_sd
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_errors import GEOMETRY, PATTERN, Body, FaultyArtefact, OwnFault, deformations
from cmm_uq.machine.physics.effects.own_states import BENDING, FIXTURE, FORM, LOBES, SET_UP_TEMPERATURE, TEMPERATURE
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.posterior import Cause

CALIBRATION = say("calibration of the artefact")  # name of this cause
_SAME_MM = 1e-6  # certified distances closer than this are of one place
_NOTICED = 1e-3
_LEAST_MM = 1e-12  # A standard uncertainty that is none


@dataclass(frozen=True, eq=False)
class CertifiedPlaces:
    facts: ReferencedFacts  # what the job says of the artefact
    places: Floats  # (n, j) certified, mm: distances from the first face, or coordinates
    # (n, j) standard uncertainty of each by itself, mm; ``None`` where none is stated of single places
    u: Floats | None = None
    # (f, f) of all certified places for each of the j coordinates, mm²; ``None`` where none is stated
    covariance: tuple[Floats, ...] | None = None
    index: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # (n,) which of these each place is

    @classmethod
    def of(cls, facts: ReferencedFacts, points: Points, places: Floats) -> CertifiedPlaces:
        """Of a recording: by its columns, or by the points of the artefact's digital certificate."""
        count = places.shape[1]
        names = [f"reference_u_{axis}_um" for axis in AXES] if count > 1 else ["reference_u_um"]
        common = points.columns.get("reference_u_um")
        columns = [points.columns.get(name, common) for name in names]
        stated = [column for column in columns if column is not None]
        u = np.column_stack(stated) * MICROMETRE if len(stated) == count else None
        if u is not None and count == 1:
            u = np.where(np.abs(places) <= _SAME_MM, 0.0, u)  # distances count from there
        rows, covariances = facts.covariances_at(points.point)
        if len(covariances) != count:
            return cls(facts.of_other_points if u is None else facts, places, u)
        return cls(facts, places, u, tuple(MICROMETRE**2 * covariance for covariance in covariances), rows)

    @property
    def plain(self) -> bool:
        """Whether a number, or nothing, is stated of all lengths alike."""
        return self.u is None and self.covariance is None and isinstance(self.facts.u_um, float | None)

    def u_um(self, sd_mm: float) -> float | None:
        """Standard uncertainty of the longest length, µm, as stated; ``None`` where nothing is.

        ``sd_mm``: the same in mm, by what is stated of single places or lengths.
        """
        if not self.plain:
            return sd_mm / MICROMETRE
        return None if self.facts.u_um is None else float(self.facts.u_of(0.0))

    def u_between(self, first: Ints, last: Ints) -> Floats:
        """Standard uncertainty of the certified distance between two places, (m,) mm.

        By the covariance; else the larger of what is stated of such a length and of the places, each independent.
        """
        apart = self.places[last] - self.places[first]
        lengths = np.sqrt(np.sum(apart**2, axis=1))
        along = np.divide(apart, lengths[:, None], out=np.zeros_like(apart), where=lengths[:, None] > 0)
        stated = self.facts.u_of(lengths) * MICROMETRE
        if self.covariance is not None:
            a, b = self.index[first], self.index[last]
            each = [c[a, a] + c[b, b] - 2 * c[a, b] for c in self.covariance]
            own = np.sqrt(np.maximum(np.sum(along**2 * np.column_stack(each), axis=1), 0.0))
            return np.asarray(np.maximum(stated, own), dtype=np.float64)
        if self.u is None:
            return np.asarray(stated, dtype=np.float64)
        own = np.sqrt(np.sum(along**2 * (self.u[first] ** 2 + self.u[last] ** 2), axis=1))
        return np.asarray(np.maximum(stated, own), dtype=np.float64)

    def sd(self, length_mm: float, first: int, last: int) -> float:
        """Standard uncertainty of the artefact's length, mm; infinite where its places are nominal."""
        if self.facts.nominal:
            return float(np.inf)
        if self.plain:
            return stated_sd(self.facts, length_mm)
        found = float(self.u_between(np.array([first]), np.array([last]))[0])
        return max(found, stated_sd(self.facts, length_mm))

    def together(self, about: Floats, sd_mm: float, first: int, last: int) -> Floats:
        """Errors of the places, (n, j) mm, for one mm of the error of the longest length, if all have one cause.

        With a covariance those that go with that error; what it has beside them is in :meth:`beyond`.

        ``about``: (n, j) places from where distances count, mm: the first face, or the middle of the balls.
        """
        if self.covariance is not None:
            return self._with_the_longest(sd_mm, first, last)[self.index]
        away = np.linalg.norm(about, axis=1)
        along = np.divide(about, away[:, None], out=np.zeros_like(about), where=away[:, None] > _SAME_MM)
        ends = 1.0 if about.shape[1] == 1 else 2.0  # of a length through the middle, half belongs to either end
        u = self.facts.u_of(ends * away) * MICROMETRE / ends
        if self.u is not None:
            u = np.maximum(u, np.linalg.norm(along * self.u, axis=1))
        return np.asarray(along * u[:, None] / max(sd_mm, _LEAST_MM), dtype=np.float64)

    def beyond(self, size: Size, first: int, last: int, change: Floats, expansion: Floats) -> Cause | None:
        """What the certificate leaves open of the places beyond one common error; ``None`` where nothing is stated.

        ``change``: (n·j,) of the observations for one mm of that length. ``expansion``: (n,) size of the artefact at each
        place over that at 20 °C.
        """
        if not size.certified or size.sd <= 0:
            return None
        count = self.places.shape[1]
        if self.covariance is not None:
            known = self._with_the_longest(size.sd, first, last).ravel() * size.sd
            whole = np.zeros((len(known), len(known)))
            for axis, covariance in enumerate(self.covariance):
                whole[axis::count, axis::count] = covariance
            values, vectors = np.linalg.eigh(whole - np.outer(known, known))
            root = (vectors * np.sqrt(np.maximum(values, 0.0))).reshape(-1, count, len(known))[self.index]
            return Cause(CALIBRATION, (root * expansion[:, None, None]).reshape(-1, len(known)))
        u = self._each_its_own() * expansion[:, None]
        columns = (u[:, :, None] * np.eye(count)).reshape(-1, count)
        _, place = np.unique(np.round(self.places / _SAME_MM), axis=0, return_inverse=True)
        index = np.repeat(place.ravel(), count)
        own = Freedoms(columns, index, int(index.max()) + 1)
        return Cause(CALIBRATION, np.zeros((len(columns), 1)), own, change * size.sd)

    def _each_its_own(self) -> Floats:
        """Standard uncertainty of each coordinate, (n, j) mm, if none has to do with another."""
        count = self.places.shape[1]
        if count == 1:
            away = np.abs(self.places)
            stated = np.where(away > _SAME_MM, self.facts.u_of(away) * MICROMETRE, 0.0)
        else:
            there = np.unique(self.places, axis=0)
            farthest = np.array([np.linalg.norm(there - place, axis=1).max() for place in self.places])
            stated = np.repeat(self.facts.u_of(farthest)[:, None] * MICROMETRE / np.sqrt(2.0), count, axis=1)
        return np.asarray(stated if self.u is None else np.maximum(stated, self.u), dtype=np.float64)

    def _with_the_longest(self, sd_mm: float, first: int, last: int) -> Floats:
        """Covariance of all certified places with the longest length, over its variance, (f, j)."""
        along = self.places[last] - self.places[first]
        along = along / np.linalg.norm(along)
        a, b = self.index[first], self.index[last]
        columns = [part * (c[:, b] - c[:, a]) for part, c in zip(along, self.covariance or (), strict=True)]
        return np.asarray(np.column_stack(columns) / max(sd_mm, _LEAST_MM) ** 2, dtype=np.float64)


def causes_of(artefact: Artefact, circumstances: Circumstances) -> tuple[Cause, ...]:
    """Causes that the observations (m,) of an artefact err by; none where nothing is stated, or none has to do with it.

    The coefficient of expansion is one; whether the others err alike in all set-ups is not known. Of the calibration a size of
    the artefact has what all its lengths have in common; here is what is more where each has an error of its own. Of a form
    only the deviation is certified, a range F: any pattern of some waves may be all of it. A wave of that range swings by F/2,
    its cosine and its sine by an unknown phase, each with a mean square of F²/8 (arc sine, JCGM 101:2008, 6.4.6.4): F/4 of a
    pattern of mean square one over the points. What all patterns together do to an estimate is what its own would do.
    """
    stated, along, set_up = circumstances.uncertainty, growth(artefact), artefact.measurement
    form = artefact.form_changes(float(np.hypot(artefact.form, stated.u_form_um * MICROMETRE)))
    forms = (Cause.of_blocks(say("form of the artefact"), form, set_up),) if form.size else ()
    if along is None:
        return forms
    excess = np.zeros(len(along))
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
    stated_causes = (*(cause for cause in every if np.any(cause.common)), *forms)
    return stated_causes if calibration is None else (calibration, *stated_causes)


def growth(artefact: Artefact) -> Floats | None:
    """Change of the observations (m,), mm, if the artefact were twice its size; ``None`` without a dimension."""
    dimensions = [i for i, size in enumerate(artefact.sizes) if size.role == "dimension"]
    if not dimensions:
        return None
    nominal = np.array([artefact.sizes[i].nominal for i in dimensions])
    return np.asarray(artefact.size_change()[:, dimensions] @ nominal, dtype=np.float64)


def taken_as_exact(artefact: Artefact, used: NDArray[np.bool_], weights: Floats, u: float) -> list[Text]:
    """Of what an estimate rests on nobody states an uncertainty, in words.

    used : which observations (m,) it is from. weights : (n,) by how much it changes with each of these, per mm.
    u : its standard uncertainty. It rests on a size of which a ppm moves it by a thousandth of u, on certified places where
    it is of several, and on readings that have a thousandth of the square of its weights.
    """
    found = [
        reason for reason, own in artefact.exact if np.sum(weights[own[used]] ** 2) > _NOTICED * (weights @ weights)
    ]
    exact = [i for i, size in enumerate(artefact.sizes) if size.role == "dimension" and size.sd == 0]
    if exact:
        nominal = [artefact.sizes[i].nominal for i in exact]
        moved = np.abs(weights @ artefact.size_change()[used][:, exact]) * nominal * PPM
        places = isinstance(getattr(artefact, "certificate", None), CertifiedPlaces)
        own = [i for i, by in zip(exact, moved, strict=True) if places or by > _NOTICED * u]
        found += [without_uncertainty(artefact.sizes[i].title) for i in own]
    return found


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
    facts: ArtefactFacts, points: Points, body: Body, known: Known, *, axes: int = 3,
    geometry: Iterable[OwnFault] = tuple(GEOMETRY.values()),
) -> Iterable[Effect]:  # fmt: skip
    own = FaultyArtefact(body, points, known.um, known.weight, axes, expansion_of(facts), known.mostly)
    if axes * len(body.places) <= MOST_ERRORS and deformations(own).shape[1]:
        yield PATTERN.made(own)
    for fault in geometry:
        with suppress(CmmUqError):  # it needs the travel of an axis, which the job does not give
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


def form_faults(
    facts: ArtefactFacts, form_um: float | None, points: Points, lobes: OwnFault | None = LOBES, form: OwnFault = FORM
) -> Iterable[Effect]:
    """That a sphere is not round, or a ring.

    ``form_um``: form deviation by its certificate, µm, which is about four standard deviations of it.
    """
    um = _UNKNOWN_FORM_UM if form_um is None else max(form_um, _LEAST_FORM_UM) / _FORM
    own = FaultyArtefact(Body.of(points, points.xyz), points, um, _ROUND, 3, expansion_of(facts))
    if lobes is not None:
        yield lobes.made(own)
    yield form.made(replace(own, size=um / len(form.made(own).coefficients) ** 0.5))


def expansion_of(facts: ArtefactFacts) -> float:
    return facts.cte_per_k or STEEL
