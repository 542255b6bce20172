"""A fault put into a running process, and what watches the tests there."""

from __future__ import annotations

import gc
import importlib.abc
import importlib.util
import os
import signal
from collections import defaultdict
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec
from types import CodeType, FunctionType, ModuleType

import pytest

from benchmarks.mutation.modules import MODULES, ROOT
from benchmarks.mutation.operators import Mutant


def functions() -> dict[str, list[FunctionType]]:
    """All functions of the running process that can be exchanged, by module."""
    found = defaultdict(list)
    for function in gc.get_objects():
        if isinstance(function, FunctionType):
            found[function.__code__.co_filename].append(function)
    return {module: found[str(ROOT / module)] for module in MODULES}


def exchange(mutant: Mutant, present: Sequence[FunctionType]) -> bool:
    """Put the faulty code into the functions of the running process; whether any function took it."""
    wanted, done = dict(_codes(mutant.code(ROOT))), False
    for function in present:
        new = wanted.get(_name(function.__code__))
        if new is not None and len(new.co_freevars) == len(function.__code__.co_freevars):
            done |= str(mutant.qualname).startswith(function.__code__.co_qualname.split(".<locals>")[0])
            function.__code__ = new
    return done


def _name(code: CodeType) -> tuple[object, ...]:
    return code.co_qualname, code.co_firstlineno, code.co_varnames[: code.co_argcount]


def _codes(code: CodeType) -> Iterator[tuple[tuple[object, ...], CodeType]]:
    yield _name(code), code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


class Faulty(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module with its fault."""

    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant
        self._name = mutant.module.removesuffix(".py").replace("/", ".")

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        """See the base class."""
        return (
            importlib.util.spec_from_file_location(name, ROOT / self._mutant.module, loader=self)
            if name == self._name
            else None
        )

    def exec_module(self, module: ModuleType) -> None:
        """See the base class."""
        exec(self._mutant.code(ROOT), module.__dict__)


class Watched:
    """Names each test as it starts, and ends the process where it takes too long."""

    def __init__(self, pipe: int, limit: int) -> None:
        self._pipe, self._limit = pipe, limit

    def run(self, items: Sequence[pytest.Item]) -> int:
        """Run tests of the collecting process; no return when one fails."""
        for item, following in zip(items, [*items[1:], None], strict=True):
            if item is items[0]:
                item.config.pluginmanager.register(self)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        return 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Note which test runs, and set the clock."""
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(self._limit)
        os.write(self._pipe, f"{item.nodeid}\n".encode())

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        """End at the first failure, of which nobody asks for a report."""
        if call.excinfo is not None and not isinstance(call.excinfo.value, pytest.skip.Exception):
            os._exit(1)
