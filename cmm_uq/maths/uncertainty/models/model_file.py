"""A measurement model of one's own in a TOML file: read, checked and evaluated.

The file names the outputs as expressions, the inputs with what is known of each, and their correlations. Every mistake is
an error that names file and key.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, WrapValidator

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import DRAWS, INPUTS, MODEL_BYTES, TEXT, content_of
from cmm_uq.base.files.table import JobTable, key, required
from cmm_uq.base.files.toml_file import checked
from cmm_uq.base.messages import Text, say
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.uncertainty.budget import REPEATS, Labels
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.evaluation import METHODS, Evaluation, Request, evaluate
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.models import input_keys
from cmm_uq.maths.uncertainty.models.expression import Expression, name_problem, parse
from cmm_uq.maths.uncertainty.models.ready import READY, BudgetFile, ReadyBudget, ready_model
from cmm_uq.maths.uncertainty.type_a import simultaneous_readings

_SMALLEST, _LARGEST = 1e-70, 1e70


def _moderate(number: float) -> float:
    if number and not _SMALLEST < abs(number) < _LARGEST:
        size = "large" if abs(number) > 1 else "small"
        raise ValueError(f"is too {size} to be squared and added up: state it in another unit")
    return number


def _figure(value: Any, _: Callable[[Any], Any]) -> float | str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise ValueError("is not a finite number, nor one with its unit")
    return _moderate(float(value))


Plain = Annotated[float, AfterValidator(_moderate)]
Figure = Annotated[float | str, WrapValidator(_figure)]  # a number, or text of one and its unit, such as ``"25 nm"``


class ModelTable(JobTable):
    """``[model]``."""

    outputs: dict[str, str] = {}
    """Each output's expression in the names of the inputs: `+ - * / **`, brackets, `pi`, `sqrt exp log log10 sin cos tan
    asin acos atan atan2 abs`."""
    ready: Literal[tuple(READY)] | None = None  # type: ignore[valid-type]
    """Name of a ready model, in place of `outputs`."""
    coverage: Annotated[float, Field(gt=0, lt=1)] = key(0.95, "Probability of the intervals.")
    method: Literal[tuple(METHODS)] = "auto"  # type: ignore[valid-type]
    """How it is evaluated; `auto` takes the simplest way that Monte Carlo confirms."""
    digits: Annotated[int, Field(ge=1, le=4)] = key(2, "Significant digits of u that Monte Carlo must support.")
    seed: Annotated[int, Field(ge=0)] = key(0, "Seed of the random numbers.")
    title: str = key("", "Title of the page; the file's name where it is left out.")
    units: dict[str, str] = key({}, "Unit of each output; derived where the expression determines it.")


class InputTable(JobTable):
    """``[inputs.NAME]``: which of the figures belong together says the distribution."""

    distribution: Literal[tuple(input_keys.KINDS)] | None = None  # type: ignore[valid-type]
    """Distribution of JCGM 101:2008 table 1, `sampled` or `constant`; `t` where only samples are given."""
    value: Figure | None = key(None, "Estimate: mean, middle of the limits, or count.")
    u: Figure | None = key(None, "Standard uncertainty.")
    dof: Plain | None = key(None, "Degrees of freedom of u; finite ones say how well u itself is known.")
    expanded: Figure | None = None
    """Expanded uncertainty of a certificate, in place of `u`; needs `coverage_factor`."""
    coverage_factor: Plain | None = key(None, "Coverage factor of `expanded`.")
    low: Figure | None = key(None, "Lower limit.")
    high: Figure | None = key(None, "Upper limit.")
    half_width: Figure | None = key(None, "Half the distance of the limits, with `value`.")
    limit: Figure | None = key(None, "How far each limit of `rectangular_uncertain` is in doubt.")
    beta: Plain | None = key(None, "Ratio of top to base of a trapezoid, or doubt of the limits over the half-width.")
    samples: list[Figure] | None = key(None, "Repeated readings, or draws of an earlier analysis (`sampled`).")
    unit: str = key("", "Unit in which the model takes the input.")
    source: str = key("", "Where the figures come from, for the budget.")
    description: str = key("", "What the input is, for the page.")
    simultaneous: str = ""
    """The same word for inputs that were read together: their correlation comes from the samples."""


class ModelFileTable(JobTable):
    """A measurement model of one's own."""

    model: ModelTable = required("What is evaluated, and how.")
    inputs: dict[str, InputTable] = required("What is known of each input, by its name.")
    correlation: dict[str, Plain] = {}
    """Correlation of two inputs, as `"x1,x2" = 0.9`."""


@dataclass(frozen=True, eq=False)
class ModelFile:
    title: str  # of the page; the file's name when the file has none
    expressions: Mapping[str, Expression]  # the outputs as written
    model: MeasurementModel  # inputs, outputs and correlations
    request: Request  # method, coverage, digits and seed asked for
    labels: Labels  # units and origins
    descriptions: Mapping[str, str]  # of the inputs, where given
    content: bytes  # the file's bytes

    @property
    def how(self) -> Text:
        """In words, to follow "Evaluated"."""
        return say("by the law of propagation of uncertainty and by Monte Carlo")

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.content).hexdigest()

    def evaluate(self, seed: int | None = None) -> Evaluation:
        request = self.request if seed is None else replace(self.request, seed=seed)
        return evaluate(self.model, request, self.labels)

    def further(self) -> dict[str, Any]:
        return {}


def read_model_file(path: Path) -> ModelFile | ReadyBudget:
    """Read and check a model file, or one with a ready budget.

    Raises :class:`CmmUqError` where it cannot be read, is no TOML, or a key is unknown, missing, wrong or contradicting.
    """
    content = content_of(path, MODEL_BYTES, "Name the TOML file of the measurement model")

    def kind(data: dict[str, Any]) -> type[ModelFileTable | BudgetFile]:
        return BudgetFile.named(data, path) or ModelFileTable

    table = checked(content, path, kind, most_word=TEXT.most, most_listed=DRAWS.most)
    if isinstance(table, BudgetFile):
        return ReadyBudget(table.budget.title or path.stem, table.budget, content)
    return _Reader(str(path), table).model_file(path.stem, content)


@dataclass(frozen=True)
class _Reader:
    file: str
    table: ModelFileTable

    def model_file(self, stem: str, content: bytes) -> ModelFile:
        model, given = self.table.model, self.table.inputs
        if not given:
            raise self._refused("there are no inputs", "", "Describe each in a table [inputs.<name>]")
        for name, entries in (("inputs", given), ("outputs", model.outputs), ("correlation", self.table.correlation)):
            if len(entries) > INPUTS.most:
                raise self._refused(f"{name} has {len(entries)} entries", "", f"{INPUTS.most} are the most")
        numbers = {name: self._numbers(name, keys) for name, keys in given.items()}
        inputs = {name: self._input(name, keys, numbers[name]) for name, keys in given.items()}
        inputs, within = self._simultaneous(inputs, numbers)
        joint = dict(within)
        for pair, coefficient in self.table.correlation.items():
            if pair.count(",") != 1:
                raise self._refused(f"{pair!r} is not a pair of inputs", "[correlation]", 'Write "x1,x2" = 0.9')
            a, b = (name.strip() for name in pair.split(","))
            if {(a, b), (b, a)} & within.keys():
                problem = f"the correlation of {pair} follows from their simultaneous readings"
                raise self._refused(problem, "[correlation]", "Leave the line out")
            joint[a, b] = coefficient
        expressions: dict[str, Expression] = {}
        descriptions: dict[str, str] = {name: keys.description for name, keys in given.items() if keys.description}
        units, origins = {name: keys.unit for name, keys in given.items()}, self._origins()
        if model.ready is not None:
            for key in ("outputs", "units"):
                if getattr(model, key):
                    problem = f"{key} is given, and the ready model has its own"
                    raise self._refused(problem, "[model] ready", "Leave one of them out")
            with self._located(""):
                whole, labels = ready_model(READY[model.ready], inputs, units, joint)
            labels = replace(labels, origins={**labels.origins, **origins})
            descriptions = {say("Ready model"): READY[model.ready].title} | descriptions
        else:
            expressions.update(self._outputs(model.outputs, inputs))
            whole = MeasurementModel(
                lambda **values: {name: expression(values) for name, expression in expressions.items()},
                inputs,
                list(expressions),
                joint,
            )
            labels = Labels(units | self._units(expressions, units), origins)
        with self._located(""):
            _ = whole.correlation_matrix
        request = Request(model.method, model.coverage, model.digits, model.seed)
        return ModelFile(model.title or stem, expressions, whole, request, labels, descriptions, content)

    def _where(self, key: str) -> str:
        return f"{self.file} {key}".strip()

    def _refused(self, problem: str, key: str, fix: str | None = None) -> CmmUqError:
        return CmmUqError(problem, where=self._where(key), fix=fix)

    @contextmanager
    def _located(self, key: str) -> Iterator[None]:
        """Adds the place to an error that does not know it."""
        try:
            yield
        except CmmUqError as error:
            raise self._refused(error.problem, f"{key} {error.where or ''}".strip(), error.fix) from error

    def _numbers(self, name: str, keys: InputTable) -> dict[str, Any]:
        """Keys of an input that are stated, as numbers in its unit; readings as an array."""
        key = f"[inputs.{name}]"
        if problem := name_problem(name):
            raise self._refused(problem, key, "Choose another name")
        if keys.unit:
            input_keys.unit_of(keys.unit, self._where(f"{key} unit"))

        def number(of: str, figure: float | str) -> float:
            if not isinstance(figure, str):
                return figure
            return input_keys.number_in(
                figure, keys.unit, difference=of in input_keys.DIFFERENCES, where=self._where(f"{key} {of}")
            )

        stated = {of: getattr(keys, of) for of in InputTable.model_fields if of in input_keys.NUMERIC}
        return {
            of: np.array([number(of, one) for one in figure]) if isinstance(figure, list) else number(of, figure)
            for of, figure in stated.items()
            if figure is not None
        }

    def _input(self, name: str, keys: InputTable, numbers: Mapping[str, Any]) -> Distribution:
        kind = keys.distribution or ("t" if "samples" in numbers else None)
        with self._located(f"[inputs.{name}]"):
            if kind is None:
                raise CmmUqError("'distribution' is missing", fix="Give one, such as 'normal' or 'rectangular'")
            return input_keys.distribution_from(kind, numbers)

    def _simultaneous(
        self, inputs: Mapping[str, Distribution], numbers: Mapping[str, Mapping[str, Any]]
    ) -> tuple[dict[str, Distribution], dict[tuple[str, str], float]]:
        """Inputs read together, marked by the same ``simultaneous``, with the correlations of their readings."""
        marked, correlations = dict(inputs), dict[tuple[str, str], float]()
        sets: dict[str, list[str]] = {}
        for name, keys in self.table.inputs.items():
            if keys.simultaneous:
                sets.setdefault(keys.simultaneous, []).append(name)
        for label, names in sets.items():
            key = f"[inputs.{names[0]}] simultaneous"
            for name in names:
                if "samples" not in numbers[name]:
                    raise self._refused(f"{name} has no samples", key, "Give its readings")
            kinds = {inputs[name].kind for name in names}
            samples = {name: numbers[name]["samples"] for name in names}
            if kinds == {"sampled"}:
                if len({len(draws) for draws in samples.values()}) != 1:
                    raise self._refused("the numbers of draws differ", key, "Give whole rows")
                marked.update({name: replace(inputs[name], together=label) for name in names})
            elif kinds <= {"normal", "t"}:
                with self._located(key):
                    correlations.update(simultaneous_readings(samples).correlation)
            else:
                raise self._refused("readings and draws are mixed", key, "Use one distribution")
        return marked, correlations

    def _outputs(self, outputs: Mapping[str, str], inputs: Mapping[str, Distribution]) -> dict[str, Expression]:
        if not outputs:
            raise self._refused("there are no outputs", "[model]", 'outputs = { y = "…" }')
        parsed = {}
        for name, text in outputs.items():
            key = f"[model] outputs.{name}"
            if problem := name_problem(name) or (f"{name!r} is also an input" if name in inputs else None):
                raise self._refused(problem, key, "Choose another name")
            parsed[name] = parse(text, inputs.keys(), self._where(key))
        return parsed

    def _units(self, expressions: Mapping[str, Expression], units: Mapping[str, str]) -> dict[str, str]:
        """Unit of each output: as stated, or derived where the expression determines it."""
        found, stated = {}, self.table.model.units
        if others := stated.keys() - expressions.keys():
            raise self._refused(f"there is no output {min(others)!r}", "[model] units", "Give units of outputs alone")
        for name, expression in expressions.items():
            if unit := stated.get(name, ""):
                input_keys.unit_of(unit, self._where(f"[model] units.{name}"))
            if wrong := input_keys.contradiction(expression, units, unit):
                raise self._refused(f"{name} {wrong}", "[model] outputs", "State inputs and output in units that fit")
            if not unit and any(units[used] not in ("", "1") for used in expression.names):
                unit = input_keys.derived_unit(expression, units) or ""
            found[name] = unit
        return found

    def _origins(self) -> dict[str, str]:
        return {
            name: keys.source or (REPEATS if keys.samples is not None else say("not stated"))
            for name, keys in self.table.inputs.items()
        }
