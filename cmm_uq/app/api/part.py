"""What the call ``part`` gives: figures to compute with, something to look at in a notebook, and files when asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.part_written import written
from cmm_uq.base.notebook import html_table
from cmm_uq.certificate.part.found import PartFound
from cmm_uq.certificate.part.results import part_results
from cmm_uq.certificate.part.summary import part_summary
from cmm_uq.jobs.part.job import PartJob

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """What was found of a part; nothing is written before :meth:`write`.

    Parameters
    ----------
    found : all of it.
    """

    found: PartFound

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

    def write(self, folder: str | Path | None = None, *, force: bool = False) -> dict[str, Path]:
        """Write the files that ``cmm-uq part`` writes, all or none.

        Parameters
        ----------
        folder : to write to; ``reports/<job id>`` where none is given.
        force : keep what stands in the way as ``NAME.previous`` instead of refusing.
        """
        out = None if folder is None else Path(folder)
        return dict(written(self.job, lambda: self.found, out, force=force).files)

    def __repr__(self) -> str:
        said = [f"{len(self.found.stated)} characteristics", *filter(None, [self.found.outcome])]
        return f"<Part of {self.job.facts.job.id}: {', '.join(said)}>"

    def _repr_html_(self) -> str:
        short = part_summary(self.found)
        warned = "".join(f"<li>{escape(text)}</li>" for text in self.warnings)
        table = html_table("Summary", (), short.rows)
        return f"<p>{escape(repr(self))}</p>{table}" + (f"<ul>{warned}</ul>" if warned else "")
