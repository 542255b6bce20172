"""Ready measurement models and budgets, called by name in a TOML file.

``[model] ready = "length_at_20"`` stands in place of outputs: the inputs of the file are those of the model, by their names;
what is said of each, and of their correlations, stays the file's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from inspect import Parameter, signature
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import create_model

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.table import JobTable
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.values import MISSING, dataclass, field, fields
from cmm_uq.maths.uncertainty.air.state import Air, Interferometer, interferometer_model
from cmm_uq.maths.uncertainty.budget import Budget, Labels
from cmm_uq.maths.uncertainty.budgets.measurements import UNITS, length_at_20, scale_error, triangle_angles
from cmm_uq.maths.uncertainty.budgets.tables import TABLES, BudgetTable
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.evaluation import Evaluation, OutputResult, Request, Ways
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.models.expression import Expression
from cmm_uq.maths.uncertainty.type_a import Correlations

Built = tuple[MeasurementModel, Labels]


@dataclass(frozen=True)
class ReadyModel:
    title: Text  # what it gives, in words
    inputs: Mapping[str, bool]  # names, and whether each is needed
    # of the inputs and the correlations: the model, and units and origins of its quantities
    build: Callable[[Mapping[str, Distribution], Correlations], Built]


def _of_function(title: Text, function: Callable[..., MeasurementModel], units: Mapping[str, str]) -> ReadyModel:
    parameters = {name: each.default is Parameter.empty for name, each in signature(function).parameters.items()}
    del parameters["correlation"]
    return ReadyModel(
        title, parameters, lambda given, correlation: (function(**given, correlation=dict(correlation)), Labels(units))
    )


def _interferometer(given: Mapping[str, Distribution], correlation: Correlations) -> Built:
    of_air = {field.name for field in fields(Air)} & given.keys()
    air = Air(**{name: given[name] for name in of_air})  # type: ignore[arg-type]
    setup = Interferometer(air=air, **{name: given[name] for name in given.keys() - of_air})  # type: ignore[arg-type]
    model = interferometer_model(setup)
    return MeasurementModel(model.function, model.inputs, model.outputs, dict(correlation)), setup.labels


_FIELDS = (
    *fields(Interferometer)[:1],
    *fields(Air)[:-1],
    *fields(Interferometer)[2:-1],
)  # those that are distributions
_INTERFEROMETER = {each.name: each.default is MISSING for each in _FIELDS}
_ANGLES = {"a_mm": "mm", "b_mm": "mm", "c_mm": "mm", "alpha": "rad", "beta": "rad", "gamma": "rad"}

READY: Mapping[str, ReadyModel] = MappingProxyType(
    {
        "length_at_20": _of_function(say("Length at 20 °C"), length_at_20, UNITS),
        "scale_error": _of_function(say("Relative error of a scale"), scale_error, UNITS),
        "triangle_angles": _of_function(say("Angles of a triangle from its sides"), triangle_angles, _ANGLES),
        "interferometer": ReadyModel(say("Length by laser interferometer"), _INTERFEROMETER, _interferometer),
    }
)


def ready_model(
    ready: ReadyModel, inputs: Mapping[str, Distribution], units: Mapping[str, str], correlation: Correlations
) -> Built:
    for key in inputs:
        if key not in ready.inputs:
            raise CmmUqError(f"{key!r} is no input of this model", fix=suggestion(key, ready.inputs))
    for key, needed in ready.inputs.items():
        if needed and key not in inputs:
            raise CmmUqError(f"the input {key!r} is missing", fix=f"Describe it in a table [inputs.{key}]")
    whole, labels = ready.build(inputs, correlation)
    for key, unit in units.items():
        if unit and unit != (own := labels.units[key]):
            fix = f"Give it in {own}, or leave the unit out"
            raise CmmUqError(f"{key} is taken in {own}", where=f"[inputs.{key}] unit", fix=fix)
    return whole, labels


class BudgetFile(JobTable):
    budget: BudgetTable

    @classmethod
    def named(cls, data: Mapping[str, Any], path: Path) -> type[BudgetFile] | None:
        """The file whose budget is of the method that it names; ``None`` of a file without a budget."""
        if "budget" not in data:
            return None
        table = data["budget"]
        method = str(table.get("method", "")) if isinstance(table, dict) else ""
        if method not in TABLES:
            problem = f"there is no ready budget {method!r}" if method else "is missing"
            raise CmmUqError(problem, where=f"{path}: [budget] method", fix=suggestion(method, TABLES))
        return create_model("BudgetFile", __base__=cls, budget=(TABLES[method], ...))


@dataclass(frozen=True, eq=False)
class ReadyBudget:
    title: str  # of the page
    table: BudgetTable  # the method and its figures
    content: bytes  # the file's bytes
    expressions: Mapping[str, Expression] = field(default_factory=dict)  # none; the method is the model

    @property
    def how(self) -> Text:
        """In words, to follow "Evaluated"."""
        return say("by the ready budget '{method}'", method=Verbatim(getattr(self.table, "method", "")))

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.content).hexdigest()

    @property
    def descriptions(self) -> Mapping[str, Text]:
        remarks: dict[str, Text] = {
            Verbatim(name): number(value, ".6g") for name, value in self.table.remarks().items()
        }
        return {say("Method"): self.table.meaning, **remarks}

    def evaluate(self, seed: int | None = None) -> Evaluation:
        """Its budgets as results; nothing in them is random, so a seed changes nothing."""
        budgets = self.table.budgets()
        stated = {name: _stated(budget) for name, budget in budgets.items()}
        coverage = {budget.coverage for budget in budgets.values()}
        return Evaluation(Request("first", max(coverage), seed=seed or 0), stated, self.table.correlation(), Ways())

    def further(self) -> dict[str, Any]:
        return {"ready": getattr(self.table, "method", ""), **self.table.remarks()}


def _stated(budget: Budget) -> OutputResult:
    value, U, reason = budget.value or 0.0, budget.expanded, say("U = k u with k from the effective degrees of freedom")
    if budget.factor is not None:
        reason = say("U = k u with k = 2, which the standard prescribes")
    return OutputResult("first", reason, value, budget.u, budget.dof, (value - U, value + U), budget.k, budget)
