"""What every analysis ends in: a document, figures for programs, and a summary; and what a kind offers towards them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.certificate.document import Document, Section
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import Summary
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.origin import Origin
from cmm_uq.jobs.verdicts import NO_VERDICTS, Verdicts
from cmm_uq.maths.inference.draws import Draws


class AnalysisResult(Protocol):
    """What an analysis found, in the kind's own terms; of most kinds a :class:`~cmm_uq.certificate.result.Result`."""

    @property
    def job(self) -> Job: ...


@dataclass(frozen=True, eq=False)
class Outcome:
    """What there is to write of an analysis.

    Parameters
    ----------
    found : in the kind's own terms.
    composed : makes the certificate, or the page of a diagnosis; its pictures take longer than all other figures of it.
    results : contents of results.json.
    summary : for the end of a command.
    warnings : what the reader must know before using a figure.
    files : further ones, by name.
    verdicts : every statement of conformity.
    in_order : whether all else is: the recording agrees with the model that the job names, a plan meets its conditions.
    draws : of the posterior of all that is reported, where the kind's analysis draws from one.
    """

    found: AnalysisResult
    composed: Callable[[], Document]
    results: Mapping[str, Any]
    summary: Summary
    warnings: tuple[Text, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    verdicts: Verdicts = NO_VERDICTS
    in_order: bool = True
    draws: Draws | None = None

    @property
    def conforming(self) -> bool:
        """Whether every statement of conformity is a pass, and all else is in order."""
        return self.verdicts.conforming and self.in_order

    @cached_property
    def document(self) -> Document:
        """Certificate, or page of a diagnosis; composed when it is first asked for."""
        with lettered_in(self.found.job.facts.job.language):
            return self.composed()

    @property
    def origin(self) -> Origin:
        return self.found.job.origin

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What it was made from and by what.

        ``software`` with the plugins that took part, ``job`` with the hashes of its inputs and where its recording comes from,
        and ``seed`` where a posterior was sampled.
        """
        sampling = self.results.get("sampling", {})
        return {key: self.results[key] for key in ("software", "job") if key in self.results} | (
            {"seed": sampling["seed"]} if "seed" in sampling else {}
        )


@dataclass(frozen=True)
class Page:
    """What a kind adds to a certificate.

    Parameters
    ----------
    sections : after those that every certificate has.
    results : further keys of results.json.
    """

    sections: Callable[[Result], list[Section]]
    results: Callable[[Result], Mapping[str, Any]] | None = None

    def with_further(self, result: Result, data: Mapping[str, Any]) -> dict[str, Any]:
        """Contents of results.json that every result has, and the kind's further keys."""
        further = {} if self.results is None else self.results(result)
        if clash := sorted(set(further) & set(data)):
            raise CmmUqError(f"a kind's own results cannot be named {clash[0]!r}, which every result has",
                             fix="Mend the package that the kind comes from")  # fmt: skip
        return {**data, **further}


@dataclass(frozen=True)
class Recipe:
    """A kind's own way from a job to its outcome.

    ``analyse``: ``(job, *, seed, progress)``, of a diagnosis also ``alpha``: what it finds; ``outcome``: of that, and
    of the seed.
    """

    analyse: Callable[..., AnalysisResult]
    outcome: Callable[[Any, int], Outcome]


@dataclass(frozen=True)
class OwnAnalysis:
    """What a kind does by itself, because its errors are no list of effects."""

    report: Recipe | None = None
    diagnose: Recipe | None = None
