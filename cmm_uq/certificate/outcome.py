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
    """What there is to write of an analysis."""

    found: AnalysisResult  # in the kind's own terms
    composed: Callable[[], Document]  # makes the certificate or page; its pictures take longer than its figures
    results: Mapping[str, Any]  # contents of results.json
    summary: Summary  # for the end of a command
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure
    files: Mapping[str, bytes] = field(default_factory=dict)  # further ones, by name
    verdicts: Verdicts = NO_VERDICTS  # every statement of conformity
    in_order: bool = True  # the recording agrees with the model that the job names, a plan meets its conditions
    draws: Draws | None = None  # of the posterior of all that is reported, where the kind's analysis draws from one

    @property
    def conforming(self) -> bool:
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
        """``software`` with plugins, ``job`` with the hashes of its inputs, and ``seed`` where a posterior was sampled."""
        sampling = self.results.get("sampling", {})
        return {key: self.results[key] for key in ("software", "job") if key in self.results} | (
            {"seed": sampling["seed"]} if "seed" in sampling else {}
        )


@dataclass(frozen=True)
class Page:
    """What a kind adds to a certificate."""

    sections: Callable[[Result], list[Section]]  # after those that every certificate has
    results: Callable[[Result], Mapping[str, Any]] | None = None  # further keys of results.json

    def with_further(self, result: Result, data: Mapping[str, Any]) -> dict[str, Any]:
        """Contents of results.json that every result has, and the kind's further keys."""
        further = {} if self.results is None else self.results(result)
        if clash := sorted(set(further) & set(data)):
            raise CmmUqError(f"a kind's own results cannot be named {clash[0]!r}, which every result has",
                             fix="Mend the package that the kind comes from")  # fmt: skip
        return {**data, **further}


@dataclass(frozen=True)
class Recipe:
    """A kind's own way from a job to its outcome."""

    analyse: Callable[..., AnalysisResult]  # ``(job, *, seed, progress)``, of a diagnosis also ``alpha``
    outcome: Callable[[Any, int], Outcome]  # of what was found and the seed


@dataclass(frozen=True)
class OwnAnalysis:
    """What a kind does by itself, because its errors are no list of effects."""

    report: Recipe | None = None
    diagnose: Recipe | None = None
