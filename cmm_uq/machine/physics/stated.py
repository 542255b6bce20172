"""Physics that a job states itself: a formula of readings and recorded columns, proportional to its parameters.

A formula gives e in mm by the sign rule, from scale readings x, y, z in mm, the recording's columns as they stand, time since
the start in s, and parameters in mm, s, K and rad, whatever unit states them. It is parsed as a budget's model is, never run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np

from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.table import LONGEST_MM
from cmm_uq.base.messages import NOTHING, Text, Verbatim, listed, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import METRE, PRINTED, Unit, unit_as_typed
from cmm_uq.jobs.columns import COLUMNS, REQUIRED
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.plan import EffectFacts
from cmm_uq.machine.physics.catalogue import beside_the_catalogue, refuse_known
from cmm_uq.machine.physics.effect import Effect, Nonparametric, Parameter, Shape
from cmm_uq.machine.physics.effects.joints import effects_of_arm
from cmm_uq.maths.uncertainty.models.expression import CONSTANTS, FURTHER, Expression, parse

_EQUATION = re.compile(r"e_([xyz])\s*=(?!=)\s*(.+)", re.DOTALL)
_METRES = re.compile(r"\\metre(?:\\tothe\{(-?\d+)\})?")
_ALREADY = {"artefact", "noise", "accuracy"}  # names beside those of effects in results.json


class StatedEffect(Effect):
    """An effect of a job's own; ``columns`` beside ``recorded`` are refused, where that says which there are."""

    mechanism = "stated by the job"

    def __init__(self, facts: EffectFacts, where: str, recorded: Sequence[str] | None = None) -> None:
        refuse_known(facts.name, where, _ALREADY)
        self.name, self.title, self.where = facts.name, facts.words, f"{where} formula"
        self.points_to = Verbatim(facts.points_to) if facts.points_to else say("what the job's own formula describes")
        self.formula, self._factors = "; ".join(facts.parts), dict[str, float]()
        linear, shape = dict[str, Parameter](), dict[str, Shape]()
        for own, given in facts.each.items():
            if own in (*AXES, *COLUMNS, *CONSTANTS, *FURTHER, *(recorded or ())):
                taken = f"{own!r} is the name of a reading, a column, a function or a constant"
                raise CmmUqError(taken, where=f"{where} parameters", fix="Call the parameter otherwise")
            unit = _unit(given.unit, f"{where} unit" if facts.unit else f"{where} parameters.{own}")
            self._factors[own] = factor_to_mm(unit)
            what = Verbatim(own) if len(facts.each) > 1 else NOTHING
            if given.prior is not None:
                linear[own] = Parameter(with_unit(own, unit), unit, given.prior, what)
            elif given.low is not None and given.high is not None:
                shape[own] = Shape(with_unit(own, unit), unit, given.low, given.high, what=what)
        self.coefficients, self.shape = tuple(linear.values()), tuple(shape.values())
        self._linear, self._shaping = tuple(linear), tuple(shape)
        self._components = dict(self._parsed(facts.parts, recorded))
        used = {name for each in self._components.values() for name in each.names}
        if unused := [own for own in self._factors if own not in used]:
            raise CmmUqError(f"the parameter {unused[0]} does not enter", where=self.where, fix="Leave it out")
        self.columns = tuple(sorted(used - self._factors.keys() - set(AXES)))
        self.imitated_by = self._imitations()

    def _parsed(self, parts: Sequence[str], recorded: Sequence[str] | None) -> Iterator[tuple[str, Expression]]:
        columns = [name for name in {**COLUMNS, **dict.fromkeys(recorded or ())} if name not in REQUIRED]
        before = set[str]()
        for part in parts:
            equation = _EQUATION.fullmatch(part)
            if equation is None or equation[1] in before:
                what = "gives a component twice" if equation else "gives no component of e"
                fix = "Write e_x = …; e_y = …; e_z = …, each once at most"
                raise CmmUqError(f"{part[:60]!r} {what}", where=self.where, fix=fix)
            found = parse(equation[2], [*AXES, *columns, *self._factors], self.where, FURTHER)
            if missing := [name for name in sorted(found.names & {*columns}) if name not in (recorded or columns)]:
                lacks = f"{self.name} needs the column {missing[0]}, which the recording has not"
                raise CmmUqError(lacks, where=self.where, fix="Record it, or leave the effect out")
            if not proportional(found, self._linear):
                priors = ", ".join(self._linear) or "any parameter with a prior"
                fix = "Add up terms with one such parameter as a factor each; one that shapes them has low and high"
                raise CmmUqError(f"e_{equation[1]} is not proportional to {priors}", where=self.where, fix=fix)
            before.add(equation[1])
            yield equation[1], found

    def _imitations(self) -> tuple[Nonparametric, ...]:
        """Functions of one quantity that could pass for it: those that a diagnosis would fit along the same axis."""
        (axis, found), *further = self._components.items()
        names = sorted(found.names - self._factors.keys(), key=lambda name: name == axis)
        scale = len(names) == 2 and names[1] == axis and proportional(found, (axis,))
        if further or not (len(names) == 1 or scale):
            return ()
        return (Nonparametric(f"{names[0]}_mm" if names[0] in AXES else names[0], axis, scale),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        if len(shape) != len(self.shape):
            raise ValueError(f"{self.name} has {len(self.shape)} parameters that shape it")
        values: dict[str, float | Floats] = {axis: points.readings[axis] for axis in AXES}
        values |= {name: points.column(name) for name in self.columns}
        if "time_s" in values:
            values["time_s"] = values["time_s"] - points.start
        values |= {own: self._factors[own] * value for own, value in zip(self._shaping, shape, strict=True)}
        basis = np.zeros((len(points), 3, len(self.coefficients)))
        with np.errstate(all="ignore"):
            for j, one in enumerate(self._linear):
                values |= dict.fromkeys(self._linear, 0.0) | {one: self._factors[one]}
                for axis, found in self._components.items():
                    basis[:, AXES.index(axis), j] = found(values)
            size = np.abs(basis * [one.prior_sd for one in self.coefficients])
        if (bad := ~(size <= LONGEST_MM)).any():
            i, _, j = np.argwhere(bad)[0]
            place = ", ".join(f"{axis} = {points.readings[axis][i]:.7g}" for axis in AXES)
            what = f"moves points by {size[bad].max():.3g} mm" if np.isfinite(size[bad]).all() else "gives no number"
            fix = "See that nothing is divided by zero, and that units and prior are meant so"
            said = f"{self.name} with {self._linear[j]} of its prior {what} at {place} mm"
            raise CmmUqError(said, where=self.where, fix=fix)
        return basis

    @property
    def words(self) -> Text:
        each = [
            say("{name} about 0 ± {prior:g} {unit} beforehand", name=Verbatim(own), prior=one.prior_sd, unit=one.unit)
            for own, one in zip(self._linear, self.coefficients, strict=True)
        ]
        each += [
            say("{name} {low:g} to {high:g} {unit}", name=Verbatim(own), low=one.low, high=one.high, unit=one.unit)
            for own, one in zip(self._shaping, self.shape, strict=True)
        ]
        own, parameters = Verbatim(self.formula), listed(each)
        return say("{title}: {formula}, in mm; {parameters}", title=self.title, formula=own, parameters=parameters)


def _unit(text: str, where: str) -> Unit:
    with suppress(CmmUqError):
        if (found := unit_as_typed(text)) == "1" or ending(found):
            return found
    known = ", ".join(dict.fromkeys(["1", *map(str, PRINTED.values())]))
    raise CmmUqError(f"{text!r} is no unit of a parameter", where=where, fix=f"Known: {known}")


def ending(unit: Unit) -> str | None:
    """What a name ends in that has this unit: ``um_per_m``."""
    return next((each for each, known in PRINTED.items() if known.dsi == unit.dsi), None)


def with_unit(name: str, unit: Unit) -> str:
    """A parameter's name as in results.json: with its unit, of a mere number ``_ratio``."""
    of = ending(unit) or "ratio"
    return name if name == of or name.endswith(f"_{of}") else f"{name}_{of}"


def factor_to_mm(unit: Unit) -> float:
    """What one of a unit is in mm, s, K and rad; of what is per degree, per degree, as columns have it."""
    metres = sum(int(power or 1) for power in _METRES.findall(unit.dsi))
    return unit.si * METRE**metres * (np.pi / 180 if r"\degree\tothe{-1}" in unit.dsi else 1.0)


def proportional(found: Expression, names: Sequence[str]) -> bool:
    """Whether an expression is a sum of terms that each have one of these quantities as a factor, and nowhere else."""
    stack: list[int | None] = []  # degree of each item: 0 without them, 1 proportional, None otherwise; −1 the number 0
    for step in found.steps:
        if step.kind != "operation":
            stack.append(1 if step.item in names else -1 if step.item == 0 and step.kind == "number" else 0)
            continue
        of = stack[-step.operands :]
        del stack[-step.operands :]
        if None in of:
            stack.append(None)
        elif step.item in ("+", "-"):
            stack.append(of[0] if of[0] == of[1] or of[1] == -1 else of[1] if of[0] == -1 else None)
        elif step.item in ("negative", "positive"):
            stack.append(of[0])
        elif step.item == "*":
            stack.append(sum(max(one, 0) for one in of if one is not None) if of != [1, 1] else None)
        elif step.item == "/":
            stack.append(of[0] if of[1] != 1 else None)
        else:
            stack.append(None if 1 in of else 0)
    return stack == [1]


@contextmanager
def physics_of(job: Job | None, *further: str) -> Iterator[None]:
    """The catalogue with what a job, if any, states of its own; ``further`` columns, which its recording will have."""
    if job is None:
        yield
        return
    facts, points = job.facts, job.points
    to_come = {*further, *facts.plan.columns} - points.columns.keys()
    recorded = [*points.columns, *to_come] if len(points) else None
    joined = isinstance(points.machine, Arm)
    stated: dict[str, Effect] = effects_of_arm(points) if joined else {}
    for i, one in enumerate(facts.effect, 1):
        where = f"job.toml [[effect]] {i}"
        if one.name in stated:
            raise CmmUqError(f"the effect {one.name!r} is stated twice", where=f"{where} name", fix="State it once")
        effect = stated[one.name] = StatedEffect(one, where, recorded)
        if len(points) and not to_come & {*effect.columns}:
            for ends in zip(*((each.low, each.high) for each in effect.shape), strict=True) if effect.shape else ((),):
                effect.basis(points, ends)
    with beside_the_catalogue(stated, alone=joined):
        yield


P = ParamSpec("P")
R = TypeVar("R")


def with_own_physics(command: Callable[Concatenate[Job, P], R]) -> Callable[Concatenate[Job, P], R]:
    """A function of a job during which the catalogue has what the job states of its own."""

    @wraps(command)
    def called(job: Job, /, *arguments: P.args, **named: P.kwargs) -> R:
        with physics_of(job):
            return command(job, *arguments, **named)

    return called
