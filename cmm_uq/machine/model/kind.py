"""What a kind of measurement is: a name, its keys in ``[artefact]``, and what it offers to each room.

A room that needs something particular to a kind gets it as an argument and says of what class it must be; it never asks for a
kind's name. A facet is given as an object, or as the place where it is found, ``"package.module:NAME"``, and is then loaded
when a command first asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TypeVar

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact

LENGTHS = "calibrated lengths"  # That a standard may be decided on: ``Artefact.indications``

BARS = "lengths of one bar"  # The same: ``Artefact.lengths`` of one bar in many positions, and figures of their range

FORMS = "forms of test spheres"  # The same: ``Artefact.forms``

Facet = TypeVar("Facet")

Observe = Callable[..., Artefact]  # ``(facts, points, *, where)``: the artefact that a job describes, as recorded


Observed = Callable[[Points], Artefact]  # The same with what the job says of the artefact filled in


@dataclass(frozen=True)
class Kind:
    """A kind of measurement. What it does not offer is refused in words.

    Parameters
    ----------
    name : in ``[artefact] kind``.
    table : its keys of ``[artefact]``.
    observe : makes an artefact of points; ``None`` where the recording is no points of an artefact.
    screen : a :class:`~cmm_uq.analysis.screening.shape.Screening`.
    plan : a :class:`~cmm_uq.analysis.planning.setting.Planning`.
    page : a :class:`~cmm_uq.certificate.result.Page`.
    begin : a :class:`~cmm_uq.jobs.beginning.Beginning`: what a new job of the kind begins with.
    begin_also : the same for a further way of it, by the name that it is asked for by.
    check : ``(job)``: what its own analysis refuses, before anything is estimated.
    own : a :class:`~cmm_uq.certificate.result.OwnAnalysis`, where its errors are no list of effects.
    tested : what of it a standard may be decided on: :data:`LENGTHS`, :data:`BARS`, :data:`FORMS`, or a word of its own.
    refusal, instead : why some command cannot serve it, with ``{}`` for what cannot be done, and what can be done.
    """

    name: str
    table: type[ArtefactFacts] = ArtefactFacts
    observe: Observe | str | None = None
    screen: object = None
    plan: object = None
    page: object = None
    begin: object = None
    begin_also: Mapping[str, str] = field(default_factory=dict, hash=False)
    check: object = None
    own: object = None
    tested: tuple[str, ...] = ()
    refusal: str = ""
    instead: str = "Use another command"

    def offers(self, facet: str, of: type[Facet]) -> Facet | None:
        """One of its facets, loaded; ``None`` where it has none.

        Parameters
        ----------
        facet : ``screen``, ``plan``, ``page``, ``begin`` or ``own``.
        of : what it must be.

        Raises
        ------
        CmmUqError : it is something else, or cannot be loaded: the package that it comes from is broken.
        """
        found = self._loaded(getattr(self, facet))
        if found is None or isinstance(found, of):
            return found
        raise CmmUqError(f"{facet} of the kind {self.name!r} is no {of.__name__}",
                         fix="Mend the package that it comes from")  # fmt: skip

    def needs(self, facet: str, of: type[Facet], what: str) -> Facet:
        """One of its facets, for a command that cannot do without.

        Parameters
        ----------
        what : cannot be done without it, as ``planned``.

        Raises
        ------
        CmmUqError : it has none, or see :meth:`offers`.
        """
        found = self.offers(facet, of)
        if found is None:
            raise self.refused(what)
        return found

    def refuse_unfit(self, job: object) -> None:
        """Refuse a job that its own analysis would; nothing where it has none.

        Raises
        ------
        CmmUqError : as the analysis would.
        """
        check = self._loaded(self.check)
        if callable(check):
            check(job)

    def beginning(self, name: str) -> Beginning:
        """What a new job begins with, of the kind's own name or of a further one.

        Raises
        ------
        CmmUqError : it cannot be loaded: the package that it comes from is broken.
        """
        found = self._loaded(self.begin_also[name]) if name in self.begin_also else self.offers("begin", Beginning)
        return found if isinstance(found, Beginning) else Beginning(self.name, "")

    def observing(self, what: str) -> Observe:
        """What makes an artefact of facts and points, for a command that cannot do without.

        Raises
        ------
        CmmUqError : it has none, or see :meth:`offers`.
        """
        found = self._loaded(self.observe)
        if found is None:
            raise self.refused(what)
        if not callable(found):
            raise CmmUqError(f"observe of the kind {self.name!r} is no function",
                             fix="Mend the package that it comes from")  # fmt: skip
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
            raise CmmUqError(f"the kind {self.name!r} names {facet!r}, which cannot be loaded: {error}",
                             fix="Mend the package that it comes from") from error  # fmt: skip
