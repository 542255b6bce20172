"""What planning needs to know of a job, together: the artefact, the wishes, the room."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from cmm_uq.analysis.planning.noise import PlannedNoise
from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reports import noise_found, results_named
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Kind, Observe
from cmm_uq.machine.physics.catalogue import effects, every
from cmm_uq.machine.physics.effect import CONTRACT, Effect

ASSUMED_NOISE_UM = 1.0  # standard uncertainty of a coordinate where the job states none


@dataclass(frozen=True, eq=False)
class Start:
    """What there is before better set-ups are searched for."""

    artefact: Artefact  # at the set-ups of a recording or of a ready plan
    again: SetUp | None  # the first set-up of the recording, to be set up elsewhere; None without a recording


@dataclass(frozen=True)
class Planning:
    """What a kind of measurement offers to planning.

    ``ready`` plans by name, the usual one first; ``candidates`` set-ups that volume and fixtures allow, at most as
    many as the plan says; ``elsewhere`` a recorded artefact in other places and attitudes, once in each, at most so
    many; ``shared`` whether the freedoms of its set-up are common to all measurements, so that their information does
    not add; ``sought`` whether it is sizes of the artefact that are sought, so that no effect need be named; ``free``
    what set-ups leave open, in words, of a kind that names no effects; ``(setting, points, where)``.
    """

    ready: Mapping[str, Callable[[Setting], tuple[SetUp, ...]]]
    candidates: Callable[[Setting, Start | None], tuple[SetUp, ...]]
    elsewhere: Callable[[Artefact, Volume, int], tuple[SetUp, ...]] | None = None
    shared: bool = False
    sought: bool = False
    free: Callable[[Setting, Points, str], tuple[Text, ...]] | None = None


@dataclass(frozen=True, eq=False)
class Setting:
    """An artefact, a plan's wishes, and the room for it.

    ``artefact`` as the job describes it; ``observe``, ``planning`` makes an artefact of that and of points; what its
    kind offers here; ``plan`` ``[plan]``; ``volume`` room; ``named`` effects that the job's model names; ``sigma``
    standard uncertainty of one coordinate, mm; ``stated`` the same as the job states it; ``None`` where it does not;
    ``noise`` with its set-up offsets; ``None`` where it is taken as white.
    """

    artefact: ArtefactFacts
    observe: Observe | None
    planning: Planning
    plan: PlanFacts
    volume: Volume
    named: tuple[Effect, ...]
    sigma: float
    stated: float | None = None
    noise: PlannedNoise | None = None

    @classmethod
    def of(cls, job: Job, kind: Kind) -> Setting:
        facts, plan = job.facts, job.facts.plan
        planning = kind.needs("plan", Planning, "planned")
        observe = kind.observing("planned") if planning.free is None else None
        if not (facts.model.effects or planning.sought) and planning.free is None:
            raise CmmUqError("no effect is named, so there is nothing to determine", where="job.toml [model] effects",
                             fix="Name the error factors that the measurement shall determine")  # fmt: skip
        recorded = job.points.carriages if len(job.points) else None
        stated, noise = facts.recording.u_coordinate_um, _noise(job)
        return cls(
            facts.artefact, observe, planning, plan, Volume.of(job.points.machine, plan, recorded),
            effects(facts.model.effects, where="job.toml [model] effects"), noise.coordinate,
            None if stated is None else stated * MICROMETRE, noise,
        )  # fmt: skip

    @property
    def machine(self) -> Machine:
        return self.volume.machine

    def sized(self, points: Points) -> Setting:
        """The same with the artefact's length as these points show it, where its certified figures stand in the recording."""
        if not self.artefact.with_references or self.artefact.length_mm is not None:
            return self
        longest = self.observed(points).sizes[0].nominal
        return replace(self, artefact=self.artefact.model_copy(update={"length_mm": longest}))

    def model(self, points: Points, also: tuple[Effect, ...] = ()) -> RecordingModel:
        """The model that the job names, with further effects, of the artefact at these points."""
        return RecordingModel(self.observed(points), (*self.named, *also), self.sigma)

    def observed(self, points: Points) -> Artefact:
        if self.observe is None:
            raise ValueError("a kind that names no effects has no artefact")
        return self.observe(self.artefact, points)

    def rivals(self, points: Points) -> tuple[Effect, ...]:
        """Effects that the job does not name: those that the plan lists, else all of the first tier that could act here."""
        named = {effect.name for effect in self.named}
        if self.plan.rivals is not None:
            where = "job.toml [plan] rivals"
            artefact = self.observed(points)
            chosen = tuple(artefact.acting(effect) for effect in effects(self.plan.rivals, where=where))
            for effect in chosen:
                if missing := [column for column in effect.columns if column not in points.columns]:
                    raise CmmUqError(f"{effect.name} needs the column {missing[0]}, which this plan does not record",
                                     where=where, fix="Leave it out, or give its value in [plan] columns")  # fmt: skip
            return tuple(effect for effect in chosen if effect.name not in named and not effect.shape)
        free = [e for e in every().values() if e.tier == CONTRACT and e.name not in named and not e.shape]
        return tuple(e for e in free if all(column in points.columns for column in e.columns))


def _noise(job: Job) -> PlannedNoise:
    plan, stated = job.facts.plan, job.facts.recording.u_coordinate_um
    reading: tuple[float, float, float] = (stated or ASSUMED_NOISE_UM,) * 3
    placing, growth = plan.placing_um, plan.growth_um
    if (name := results_named(plan.noise_from)) is not None:
        found = noise_found(job.inputs[name], str(job.folder / name))
        reading, placing, growth = found.reading_um, found.placing_um, found.growth_um
    x, y, z = (size * MICROMETRE for size in reading)
    offset, growing = (None if size is None else size * MICROMETRE for size in (placing, growth))
    return PlannedNoise((x, y, z), offset, growing)
