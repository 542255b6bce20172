"""What may be measured on a machine so that a part is known better: artefacts at the part's place and in the whole range."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress

import numpy as np

from cmm_uq.analysis.machine.recordings import FurtherRecording, model_of_machine
from cmm_uq.analysis.machine.state import StatedNoise
from cmm_uq.analysis.parts.causes.machine import directions
from cmm_uq.analysis.parts.foreseen import ForeseenMeasurement, foreseen_measurement, foretold
from cmm_uq.analysis.parts.plan import Plan, Stylus
from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.kinds import SphereFacts
from cmm_uq.artefacts.spheres.kind import RingFacts
from cmm_uq.artefacts.spheres.ring import RingGauge, around
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, number, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_states import NORMAL
from cmm_uq.machine.physics.effects.probing import RADIUS
from cmm_uq.maths.geometry.feature import frame_about

# standard uncertainties of a gauge's length, of a ball's and of a ring's diameter
GAUGE_UM, BALL_UM, BALL_MM, RING_UM = 0.4, 0.2, 25.0, 0.2
DENSE, FACES, LEAST_MM = 41, 6, 50.0  # positions on a dense line, faces on others, shortest line
_DIAGONALS = np.array([[x, y, 1.0] for x in (1.0, -1.0) for y in (1.0, -1.0)])
_INNER = 0.75  # part of the travel that lines through the measuring range take
_SIDEWAYS = 1e-6  # part of a line below which an axis does not move


@dataclass(frozen=True, eq=False)
class ProposedMeasurement:
    name: Text  # what is measured
    artefact: Artefact  # at the places where it stands
    beside: tuple[Effect, ...] = ()  # errors of its probing that are estimated too

    def recording(self, first: RecordingModel, noise: StatedNoise) -> FurtherRecording:
        """As it will be made, each point once, with the noise of the machine."""
        sd = np.sqrt(np.mean(noise.usual_mm**2) + np.mean(np.square(noise.placing_mm)))
        model = model_of_machine(first, RecordingModel(self.artefact, (*first.effects, *self.beside)))
        return FurtherRecording(model, float(sd) * np.diag(self.artefact.noise_scale))


def foresee(found: PartMeasurement, stage: Stage = silent) -> PartMeasurement:
    """With what further measurements of its machine would do, where something is undecided, or U too large."""
    virtual, chosen = found.virtual, np.array(found.too_uncertain, dtype=np.int64)
    if found.recordings is None or not foretold(found.plan)[chosen].any():
        return found
    model, beside = found.recordings
    U, told = np.array([one.U for one in found.stated]), list[ForeseenMeasurement]()
    stylus = found.plan.styli[int(np.bincount(found.plan.stylus_of).argmax())]
    known = [model.artefact.points.columns, *(one.model.artefact.points.columns for one in beside.recordings)]
    gauged = any(f"approach_{axis}" in columns for columns in known for axis in AXES)
    with suppress(CmmUqError):  # what the calibration's model refuses of another artefact
        for one in proposals(
            virtual.places[0].points, stylus, gauged=gauged, bore=bore_of(found.plan, chosen.tolist())
        ):
            stage("What to measure on the machine", 0.8)
            together = replace(beside, recordings=(*beside.recordings, one.recording(model, found.given.machine.noise)))
            told.append(foreseen_measurement(one.name, virtual, found.given, model, together, U, found.seed))
    return replace(found, foreseen=tuple(told))


@dataclass(frozen=True, eq=False)
class Bore:
    """A bore or a shaft that a ring or a plug gauge of its size may stand for."""

    rows: slice  # of the part's points
    diameter_mm: float


def bore_of(plan: Plan, chosen: Iterable[int]) -> Bore | None:
    """The first round feature of these characteristics, of their sizes before their places."""
    asked = sorted((plan.characteristics[i] for i in chosen), key=lambda one: one.what != "size")
    features = {one.name: one for one in plan.features if one.kind in ("circle", "cylinder")}
    for name in (name for one in asked for name in one.features if name in features):
        if (diameter := features[name].nominal.diameter_mm) is not None:
            return Bore(plan.rows[name], diameter)
    return None


def proposals(
    part: Points, stylus: Stylus, *, gauged: bool = False, bore: Bore | None = None
) -> Iterator[ProposedMeasurement]:
    """``part``: its points as the axes read them; ``stylus``: that probes most of them.

    ``gauged``: whether faces were met from both sides already: the same through the range again gains less than is foretold.
    """
    machine = part.machine
    travel, read = machine.travel_mm, part.carriages
    middle, size = 0.5 * (read.min(axis=0) + read.max(axis=0)), np.maximum(np.ptp(read, axis=0), LEAST_MM)
    box = np.clip(np.stack([middle - 0.5 * size, middle + 0.5 * size], axis=1), travel[:, :1], travel[:, 1:])
    inner, seven = travel.mean(axis=1, keepdims=True), np.vstack([_DIAGONALS, np.eye(3)])
    inner = inner + 0.5 * _INNER * np.array([-1, 1]) * np.ptp(travel, axis=1, keepdims=True)
    gauge, ball, apart = number(GAUGE_UM, "g"), number(BALL_UM, "g"), number(size.max() / (DENSE - 1), ".2g")
    dense = say(
        "step gauge or laser (u = {u} µm) with {count} positions along each axis through the part, up to {mm} mm apart, from "
        "both sides",
        u=gauge,
        count=DENSE,
        mm=apart,
    )
    yield ProposedMeasurement(dense, _gauge(part, stylus, box, np.eye(3), DENSE))
    about = say(
        "step gauge (u = {u} µm) with {count} faces, met from both sides, on seven lines about the part",
        u=gauge,
        count=FACES,
    )
    yield ProposedMeasurement(about, _gauge(part, stylus, box, seven, FACES))
    far = say(
        "step gauge (u = {u} µm) with {count} faces, met from both sides, on seven lines through the measuring range",
        u=gauge,
        count=FACES,
    )
    if not gauged:
        yield ProposedMeasurement(far, _gauge(part, stylus, inner, seven, FACES))
    one = say("calibrated ball (u = {u} µm) at the place of the part, {count} points", u=ball, count=len(directions()))
    yield ProposedMeasurement(one, _ball(part, stylus, middle))
    if bore is not None:
        yield _ring(part, stylus, bore)


def _gauge(part: Points, stylus: Stylus, box: Floats, lines: Floats, count: int) -> StepGauge:
    """Lines through the middle of a box (3, 2) of readings, each from face to face, mm."""
    whole = lines * np.ptp(box, axis=1)
    faces = np.linspace(-0.5, 0.5, count)[:, None]
    xyz = np.concatenate([box.mean(axis=1) + faces * one for one in whole])
    reference = np.concatenate([(faces[:, 0] + 0.5) * np.linalg.norm(one) for one in whole])
    moving = np.repeat(np.where(np.abs(lines) > _SIDEWAYS, np.sign(lines), 0.0), count, axis=0)
    moving *= np.tile(np.where(np.arange(count) % 2, -1.0, 1.0), len(lines))[:, None]
    number_, point = np.repeat(np.arange(1, len(lines) + 1), count), np.tile(np.arange(1, count + 1), len(lines))
    columns = {"reference_mm": reference, **_probed(stylus, len(xyz)), **_along("approach_", moving)}
    points = _points(part, xyz, number_, point, columns)
    return StepGauge(ReferencedFacts(kind="step_gauge", u_um=GAUGE_UM, length_mm=float(reference.max())), points)


def _ball(part: Points, stylus: Stylus, middle: Floats) -> SphereArtefact:
    out = directions()
    columns = {**_probed(stylus, len(out)), **_along("n", out), **_along("approach_", -np.sign(np.round(out, 6)))}
    ones = np.ones(len(out), dtype=np.int64)
    points = _points(part, middle + 0.5 * BALL_MM * out, ones, np.arange(1, len(out) + 1), columns)
    return SphereArtefact(SphereFacts(kind="sphere", length_mm=BALL_MM, u_um=BALL_UM), points)


def _ring(part: Points, stylus: Stylus, bore: Bore) -> ProposedMeasurement:
    """A ring or a plug gauge of the size of a bore or a shaft, in its place and attitude."""
    normals = np.column_stack([part.columns[name][bore.rows] for name in NORMAL])
    read, (u, v, _) = part.carriages[bore.rows], frame_about(np.linalg.svd(normals.T @ normals)[2][2])
    plug = bool(np.sum((read - read.mean(axis=0)) * normals) > 0)
    away = (-0.5 if plug else 0.5) * bore.diameter_mm - 0.5 * stylus.diameter_mm  # from the centre of the tip
    middle = np.mean(read + away * normals, axis=0)
    out = around() @ np.array([u, v])
    n, ones = (out if plug else -out), np.ones(len(out), dtype=np.int64)
    columns = {**_probed(stylus, len(out)), **_along("n", n), **_along("approach_", -np.sign(np.round(n, 6)))}
    points = _points(part, middle + 0.5 * bore.diameter_mm * out, ones, np.arange(1, len(out) + 1), columns)
    facts = RingFacts(kind="ring", length_mm=bore.diameter_mm, u_um=RING_UM, plug=plug)
    mm, u, count = number(bore.diameter_mm, "g"), number(RING_UM, "g"), len(out)
    of_bore = say(
        "calibrated ring of {mm} mm (u = {u} µm) in place of the bore, {count} points around", mm=mm, u=u, count=count
    )
    of_shaft = say(
        "calibrated plug gauge of {mm} mm (u = {u} µm) in place of the shaft, {count} points around",
        mm=mm,
        u=u,
        count=count,
    )
    return ProposedMeasurement(of_shaft if plug else of_bore, RingGauge(facts, points), (RADIUS,))


def _points(part: Points, read: Floats, number_: Ints, point: Ints, columns: dict[str, Floats]) -> Points:
    xyz = part.machine.coordinates(read)
    xyz = xyz + read - part.machine.readings(xyz, columns)  # of the tip, which is not where the ram reads
    return Points(xyz, number_, point, np.ones_like(point), part.machine, columns)


def _along(begin: str, each: Floats) -> dict[str, Floats]:
    return {f"{begin}{axis}": each[:, i] for i, axis in enumerate(AXES)}


def _probed(stylus: Stylus, count: int) -> dict[str, Floats]:
    return {f"tip_{axis}_mm": np.full(count, stylus.offset_mm[i]) for i, axis in enumerate(AXES)}
