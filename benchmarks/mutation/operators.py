"""What is changed: small faults in a module's syntax tree, each one that a tired engineer could have written.

Left alone: docstrings, annotations, decorators, imports, string constants, assertions, and what stands in a ``raise``.
"""

from __future__ import annotations

import ast
import copy
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

FACTOR = 1.005
"""By which a number is wrong that nobody would notice by eye."""

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}  # fmt: skip
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
    ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
_PAIRS = (("min", "max"), ("argmin", "argmax"), ("minimum", "maximum"), ("floor", "ceil"), ("any", "all"), ("sin", "cos"),
          ("vstack", "hstack"), ("zeros", "ones"), ("zeros_like", "ones_like"), ("mean", "median"), ("union", "intersection"),
          ("intersection_update", "update"), ("ROUND_UP", "ROUND_HALF_UP"))  # fmt: skip
EXCHANGED = {one: two for pair in _PAIRS for one, two in (pair, pair[::-1])}
_NO_METHODS = {"mean", "median", "update", "union", "intersection"}
"""What arrays and sets have no counterpart of as a method: the fault would end every test at once."""
_UNWRAPPED = {"abs", "sqrt", "sorted", "float64", "log", "exp"}
"""Functions of one argument that are left out."""
_OPTIONAL = {"axis", "ddof", "default", "key", "reverse", "initial", "keepdims", "method", "prepend", "copy", "rcond", "where",
             "rounding", "right", "side", "return_index", "xtol"}  # fmt: skip
"""Keywords that may be left out of a call since the called has a default."""


_Path = tuple[tuple[str, int | None], ...]
"""Field and place in it, from a module down to a node."""


_GUARDS = {"strict"}
"""Keywords that only guard against mistakes in the program itself."""


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Parameters
    ----------
    module : path of the file, relative to the project.
    line, last : of the changed expression, counted from 1.
    source : text of the line.
    change : the expression before and after.
    nth : of those with this text and change, from 0.
    qualname : outermost function that it stands in; ``None`` for what runs when the module is imported.
    path, after : node of the module's tree, and what takes its place.
    """

    module: str
    line: int
    last: int
    source: str
    change: str
    nth: int
    qualname: str | None
    path: _Path
    after: ast.AST

    @property
    def key(self) -> tuple[str, str, str, int]:
        """By which it is known again when lines have moved."""
        return self.module, self.source, self.change, self.nth

    def code(self, root: Path) -> CodeType:
        """The module with the fault, compiled."""
        tree = ast.parse((root / self.module).read_text(encoding="utf-8"))
        parent = _at(tree, self.path[:-1])
        field, place = self.path[-1]
        if place is None:
            setattr(parent, field, self.after)
        else:
            getattr(parent, field)[place] = self.after
        return compile(ast.fix_missing_locations(tree), str(root / self.module), "exec", dont_inherit=True)


def mutants(root: Path, module: str) -> list[Mutant]:
    """All faults of a module."""
    text = (root / module).read_text(encoding="utf-8")
    tree, lines, found = ast.parse(text), text.splitlines(), []
    seen: set[tuple[int, int, str]] = set()
    count: Counter[tuple[str, str]] = Counter()
    for path, qualname in _places(tree, (), None):
        node, parent = _at(tree, path), _at(tree, path[:-1])
        place = node.target if isinstance(node, ast.comprehension) else node
        line, last, column = (getattr(place, name) for name in ("lineno", "end_lineno", "col_offset"))
        for after in _faults(node, parent, path[-1][0]):
            change = f"{_shown(node)} -> {_shown(after)}"
            if (line, column, change) in seen:
                continue
            seen.add((line, column, change))
            source = lines[line - 1].strip()
            found.append(Mutant(module, line, node.test.end_lineno if isinstance(node, ast.If) else last, source, change,
                                count[source, change], qualname, path, after))  # fmt: skip
            count[source, change] += 1
    return found


def _shown(node: ast.AST) -> str:
    return f"if {ast.unparse(node.test)}" if isinstance(node, ast.If) else ast.unparse(node)


def _at(tree: ast.AST, path: _Path) -> ast.AST:
    for field, place in path:
        value = getattr(tree, field)
        tree = value if place is None else value[place]
    return tree


def _places(node: ast.AST, path: _Path, qualname: str | None, outer: str = "") -> Iterator[tuple[_Path, str | None]]:
    """Path of every node that may be changed, with the function in which it runs."""
    if isinstance(node, ast.Raise | ast.Import | ast.ImportFrom | ast.Assert):
        return
    if isinstance(node, ast.expr | ast.If | ast.AugAssign | ast.comprehension) and path:
        yield path, qualname
    name, inner = outer, qualname
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        name = f"{outer}{node.name}." if isinstance(node, ast.ClassDef) else f"{outer}{node.name}.<locals>."
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "bases", "ctx") or value is None:
            continue
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            inner = (qualname or name) if field == "body" else qualname
        for place, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST):
                yield from _places(child, (*path, (field, place)), inner, name)


def _faults(node: ast.AST, parent: ast.AST, field: str) -> Iterator[ast.AST]:
    by_type = {
        ast.Compare: _comparisons, ast.BinOp: _arithmetic, ast.AugAssign: _arithmetic, ast.UnaryOp: _signs,
        ast.BoolOp: _connectives, ast.Call: _calls, ast.Attribute: _names, ast.Name: _names, ast.IfExp: _branches,
        ast.If: _conditions, ast.comprehension: _filters, ast.Slice: _slices, ast.FormattedValue: _formats,
    }  # fmt: skip
    if isinstance(node, ast.Constant):
        if not (isinstance(parent, ast.keyword) and parent.arg in _GUARDS):
            yield from _constants(node, parent, field)
    elif type(node) in by_type:
        yield from by_type[type(node)](node)


def _with(node: ast.AST, **fields: object) -> ast.AST:
    changed = copy.deepcopy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed


def _comparisons(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.Compare)
    for place, operator in enumerate(node.ops):
        for other in _COMPARISONS[type(operator)]:
            yield _with(node, ops=[*node.ops[:place], other(), *node.ops[place + 1 :]])


def _arithmetic(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.BinOp | ast.AugAssign)
    text = any(isinstance(side, ast.Constant | ast.JoinedStr) and not isinstance(getattr(side, "value", ""), int | float)
               for side in (getattr(node, "left", None), getattr(node, "right", None)))  # fmt: skip
    if type(node.op) in _ARITHMETIC and not text:
        yield _with(node, op=_ARITHMETIC[type(node.op)]())


def _signs(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.UnaryOp)
    yield node.operand


def _connectives(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.BoolOp)
    yield _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())


def _calls(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.Call)
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    if name in _UNWRAPPED and len(node.args) == 1:
        yield node.args[0]
    if name in ("get", "next", "getattr") and len(node.args) > 1:
        yield _with(node, args=node.args[:-1])
    for place, keyword in enumerate(node.keywords):
        if keyword.arg in _OPTIONAL:
            yield _with(node, keywords=node.keywords[:place] + node.keywords[place + 1 :])


def _names(node: ast.AST) -> Iterator[ast.AST]:
    field = "attr" if isinstance(node, ast.Attribute) else "id"
    name = getattr(node, field)
    method = isinstance(node, ast.Attribute) and getattr(node.value, "id", "") != "np"
    if name in EXCHANGED and isinstance(node.ctx, ast.Load) and not (method and name in _NO_METHODS):  # type: ignore[attr-defined]
        yield _with(node, **{field: EXCHANGED[name]})
    if name == "T" and isinstance(node, ast.Attribute):
        yield node.value


def _branches(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.IfExp)
    yield from (node.body, node.orelse)


def _conditions(node: ast.AST) -> Iterator[ast.AST]:
    for value in (True, False):
        yield _with(node, test=ast.Constant(value))


def _filters(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.comprehension)
    if node.ifs:
        yield _with(node, ifs=[])


def _slices(node: ast.AST) -> Iterator[ast.AST]:
    assert isinstance(node, ast.Slice)
    if node.step is not None or (node.lower is None and node.upper is None):
        return
    one = ast.Constant(1)
    yield _with(node, lower=one if node.lower is None else ast.BinOp(node.lower, ast.Add(), one))
    yield _with(node, upper=ast.Constant(-1) if node.upper is None else ast.BinOp(node.upper, ast.Sub(), one))


def _formats(node: ast.AST) -> Iterator[ast.AST]:
    """One decimal or digit more than meant."""
    assert isinstance(node, ast.FormattedValue)
    spec = node.format_spec.values[0] if isinstance(node.format_spec, ast.JoinedStr) else None
    text = str(spec.value) if isinstance(spec, ast.Constant) else ""
    if text.startswith(".") and text[1:2].isdigit():
        yield _with(node, format_spec=ast.JoinedStr([ast.Constant(f".{int(text[1]) + 1}{text[2:]}")]))


def _constants(node: ast.Constant, parent: ast.AST, field: str) -> Iterator[ast.AST]:
    value = node.value
    if isinstance(value, bool):
        yield ast.Constant(not value)
    elif isinstance(value, float):
        yield from map(ast.Constant, (value * FACTOR, 0.9) if value == 0.95 else (value * FACTOR or 1.0,))
    elif isinstance(value, int):
        if isinstance(parent, ast.keyword) and parent.arg == "axis":
            yield ast.Constant(1 if value == 0 else 0)
            return
        yield ast.Constant(value + 1)
        if field == "slice" or isinstance(parent, ast.Tuple):
            yield ast.Constant(value - 1)
        elif isinstance(parent, ast.BinOp) and isinstance(parent.op, ast.Mult | ast.Div):
            yield ast.Constant(value * FACTOR or 1)
    if isinstance(value, float) and value:
        yield ast.UnaryOp(ast.USub(), ast.Constant(value))
