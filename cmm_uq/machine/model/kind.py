"""What a kind of measurement is: a name, its keys in ``[artefact]``, and what it offers to each room.

A room that needs something particular to a kind gets it as an argument and says of what class it must be; it never asks for a
kind's name. A facet is given as an object, or as the place where it is found, ``"package.module:NAME"``, and is then loaded
when a command first asks for it.

What a new job of a kind begins with, so that it can be reported at once and then be given the laboratory's own figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, TypeVar

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact

# effects that a length standard in many places determines
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


@dataclass(frozen=True)
class Beginning:
    """What a new job of a kind begins with."""

    title: str  # what is measured, in words
    numbering: str  # what ``measurement`` and ``point`` number, in a sentence
    artefact: Mapping[str, Any] = field(default_factory=dict)  # keys of ``[artefact]`` beside its kind
    effects: tuple[str, ...] = SIX  # that the model names
    conformity: Mapping[str, Any] | None = None  # one statement, or none
    # tables of the circumstances that a pass needs beside it
    test: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    recorded: Mapping[str, float] = field(default_factory=dict)  # columns of the first recording at a constant value
    # keys of ``[plan]`` by which the kind's usual plan makes the set-ups of the first recording
    plan: Mapping[str, Any] = field(default_factory=dict)
    # that the recording must have beside those of every kind, with a sentence for those that are the kind's own
    columns: Mapping[str, str] = field(default_factory=dict)
    further: Mapping[str, str] = field(default_factory=dict)  # that it may have, likewise
    points: Callable[[Machine], Points] | None = None  # the set-ups, where the kind has no plan of placings
    # contents of files that the machine's table names, by name, where there is no recording; with ``machine``
    files: Callable[[Machine], Mapping[str, bytes]] | None = None
    machine: Mapping[str, Any] = field(default_factory=dict)  # keys of ``[machine]`` that name them
    noise_um: float = 0.5  # standard deviation of the readings of the first recording
    command: str = "report"  # that serves such a job
    measured: str = ""  # what an export is of, where the title says the first recording's set-ups


# ``[machine]`` of a new job of any kind
MACHINE: Mapping[str, Any] = MappingProxyType({
    "name": "Bridge machine", "travel_mm": {"x": [0.0, 700.0], "y": [0.0, 1000.0], "z": [-600.0, 0.0]},
})  # fmt: skip
AT_20_C: Mapping[str, float] = MappingProxyType({"temp_artefact_c": 20.0})  # in a first recording


def circumstances(**uncertainty: Any) -> Mapping[str, Mapping[str, Any]]:
    """Tables that a pass needs: these lines of the test uncertainty, and rated temperatures."""
    return {"test_uncertainty": uncertainty, "rated_conditions": {"temperature_c": [18.0, 22.0]}}


# what a standard may be decided on: of an artefact ``indications``; ``lengths`` of one bar in many positions, and figures of
# their range; ``forms``; ``positionings``
LENGTHS, BARS, FORMS = "calibrated lengths", "lengths of one bar", "forms of test spheres"
POSITIONING = "runs that position an axis"

Facet = TypeVar("Facet")
Observe = Callable[..., Artefact]  # ``(facts, points, *, where)``: the artefact that a job describes, as recorded
Observed = Callable[[Points], Artefact]  # The same with what the job says of the artefact filled in
_PACKAGE = "Mend the package that it comes from"


@dataclass(frozen=True)
class Kind:
    """A kind of measurement. What it does not offer is refused in words, as is what cannot be loaded or is something else."""

    name: str  # in ``[artefact] kind``
    table: type[ArtefactFacts] = ArtefactFacts  # its keys of ``[artefact]``
    # makes an artefact of points; ``None`` where the recording is none of an artefact
    observe: Observe | str | None = None
    screen: object = None  # a :class:`~cmm_uq.analysis.screening.shape.Screening`
    plan: object = None  # a :class:`~cmm_uq.analysis.planning.setting.Planning`
    page: object = None  # a :class:`~cmm_uq.certificate.result.Page`
    begin: object = None  # a :class:`~cmm_uq.jobs.beginning.Beginning`: what a new job of the kind begins with
    # the same for a further way of it, by the name that it is asked for by
    begin_also: Mapping[str, str] = field(default_factory=dict, hash=False)
    check: object = None  # ``(job)``: what its own analysis refuses, before anything is estimated
    own: object = None  # a :class:`~cmm_uq.certificate.result.OwnAnalysis`, where its errors are no list of effects
    tested: tuple[str, ...] = ()  # what of it a standard may be decided on: of the above, or a word of its own
    # refusal, instead: why some command cannot serve it, with ``{}`` for what cannot be done, and what can be done
    refusal: str = ""
    instead: str = "Use another command"

    def offers(self, facet: str, of: type[Facet]) -> Facet | None:
        """Its ``screen``, ``plan``, ``page``, ``begin`` or ``own``, loaded; ``None`` where it has none."""
        found = self._loaded(getattr(self, facet))
        if found is None or isinstance(found, of):
            return found
        raise CmmUqError(f"{facet} of the kind {self.name!r} is no {of.__name__}", fix=_PACKAGE)

    def needs(self, facet: str, of: type[Facet], what: str) -> Facet:
        """One of its facets, for a command that cannot do without: without it ``what`` (as ``planned``) cannot be done."""
        found = self.offers(facet, of)
        if found is None:
            raise self.refused(what)
        return found

    def refuse_unfit(self, job: object) -> None:
        """Refuse a job that its own analysis would; nothing where it has none."""
        check = self._loaded(self.check)
        if callable(check):
            check(job)

    def beginning(self, name: str) -> Beginning:
        """What a new job begins with, of the kind's own name or of a further one."""
        found = self._loaded(self.begin_also[name]) if name in self.begin_also else self.offers("begin", Beginning)
        return found if isinstance(found, Beginning) else Beginning(self.name, "")

    @property
    def by_effects(self) -> bool:
        """Whether its certificate is of effects that are named, and not of an analysis of its own."""
        return self.observe is not None and getattr(self._loaded(self.own), "report", None) is None

    def observing(self, what: str) -> Observe:
        """What makes an artefact of facts and points, for a command that cannot do without."""
        found = self._loaded(self.observe)
        if found is None:
            raise self.refused(what)
        if not callable(found):
            raise CmmUqError(f"observe of the kind {self.name!r} is no function", fix=_PACKAGE)
        observe: Observe = found
        return observe

    def refused(self, what: str) -> CmmUqError:
        """The error of a command that cannot serve this kind."""
        refusal = self.refusal or f"a job of kind {self.name!r} cannot be {{}}"
        return CmmUqError(refusal.format(what), where="job.toml [artefact] kind", fix=self.instead)

    def _loaded(self, facet: object) -> object:
        if not isinstance(facet, str):
            return facet
        module, _, name = facet.partition(":")
        try:
            return getattr(import_module(module), name)
        except (ImportError, AttributeError) as error:
            problem = f"the kind {self.name!r} names {facet!r}, which cannot be loaded: {error}"
            raise CmmUqError(problem, fix=_PACKAGE) from error
