"""Arithmetic expressions as text: parsed, checked, and turned into calls of NumPy's functions; never run as code.

An expression knows numbers, names, ``+ - * / **``, brackets, the functions of :data:`FUNCTIONS` and ``pi``. It is kept as
a list of steps for a stack, so that neither its depth nor its length can overflow anything, and works on floats, arrays,
complex numbers and jets alike.
"""

from __future__ import annotations

import ast
import re
import unicodedata
import warnings
from collections.abc import Callable, Collection, Mapping
from operator import pow as power
from typing import Any, Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import NUMERAL, TEXT
from cmm_uq.base.values import dataclass

FUNCTIONS: Mapping[str, np.ufunc] = {
    **{name: getattr(np, name) for name in ("sqrt", "exp", "log", "log10", "sin", "cos", "tan")},
    **{f"a{name}": getattr(np, f"arc{name}") for name in ("sin", "cos", "tan", "tan2")},
    "abs": np.absolute,
}
# with those whose derivatives break off, for what is only ever evaluated
FURTHER = {**FUNCTIONS, "tanh": np.tanh, "sign": np.sign, "min": np.minimum, "max": np.maximum}
CONSTANTS: Mapping[str, float] = {"pi": np.pi}

_SIGNS = ("+", "-", "*", "/", "**", "negative", "positive")
_NODES = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd)
_OPERATORS: Mapping[type[ast.AST], str] = dict(zip(_NODES, _SIGNS, strict=True))
# the operator of a power, for it knows squares and square roots
_APPLIED = (np.add, np.subtract, np.multiply, np.divide, power, np.negative, np.positive)
_CALLS: Mapping[str, Callable[..., Any]] = {**dict(zip(_SIGNS, _APPLIED, strict=True)), **FURTHER}

LONGEST = TEXT.most
_LONG_NUMERAL = re.compile(rf"\w{{{NUMERAL.most + 1}}}")
_DEEPEST = 200


@dataclass(frozen=True)
class Step:
    """One step on a stack: put a number or the value of a name on it, or apply an operation to the topmost items."""

    kind: Literal["number", "name", "operation"]
    item: float | str
    operands: int = 0


@dataclass(frozen=True)
class Expression:
    text: str  # as written
    steps: tuple[Step, ...]  # in the order of a stack

    @property
    def names(self) -> set[str]:
        return {str(step.item) for step in self.steps if step.kind == "name"}

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Value at the named quantities: floats, arrays, complex numbers or jets."""
        stack: list[Any] = []
        for step in self.steps:
            if step.kind == "number":
                stack.append(np.float64(step.item))
            elif step.kind == "name":
                value = values[str(step.item)]
                stack.append(np.float64(value) if isinstance(value, (int, float)) else value)
            else:
                operands = stack[-step.operands :]
                del stack[-step.operands :]
                stack.append(_CALLS[str(step.item)](*operands))
        return stack[0]


def parse(
    text: str, known: Collection[str], where: str | None = None, functions: Mapping[str, np.ufunc] = FUNCTIONS
) -> Expression:
    """Parse an expression of known quantities, such as ``"sqrt(x1**2 + x2**2)"``."""
    if len(text) > LONGEST:
        raise CmmUqError(f"an expression of {len(text)} characters", where=where, fix=f"{LONGEST} are the most")
    if _LONG_NUMERAL.search(text):
        raise CmmUqError(f"{_short(text)!r} is no arithmetic expression: a number is too large, or a name too long",
                         where=where, fix=f"{NUMERAL.most} digits or letters are the most")  # fmt: skip
    source = text.strip()
    try:
        with warnings.catch_warnings(action="ignore"):  # about doubtful style
            tree = ast.parse(source, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        detail = _short(error.msg) if isinstance(error, SyntaxError) else "it is nested too deeply"
        problem = f"{_short(text)!r} is no arithmetic expression: {detail}"
        raise CmmUqError(problem, where=where, fix=_allowed(functions)) from error
    translation = _Translation(source, frozenset(known), where, [], functions)
    translation.translate(tree.body, 0)
    return Expression(text, tuple(translation.steps))


def name_problem(name: str) -> str | None:
    """Why a name cannot stand for a quantity, or None when it can."""
    if not name.isidentifier() or unicodedata.normalize("NFKC", name) != name:
        return f"{name!r} is no name: letters, digits and _ make one, beginning with a letter"
    if name in FUNCTIONS or name in CONSTANTS:
        return f"{name!r} is the name of a function or constant"
    return None


def _allowed(functions: Mapping[str, np.ufunc]) -> str:
    return f"Numbers, names, + - * / **, brackets, pi and {', '.join(functions)} can be used"


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:59] + "…"


@dataclass(frozen=True)
class _Translation:
    source: str
    known: frozenset[str]
    where: str | None
    steps: list[Step]
    functions: Mapping[str, np.ufunc]

    def translate(self, node: ast.AST, depth: int) -> None:
        if depth > _DEEPEST:
            raise self._refused("it is nested too deeply", f"{_DEEPEST} levels are the most")
        if isinstance(node, ast.Constant):
            self._number(node)
        elif isinstance(node, ast.Name):
            self._name(node)
        elif isinstance(node, ast.BinOp):
            self._chain(node, depth)
        elif isinstance(node, ast.UnaryOp):
            self.translate(node.operand, depth + 1)
            self._operation(node.op, 1)
        elif isinstance(node, ast.Call):
            self._function(node, depth)
        else:
            raise self._refused(f"{self._text(node)!r} is not arithmetic", _allowed(self.functions))

    def _number(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            raise self._refused(f"{node.value!r} is no real number", _allowed(self.functions))
        try:
            self.steps.append(Step("number", float(node.value)))
        except OverflowError as error:
            raise self._refused("a number is too large", None) from error

    def _name(self, node: ast.Name) -> None:
        if node.id in CONSTANTS and node.id not in self.known:
            self.steps.append(Step("number", CONSTANTS[node.id]))
        elif node.id in self.known:
            self.steps.append(Step("name", node.id))
        elif node.id in self.functions:
            raise self._refused(f"{node.id} is a function and needs brackets", f"Write {node.id}(…)")
        else:
            raise self._refused(f"there is no input {node.id!r}", suggestion(node.id, {*self.known, *CONSTANTS}))

    def _chain(self, node: ast.BinOp, depth: int) -> None:
        """A long sum or product is one chain, not one level a term."""
        links: list[tuple[ast.operator, ast.expr]] = []
        first: ast.expr = node
        while isinstance(first, ast.BinOp):
            links.append((first.op, first.right))
            first = first.left
        self.translate(first, depth + 1)
        for operator, right in reversed(links):
            self.translate(right, depth + 1)
            self._operation(operator, 2)

    def _operation(self, operator: ast.AST, operands: int) -> None:
        if type(operator) not in _OPERATORS:
            fix = "A power is written **" if isinstance(operator, ast.BitXor) else _allowed(self.functions)
            raise self._refused(f"the operator {type(operator).__name__} is not arithmetic here", fix)
        self.steps.append(Step("operation", _OPERATORS[type(operator)], operands))

    def _function(self, node: ast.Call, depth: int) -> None:
        name = node.func.id if isinstance(node.func, ast.Name) else self._text(node.func)
        if name not in self.functions:
            raise self._refused(f"there is no function {name!r}", suggestion(name, self.functions))
        wanted = self.functions[name].nin
        if node.keywords or len(node.args) != wanted or any(isinstance(a, ast.Starred) for a in node.args):
            raise self._refused(f"{name} takes {wanted} argument{'s' if wanted > 1 else ''}", None)
        for argument in node.args:
            self.translate(argument, depth + 1)
        self.steps.append(Step("operation", name, wanted))

    def _text(self, node: ast.AST) -> str:
        return _short(ast.get_source_segment(self.source, node) or "this")

    def _refused(self, problem: str, fix: str | None) -> CmmUqError:
        return CmmUqError(problem, where=self.where, fix=fix)
