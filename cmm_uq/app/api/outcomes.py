"""What the calls give: figures to compute with, something to look at in a notebook, and files when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from cmm_uq.app.api.pictures import DiagnosisResults, NotebookView, chosen, figures_of
from cmm_uq.app.commands.diagnose import DIAGNOSE
from cmm_uq.app.commands.files import Form
from cmm_uq.app.commands.parts.part import document_of, written
from cmm_uq.app.commands.plan import PLAN
from cmm_uq.app.commands.prove import PROVE
from cmm_uq.app.commands.report import REPORT
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import html_table
from cmm_uq.base.units import printed_unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.diagnosis.page import diagnosis_sections
from cmm_uq.certificate.diagnosis.sections import field_picture
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.part.figures import part_summary
from cmm_uq.certificate.part.measurement import PartMeasurement, part_results
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.certificate.sections.conformity import ranking_plot
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.machine.physics.stated import physics_of
from cmm_uq.maths.inference.draws import Draws
from cmm_uq.maths.uncertainty.quantity import rounded

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

QUANTITY = ("value", "u", "lower", "upper", "unit")


def quantities(results: Mapping[str, Any], units: Mapping[str, str]) -> pd.DataFrame:
    """Estimates of results.json: of effects and other errors, of the artefact's sizes, of the noise where it is estimated.

    ``units``: as printed, by name; of what is missing there, the unit is that in which its name ends.
    """
    owners: dict[str, Any] = {**results.get("estimates", {}), "artefact": results.get("artefact", {})}
    stated = {key: item for key, item in results.get("noise", {}).items() if _is_quantity(item) and item["u"] > 0}
    found = {
        f"{owner}.{name}": item for owner, items in {**owners, "noise": stated}.items()
        for name, item in items.items() if _is_quantity(item)
    }  # fmt: skip
    return quantity_frame(found, units)


def quantity_frame(found: Mapping[str, Mapping[str, Any]], units: Mapping[str, str]) -> pd.DataFrame:
    """Quantities of results.json as rows of value, u, ends of the 95 % interval, and unit."""
    import pandas as pd

    rows = [
        (item["value"], item["u"], *item["interval95"], units.get(name, printed_unit(name)))
        for name, item in found.items()
    ]
    return pd.DataFrame(rows, index=pd.Index(list(found), name="quantity"), columns=list(QUANTITY))


def _is_quantity(item: object) -> bool:
    return isinstance(item, Mapping) and {"value", "u", "interval95"} <= item.keys()


def shown(frame: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    """Rows of text of quantities: name, value ± U, unit; U is the larger part of the 95 % interval."""
    for name, value, u, lower, upper, unit in frame.itertuples():
        text, expanded = rounded(value, max(upper - value, value - lower)) if u > 0 else (f"{value:.6g}", "0")
        yield str(name), f"{text} ± {expanded}", str(unit)


@dataclass(frozen=True, eq=False, repr=False)
class Found(NotebookView):
    """What a call found, the figures and the document; nothing is written before :meth:`write`."""

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
        """Program and plugins, hashes of the inputs, seed; see :class:`cmm_uq.certificate.result.Outcome`."""
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
        return f"<{type(self).__name__.removesuffix('Outcome')} of {self.job.facts.job.id}: {self._said()}>"

    def compose(self) -> Document:
        with lettered_in(self.job.facts.job.language), physics_of(self.job):
            return self.outcome.composed()

    def _said(self) -> str:
        """The outcome in a few words."""
        return "conforming" if self.conforming else "not conforming"

    def _tables(self) -> list[str]:
        short = self.outcome.summary
        return [html_table("Summary", (), short.rows), html_table("Details", (), short.details)]


class Report(Found):
    """What ``report`` found."""

    form = REPORT
    first = ("trumpet", "tolerances", "lengths", "residuals")

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

    @cached_property
    def pictures(self) -> Mapping[str, Figure]:
        """Every picture of certificate and diagnosis by its name, and ``ranking``: which error makes how much."""
        return {**self._diagnosed, **super().pictures}

    @cached_property
    def _diagnosed(self) -> Mapping[str, Figure]:
        found = self.outcome.found
        if not isinstance(found, Result):
            return {}
        with lettered_in(self.job.facts.job.language), physics_of(self.job):
            (ranking,) = figures_of(lambda: ranking_plot(found)).values()
            field = figures_of(lambda: field_picture(found.diagnosed.diagnosis))
            return {"ranking": ranking, **field, **figures_of(lambda: diagnosis_sections(found.diagnosed))}

    @property
    def diagnosis(self) -> DiagnosisResults:
        """What the model of the job leaves out, as in results.json, with a ``plot``; empty where the kind has no diagnosis."""

        def draw(name: str | None) -> Figure:
            return chosen(self._diagnosed, name, ("field",), f"Diagnosis of {self.job.facts.job.id}")

        return DiagnosisResults(self.results.get("diagnosis", {}), draw)

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


class DiagnosisOutcome(Found):
    """What ``diagnose`` found."""

    form = DIAGNOSE
    first = ("field", "lengths")

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


class PlanOutcome(Found):
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


class ProofOutcome(Found):
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


@dataclass(frozen=True, eq=False, repr=False)
class Part(NotebookView):
    """What was found of a part; nothing is written before :meth:`write`."""

    found: PartMeasurement
    first: ClassVar[tuple[str, ...]] = ("limits", "budget", "part")

    @property
    def job(self) -> PartJob:
        """The job that was asked for."""
        return self.found.job

    @cached_property
    def results(self) -> Mapping[str, Any]:
        """Contents of results.json, before rounding to ten digits."""
        return part_results(self.found)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must be known before a figure is used."""
        return self.found.warnings

    @property
    def conforming(self) -> bool:
        """Whether nothing that was decided is anything but a pass: what ``--strict`` on the command line asks."""
        return self.found.conforming

    @cached_property
    def characteristics(self) -> pd.DataFrame:
        """Every characteristic by its name: value, u, U, k, interval, limits, decision, probability, unit."""
        import pandas as pd

        rows = {
            one["name"]: {
                **{key: one[key] for key in ("what", "value", "u", "U", "k", "unit")},
                "interval_lower": one["interval95"][0], "interval_upper": one["interval95"][1],
                **{key: (one["limits"] or {}).get(key) for key in ("lower", "upper")},
                **{key: (one["decision"] or {}).get(key) for key in ("outcome", "probability_conforming")},
            }
            for one in self.results["characteristics"]
        }  # fmt: skip
        return pd.DataFrame.from_dict(rows, orient="index")

    @cached_property
    def correlation(self) -> pd.DataFrame:
        """Correlation between the errors of the characteristics."""
        import pandas as pd

        names = self.results["correlation"]["characteristics"]
        return pd.DataFrame(self.results["correlation"]["matrix"], index=names, columns=names)

    @cached_property
    def budget(self) -> pd.DataFrame:
        """Total shares of each characteristic's variance, a row a cause."""
        import pandas as pd

        shares = self.results["budget"]
        rows = {each["cause"]: each["total"] for each in shares["causes"]}
        return pd.DataFrame.from_dict(rows, orient="index", columns=shares["characteristics"])

    def compose(self) -> Document:
        return document_of(self.found)

    def write(
        self, folder: str | Path | None = None, *, force: bool = False, records: str | Path | None = NONE
    ) -> dict[str, Path]:
        """Write the files that ``cmm-uq part`` writes, all or none.

        Parameters
        ----------
        folder : to write to; ``reports/<job id>`` where none is given.
        force : keep what stands in the way as ``NAME.previous`` instead of refusing.
        records : file or URL of the records that it is kept in; ``none`` for none, ``None`` for those that the command takes.
        """
        out = None if folder is None else Path(folder)
        return dict(written(self.job, lambda: self.found, out, force=force, records=records).files)

    def __repr__(self) -> str:
        said = [f"{len(self.found.stated)} characteristics", *filter(None, [self.found.outcome])]
        return f"<Part of {self.job.facts.job.id}: {', '.join(said)}>"

    def _tables(self) -> list[str]:
        return [html_table("Summary", (), part_summary(self.found).rows)]


Diagnosis, Plan, Proof = DiagnosisOutcome, PlanOutcome, ProofOutcome  # names of version 0.15, for one release more
