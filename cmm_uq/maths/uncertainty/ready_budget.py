"""A ready budget in a TOML file: ``[budget] method = "ISO 15530-3"`` and the figures that the method takes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import create_model

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.table import Table
from cmm_uq.base.files.toml_file import checked
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.maths.uncertainty.budget import Budget
from cmm_uq.maths.uncertainty.budgets.tables import TABLES, BudgetTable
from cmm_uq.maths.uncertainty.choice import Ways
from cmm_uq.maths.uncertainty.evaluation import Evaluation, Request, Stated
from cmm_uq.maths.uncertainty.expression import Expression

KEY = "budget"


class _BudgetFile(Table):
    budget: BudgetTable


@dataclass(frozen=True, eq=False)
class ReadyBudget:
    """What a file with a ready budget says.

    Parameters
    ----------
    title : of the page.
    table : the method and its figures.
    content : the file's bytes.
    expressions : none; the method is the model.
    how : it is evaluated.
    """

    title: str
    table: BudgetTable
    content: bytes
    expressions: Mapping[str, Expression] = field(default_factory=dict)

    @property
    def how(self) -> Text:
        """In words, to follow "Evaluated"."""
        return say("by the ready budget '{method}'", method=Verbatim(getattr(self.table, "method", "")))

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes."""
        return hashlib.sha256(self.content).hexdigest()

    @property
    def descriptions(self) -> Mapping[str, Text]:
        """The method, and further figures that it asks for."""
        told: dict[str, Text] = {say("Method"): self.table.meaning}
        return told | {Verbatim(name): number(value, ".6g") for name, value in self.table.remarks().items()}

    def evaluate(self, seed: int | None = None) -> Evaluation:
        """Its budgets as results; nothing in them is random, so a seed changes nothing.

        Raises
        ------
        CmmUqError : the method refuses the figures.
        """
        budgets = self.table.budgets()
        stated = {name: _stated(budget) for name, budget in budgets.items()}
        coverage = {budget.coverage for budget in budgets.values()}
        return Evaluation(Request("first", max(coverage), seed=seed or 0), stated, self.table.correlation(), Ways())

    def further(self) -> dict[str, Any]:
        """Keys of results.json beside those of every budget."""
        return {"ready": getattr(self.table, "method", ""), **self.table.remarks()}


def _stated(budget: Budget) -> Stated:
    value, U = budget.value or 0.0, budget.expanded
    reason = (
        say("U = k u with k = 2, which the standard prescribes")
        if budget.factor is not None
        else say("U = k u with k from the effective degrees of freedom")
    )
    return Stated("first", reason, value, budget.u, budget.dof, (value - U, value + U), budget.k, budget)


def read_ready_budget(content: bytes, path: Path) -> ReadyBudget:
    """Read and check a file with a ready budget.

    Raises
    ------
    CmmUqError : an unknown method, or a key that is unknown, missing or of the wrong kind; with its line.
    """
    found = checked(content, path, lambda data: _file_of(data, path))
    return ReadyBudget(found.budget.title or path.stem, found.budget, content)


def _file_of(data: dict[str, Any], path: Path) -> type[_BudgetFile]:
    table = data[KEY]
    method = str(table.get("method", "")) if isinstance(table, dict) else ""
    if method not in TABLES:
        said = f"there is no ready budget {method!r}" if method else "is missing"
        raise CmmUqError(said, where=f"{path}: [{KEY}] method", fix=suggestion(method, TABLES))
    return create_model("BudgetFile", __base__=_BudgetFile, budget=(TABLES[method], ...))
