"""What the calls of the API give: figures to compute with, something to look at in a notebook, and files when asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from cmm_uq.app.api.tables import quantities, quantity_frame, shown
from cmm_uq.app.commands.plan import PLAN
from cmm_uq.app.commands.prove import PROVE
from cmm_uq.app.commands.report import DIAGNOSE, REPORT
from cmm_uq.app.commands.written import Form
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.notebook import html_table
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.maths.inference.draws import Draws

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """What a call found; nothing is written before :meth:`write`.

    Parameters
    ----------
    outcome : the figures and the document.
    """

    outcome: Outcome
    form: ClassVar[Form]

    @property
    def job(self) -> Job:
        """The job that was asked for."""
        return self.outcome.found.job

    @property
    def results(self) -> Mapping[str, Any]:
        """Contents of results.json, before rounding to ten digits."""
        return self.outcome.results

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must be known before a figure is used; first where the recording comes from, if it was not measured."""
        from cmm_uq.certificate.origin import origin_warnings

        return (*origin_warnings(self.job), *self.outcome.warnings)

    @property
    def origin(self) -> str:
        """``measured``, ``simulated`` or ``compensated``."""
        return self.outcome.origin

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Program and plugins, hashes of the inputs, seed; see :class:`cmm_uq.certificate.outcome.Outcome`."""
        return self.outcome.provenance

    @property
    def conforming(self) -> bool:
        """Whether all is well: what ``--strict`` on the command line asks."""
        return self.outcome.conforming

    def write(
        self, folder: str | Path | None = None, *, force: bool = False, records: str | Path | None = NONE
    ) -> dict[str, Path]:
        """Write the files that the command of the same name writes, all or none, and record it with that.

        Parameters
        ----------
        folder : to write to; without one, that of the command: below ``reports/<job id>``.
        force : as of :meth:`cmm_uq.jobs.job.Job.write`, which says too what is given back, and what is refused.
        records : file or URL of the records that it is kept in; ``none`` for none, ``None`` for those that the command takes.
        """
        out = None if folder is None else Path(folder)
        return self.form.write(self.job, lambda: self.outcome, out, force=force, records=records).files

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.job.facts.job.id}: {self._said()}>"

    def _said(self) -> str:
        """The outcome in a few words."""
        return "conforming" if self.conforming else "not conforming"

    def _tables(self) -> list[str]:
        """Tables of HTML."""
        short = self.outcome.summary
        return [html_table("Summary", (), short.rows), html_table("Details", (), short.details)]

    def _repr_html_(self) -> str:
        warned = "".join(f"<li>{escape(text)}</li>" for text in self.warnings)
        return f"<p>{escape(repr(self))}</p>{''.join(self._tables())}" + (f"<ul>{warned}</ul>" if warned else "")


class Report(Found):
    """What ``report`` found."""

    form = REPORT

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """Every estimate by its name, ``scale_x.ppm``: value, u, lower and upper end of its 95 % interval, unit."""
        draws = self.outcome.draws
        return quantities(self.results, {} if draws is None else draws.units)

    @property
    def posterior(self) -> Draws:
        """Draws of every estimate by its name, each (chain, draw); a chain is the path of one walker.

        Raises
        ------
        CmmUqError : a job of this kind has no such draws.
        """
        if self.outcome.draws is None:
            raise CmmUqError(f"the analysis of a job of kind {self.job.facts.artefact.kind!r} gives no draws by name",
                             fix="Use results, with its curves and their uncertainty")  # fmt: skip
        return self.outcome.draws

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance between all estimates, in the products of their units.

        Raises
        ------
        CmmUqError : see :attr:`posterior`.
        """
        return self.posterior.covariance

    @cached_property
    def figures(self) -> pd.DataFrame:
        """Figures of performance, in columns as ``estimates``; empty where there are no lengths."""
        return quantity_frame(self.results.get("accuracy_uncertainty", {}), {})

    @cached_property
    def conformity(self) -> pd.DataFrame:
        """Statements of conformity, one a row, with the columns of results.json; lengths and remarks as lists."""
        import pandas as pd

        return pd.DataFrame(list(self.results.get("conformity", [])))

    @property
    def diagnosis(self) -> Mapping[str, Any]:
        """What the model of the job leaves out, as in results.json; empty where the kind has no diagnosis."""
        found: Mapping[str, Any] = self.results.get("diagnosis", {})
        return found

    def _said(self) -> str:
        decided = [f"{one.by or one.name} {one.outcome}" for one in self.outcome.verdicts]
        return ", ".join([f"{len(self.estimates)} estimates", *decided, *filter(None, [self.diagnosis.get("verdict")])])

    def _tables(self) -> list[str]:
        decided = [
            (one.by or str(one.title), *("–" if size is None else f"{size:.4g} {one.unit}" for size in (one.value, one.limit)),
             one.outcome)
            for one in self.outcome.verdicts
        ]  # fmt: skip
        heads = ("Quantity", "Value ± U (95 %)", "Unit")
        return [
            html_table("Estimates", heads, shown(self.estimates)),
            html_table("Figures of performance", heads, shown(self.figures)),
            html_table("Conformity", ("Standard", "Value", "Limit", "Decision"), decided),
        ]


class Diagnosis(Found):
    """What ``diagnose`` found."""

    form = DIAGNOSE

    @property
    def diagnosis(self) -> Mapping[str, Any]:
        """As in results.json."""
        found: Mapping[str, Any] = self.results["diagnosis"]
        return found

    @property
    def verdict(self) -> str:
        """``consistent``, ``explained``, ``partial`` or ``unexplained``."""
        return str(self.diagnosis["verdict"])

    @cached_property
    def effects(self) -> pd.DataFrame:
        """What was left out: parameters of each effect, with value, u, lower, upper, unit and the effect's probability."""
        found = {
            f"{each['effect']}.{name}": item for each in self.diagnosis["effects"] for name, item in each["parameters"].items()
        }  # fmt: skip
        chance = [each["probability"] for each in self.diagnosis["effects"] for _ in each["parameters"]]
        return quantity_frame(found, {}).assign(probability=chance)

    def _said(self) -> str:
        return self.verdict


class Plan(Found):
    """What ``plan`` found."""

    form = PLAN

    @cached_property
    def placings(self) -> pd.DataFrame:
        """What is to be measured: title, minutes and number of points, by measurement."""
        import pandas as pd

        frame = pd.DataFrame(list(self.results["placings"]), columns=["measurement", "title", "minutes", "points"])
        return frame.set_index("measurement")

    def _said(self) -> str:
        return f"{len(self.placings)} placings to measure, {self.results['minutes']:.0f} min"


class Proof(Found):
    """What ``prove`` found."""

    form = PROVE

    @property
    def sha256(self) -> str:
        """Of the truth of all cases, sealed before the first of them was diagnosed."""
        return str(self.results["truth_sha256"])

    @cached_property
    def rates(self) -> pd.DataFrame:
        """Every rate by its name: count, of, rate, lower and upper end of its 95 % interval."""
        import pandas as pd

        rows = {
            name: (each["count"], each["of"], each["rate"], *each["interval95"])
            for name, each in {**self.results["rates"], "coverage": self.results["coverage"]["pooled"]}.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=["count", "of", "rate", "lower", "upper"])

    def _said(self) -> str:
        standings = (f"{each['figure']} {each['standing']}" for each in self.results["acceptance"])
        return ", ".join([f"{self.results['cases']} cases", *standings])
