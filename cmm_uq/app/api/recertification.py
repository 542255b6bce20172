"""Calls over the records: what is due for calibration, and the history of a machine. Nothing is written before ``write``."""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.laboratory.due import WhatIsDue, history_of, what_is_due, write_due, write_history
from cmm_uq.base.messages import html_table
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.due.drift import PARTS
from cmm_uq.laboratory.due.history import MachineHistory

if TYPE_CHECKING:
    import pandas as pd

_DUE = ("item", "serial", "name", "model", "place", "state", "due", "last", "why", "remarks", "artefact", "blocked")


@dataclass(frozen=True, eq=False, repr=False)
class DueList:
    """What ``due`` found: machines and artefacts, by the day on which they are due."""

    found: WhatIsDue

    @property
    def frame(self) -> pd.DataFrame:
        """A row an item: which, its state, the day it is due, its last calibration, why, and what blocks it."""
        import pandas as pd

        return pd.DataFrame(self.found.data()["items"], columns=list(_DUE))

    def write(self, folder: str | Path, *, force: bool = False) -> dict[str, Path]:
        """Write ``due.html`` and ``due.json`` to a folder, as ``cmm-uq due --out`` does; ``force`` as of its ``--force``."""
        return write_due(self.found, Path(folder), force=force)

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.found.of(state))} {state}" for state in ("overdue", "due", "later", "unknown"))
        return f"<Due on {self.found.on.isoformat()}: {counts}>"

    def _repr_html_(self) -> str:
        from cmm_uq.certificate.pages.fleet import due_row

        rows = [due_row(one, self.found.on, self.found.within) for one in self.found.items]
        return html_table(repr(self)[1:-1], ("Due", "State", "", "What", "Why"), rows)


@dataclass(frozen=True, eq=False, repr=False)
class History:
    """What ``history`` found: the machine, its certificates and its values."""

    found: MachineHistory

    @property
    def values(self) -> pd.DataFrame:
        """A row a value, by its name: the last one, what it changed by, its trend, its limit, and when it crosses that."""
        import pandas as pd

        rows = {}
        for one in self.found.values:
            series, changed, line, met = one.series, one.change, one.line, one.crossing
            days = tuple(map(met.quantile, PARTS)) if met else (None, None, None)
            rows[series.name] = {
                "quantity": series.quantity, "unit": series.unit, "value": float(series.value[-1]), "u": float(series.u[-1]),
                "change": changed.value if changed else None, "u_change": changed.u if changed else None,
                "adjusted": one.adjusted, "significant": self.found.significant(one),
                "per_year": line.slope if line else None, "u_per_year": line.u_slope if line else None,
                "limit": series.limit, **dict(zip(("early", "middle", "late"), days, strict=True)),
            }  # fmt: skip
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("name")

    @property
    def recorded(self) -> pd.DataFrame:
        """A row for each value of each certificate and interim check: date, value, u, its artefact."""
        import pandas as pd

        from cmm_uq.certificate.pages.history import recorded_rows

        every = [one.series for one in self.found.values]
        return pd.DataFrame([{"name": series.name, **row} for series in every for row in recorded_rows(series)])

    def write(self, folder: str | Path, *, force: bool = False) -> dict[str, Path]:
        """Write ``history.html`` and ``history.json`` to a folder, as ``cmm-uq history --out`` does; ``force`` likewise."""
        return write_history(self.found, Path(folder), force=force)

    def __repr__(self) -> str:
        found = self.found
        return f"<History of {found.machine.serial}: {len(found.certificates)} recordings, {len(found.values)} values>"

    def _repr_html_(self) -> str:
        from cmm_uq.certificate.pages.history import HEADINGS, value_row

        return html_table(repr(self)[1:-1], HEADINGS, [value_row(self.found, one) for one in self.found.values])


def due(
    machines: Collection[str] | str = (), *, records: str | Path | None = None, on: dt.date | str | None = None,
    within: dt.timedelta | None = None, fleet: str | Path | None = None,
) -> DueList:  # fmt: skip
    """What is due for calibration when, and why.

    Parameters
    ----------
    machines : serials or names; all machines and artefacts where none is named.
    records : file, or URL of a PostgreSQL database; what CMM_UQ_RECORDS names, or reports/records.db, where nothing is said.
    on : the day asked about; today where nothing is said.
    within : only what is due that soon, or has no date; everything where nothing is said.
    fleet : ``fleet.json`` of the fleet that the drift model is to take as prior; its default one where nothing is said.

    Raises
    ------
    CmmUqError : there are no records, or a machine is not in them.
    """
    asked = (machines,) if isinstance(machines, str) else machines
    prior = None if fleet is None else Path(fleet)
    return DueList(what_is_due(records, asked, on=_day(on), within=within, fleet=prior))


def history(
    machine: str,
    *,
    records: str | Path | None = None,
    on: dt.date | str | None = None,
    fleet: str | Path | None = None,
    parts: Collection[str | Path] = (),
) -> History:
    """Every error factor and figure of performance of a machine over its certificates and interim checks.

    Parameters
    ----------
    machine : its serial, or its name.
    records, on, fleet : as for :func:`cmm_uq.due`.
    parts : folders with reports of parts, of which those in doubt are named; those beside the records by default.

    Raises
    ------
    CmmUqError : there are no records, or the machine is not in them.
    """
    prior = None if fleet is None else Path(fleet)
    return History(history_of(machine, records, on=_day(on), fleet=prior, parts=tuple(map(Path, parts))))


def _day(on: dt.date | str | None) -> dt.date | None:
    return dt.date.fromisoformat(on) if isinstance(on, str) else on
