"""A measurement model of one's own in a TOML file: read, checked and evaluated.

The file names the outputs as expressions, the inputs with what is known of each, and their correlations. Every mistake is
an error that names file and key.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import DRAWS, INPUTS, MODEL_BYTES, TEXT, content_of, text_of
from cmm_uq.base.files.table import JobTable, key, required
from cmm_uq.base.files.toml_file import toml_of
from cmm_uq.base.messages import Text, say
from cmm_uq.maths.uncertainty.budget import REPEATS, Labels
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.evaluation import METHODS, Evaluation, Request, evaluate
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.models import input_keys
from cmm_uq.maths.uncertainty.models.expression import Expression, name_problem, parse
from cmm_uq.maths.uncertainty.models.input_keys import KINDS, NUMERIC, contradiction, derived_unit, unit_of
from cmm_uq.maths.uncertainty.models.ready import KEY, READY, ReadyBudget, read_ready_budget, ready_model
from cmm_uq.maths.uncertainty.type_a import simultaneous_readings

Figure = float | str  # A number, or a text of a number and its unit, such as ``"25 nm"``


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

    distribution: Literal[tuple(KINDS)] | None = None  # type: ignore[valid-type]
    """Distribution of JCGM 101:2008 table 1, `sampled` or `constant`; `t` where only samples are given."""
    value: Figure | None = key(None, "Estimate: mean, middle of the limits, or count.")
    u: Figure | None = key(None, "Standard uncertainty.")
    dof: float | None = key(None, "Degrees of freedom of u; finite ones say how well u itself is known.")
    expanded: Figure | None = None
    """Expanded uncertainty of a certificate, in place of `u`; needs `coverage_factor`."""
    coverage_factor: float | None = key(None, "Coverage factor of `expanded`.")
    low: Figure | None = key(None, "Lower limit.")
    high: Figure | None = key(None, "Upper limit.")
    half_width: Figure | None = key(None, "Half the distance of the limits, with `value`.")
    limit: Figure | None = key(None, "How far each limit of `rectangular_uncertain` is in doubt.")
    beta: float | None = key(None, "Ratio of top to base of a trapezoid, or doubt of the limits over the half-width.")
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
    correlation: dict[str, float] = {}
    """Correlation of two inputs, as `"x1,x2" = 0.9`."""


TOP, MODEL = tuple(ModelFileTable.model_fields), tuple(ModelTable.model_fields)
TEXTS = tuple(name for name in InputTable.model_fields if name not in NUMERIC)
_SMALLEST, _LARGEST = 1e-70, 1e70


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
        """Evaluate it, with another seed where one is given."""
        request = self.request if seed is None else replace(self.request, seed=seed)
        return evaluate(self.model, request, self.labels)

    def further(self) -> dict[str, Any]:
        """Keys of results.json beside those of every budget: none."""
        return {}


def read_model_file(path: Path) -> ModelFile | ReadyBudget:
    """Read and check a model file, or one with a ready budget.

    Raises :class:`CmmUqError` where it cannot be read, is no TOML, or a key is unknown, missing, wrong or contradicting.
    """
    content = content_of(path, MODEL_BYTES, "Name the TOML file of the measurement model")
    text = text_of(content, str(path))
    try:
        data = toml_of(text, str(path), most_word=TEXT.most, most_listed=DRAWS.most)
    except tomllib.TOMLDecodeError as error:
        raise CmmUqError(f"is not TOML: {error}", where=str(path), fix="Mend the line that it names") from error
    if KEY in data:
        return read_ready_budget(content, path)
    return _Reader(str(path)).model_file(data, path.stem, content)


@dataclass(frozen=True)
class _Reader:
    """The checks, each of which says file and key."""

    file: str

    def model_file(self, data: Mapping[str, Any], stem: str, content: bytes) -> ModelFile:
        self._known(data, TOP, "")
        model, given = self._table(data, "model", ""), self._table(data, "inputs", "")
        correlation = self._correlation(data)
        if not given:
            raise self._refused("there are no inputs", "", "Describe each in a table [inputs.<name>]")
        self._known(model, MODEL, "[model]")
        inputs = {name: self._input(name, keys) for name, keys in given.items()}
        inputs, within = self._simultaneous(inputs, given)
        for a, b in within:
            if (a, b) in correlation or (b, a) in correlation:
                problem = f"the correlation of {a} and {b} follows from their simultaneous readings"
                raise self._refused(problem, "[correlation]", "Leave the line out")
        joint = {**within, **correlation}
        expressions: dict[str, Expression] = {}
        descriptions = {name: keys["description"] for name, keys in given.items() if "description" in keys}
        if "ready" in model:
            units = {name: keys.get("unit", "") for name, keys in given.items()}
            with self._located(""):
                whole, labels = ready_model(model, inputs, units, joint)
            labels = replace(labels, origins={**labels.origins, **_origins(given)})
            descriptions = {say("Ready model"): READY[model["ready"]].title} | descriptions
        else:
            expressions.update(self._outputs(model, inputs))
            whole = MeasurementModel(
                lambda **values: {name: expression(values) for name, expression in expressions.items()},
                inputs,
                list(expressions),
                joint,
            )
            labels = self._labels(given, model, expressions)
        with self._located(""):
            _ = whole.correlation_matrix
        title = self._text(model, "title", "[model]") or stem
        return ModelFile(title, expressions, whole, self._request(model), labels, descriptions, content)

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

    def _known(self, table: Mapping[str, Any], allowed: tuple[str, ...], key: str) -> None:
        for name in table:
            if name not in allowed:
                raise self._refused(f"there is no key {name!r}", key, suggestion(name, allowed))

    def _table(self, data: Mapping[str, Any], name: str, within: str) -> Mapping[str, Any]:
        if name not in data:
            raise self._refused(f"[{name}] is missing", within, f"Add a table [{name}]")
        table = data[name]
        if not isinstance(table, dict):
            raise self._refused(f"{name} is not a table", within, f"Write it as [{name}]")
        if len(table) > INPUTS.most:
            raise self._refused(f"{name} has {len(table)} entries", within, f"{INPUTS.most} are the most")
        return table

    def _text(self, table: Mapping[str, Any], name: str, key: str) -> str:
        if not isinstance(table.get(name, ""), str):
            raise self._refused(f"{name} is not text", key, 'Put it in quotes: "…"')
        return str(table.get(name, ""))

    def _number(self, number: Any, key: str) -> float:
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not isfinite(number):
            raise self._refused(f"{number!r} is not a finite number", key, "Write it as in 0.05")
        if number and not _SMALLEST < abs(number) < _LARGEST:
            problem = f"{number:g} is too {'large' if abs(number) > 1 else 'small'} to be squared and added up"
            raise self._refused(problem, key, "State it in another unit")
        return float(number)

    def _input(self, name: str, keys: Any) -> Distribution:
        key = f"[inputs.{name}]"
        if problem := name_problem(name):
            raise self._refused(problem, key, "Choose another name")
        if not isinstance(keys, dict):
            raise self._refused(f"{name} is not a table", "[inputs]", f"Write it as {key}")
        self._known(keys, (*TEXTS, *sorted(NUMERIC)), key)
        for text in TEXTS:
            self._text(keys, text, key)
        if keys.get("unit"):
            unit_of(keys["unit"], self._where(f"{key} unit"))
        numbers = {k: self._numbers(keys, k, f"{key} {k}") for k in keys if k in NUMERIC}
        kind = keys.get("distribution") or ("t" if "samples" in numbers else None)
        with self._located(key):
            if kind is None:
                raise CmmUqError("'distribution' is missing", fix="Give one, such as 'normal' or 'rectangular'")
            return input_keys.distribution_from(kind, numbers)

    def _numbers(self, keys: Mapping[str, Any], name: str, key: str) -> Any:
        given = keys[name]
        if name == "samples":
            if not isinstance(given, list):
                raise self._refused("samples is not a list", key, "Write it as in [1.2, 1.3]")
            return np.array([self._number(sample, key) for sample in given])
        if isinstance(given, str):
            difference = name in input_keys.DIFFERENCES
            return input_keys.number_in(given, keys.get("unit", ""), difference=difference, where=self._where(key))
        return self._number(given, key)

    def _simultaneous(
        self, inputs: Mapping[str, Distribution], given: Mapping[str, Any]
    ) -> tuple[dict[str, Distribution], dict[tuple[str, str], float]]:
        """Inputs read together, marked by the same ``simultaneous``, with the correlations of their readings."""
        marked = dict(inputs)
        correlations: dict[tuple[str, str], float] = {}
        sets: dict[str, list[str]] = {}
        for name, keys in given.items():
            if keys.get("simultaneous"):
                sets.setdefault(keys["simultaneous"], []).append(name)
        for label, names in sets.items():
            key = f"[inputs.{names[0]}] simultaneous"
            for name in names:
                if "samples" not in given[name]:
                    raise self._refused(f"{name} has no samples", key, "Give its readings")
            kinds = {inputs[name].kind for name in names}
            samples = {name: given[name]["samples"] for name in names}
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

    def _outputs(self, model: Mapping[str, Any], inputs: Mapping[str, Distribution]) -> dict[str, Expression]:
        outputs = self._table(model, "outputs", "[model]")
        if not outputs:
            raise self._refused("there are no outputs", "[model]", 'outputs = { y = "…" }')
        parsed = {}
        for name in outputs:
            key = f"[model] outputs.{name}"
            if problem := name_problem(name) or (f"{name!r} is also an input" if name in inputs else None):
                raise self._refused(problem, key, "Choose another name")
            parsed[name] = parse(self._text(outputs, name, key), inputs.keys(), self._where(key))
        return parsed

    def _correlation(self, data: Mapping[str, Any]) -> dict[tuple[str, str], float]:
        pairs: dict[tuple[str, str], float] = {}
        for pair, number in self._table({"correlation": {}, **data}, "correlation", "").items():
            names = [name.strip() for name in pair.split(",")]
            if len(names) != 2:
                raise self._refused(f"{pair!r} is not a pair of inputs", "[correlation]", 'Write "x1,x2" = 0.9')
            pairs[names[0], names[1]] = self._number(number, f"[correlation] {pair}")
        return pairs

    def _request(self, model: Mapping[str, Any]) -> Request:
        request: dict[str, Any] = {}
        if "method" in model:
            request["method"] = self._text(model, "method", "[model] method")
        for name in ("coverage", "digits", "seed"):
            if name in model:
                request[name] = number = self._number(model[name], f"[model] {name}")
                if name != "coverage":
                    if number != int(number):
                        raise self._refused(f"{number} is not an integer", f"[model] {name}")
                    request[name] = int(number)
        with self._located("[model]"):
            return Request(**request)

    def _labels(
        self, given: Mapping[str, Any], model: Mapping[str, Any], expressions: Mapping[str, Expression]
    ) -> Labels:
        units = {name: keys.get("unit", "") for name, keys in given.items()}
        stated = self._table({"units": {}, **model}, "units", "[model]")
        self._known(stated, tuple(expressions), "[model] units")
        for name, expression in expressions.items():
            if unit := self._text(stated, name, "[model] units"):
                unit_of(unit, self._where(f"[model] units.{name}"))
            if wrong := contradiction(expression, units, unit):
                raise self._refused(f"{name} {wrong}", "[model] outputs", "State inputs and output in units that fit")
            if not unit and any(units[used] not in ("", "1") for used in expression.names):
                unit = derived_unit(expression, units) or ""
            units[name] = unit
        return Labels(units, _origins(given))


def _origins(given: Mapping[str, Any]) -> dict[str, str]:
    return {
        name: keys.get("source") or (REPEATS if "samples" in keys else say("not stated"))
        for name, keys in given.items()
    }
