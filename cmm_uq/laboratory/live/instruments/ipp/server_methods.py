"""What a simulated CMM does with each method of I++ DME, by specification 1.4.3; for trying clients, it moves nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from cmm_uq.laboratory.live.instruments.ipp.line import Argument, Term, number_text

TEXTS = {
    1: (2, "Illegal tag"), 6: (2, "Transaction aborted (Use ClearAllErrors To Continue)"), 7: (3, "Illegal character"),
    8: (3, "Protocol error"), 500: (3, "Emergency stop"), 501: (3, "Unsupported command"), 502: (3, "Incorrect arguments"),
    509: (3, "Bad argument"), 510: (3, "Bad property"), 511: (3, "Error processing method"), 512: (1, "No daemons are active"),
    513: (2, "Daemon does not exist"), 514: (2, "Use ClearAllErrors to continue"), 515: (2, "Daemon already exists"),
    1006: (2, "Surface not found"), 1502: (3, "Tool not found"), 1503: (3, "Tool not defined"),
    2500: (3, "Machine limit encountered [Move Out Of Limits]"),
}  # fmt: skip
"""Severity and text of errors by their numbers (section 8.2)."""

LIMIT_MM = 1000.0
"""Of each axis, both ways."""


@dataclass
class State:
    """Of the machine; kept from session to session (section 6.3.1.2)."""

    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    tool: str = "RefTool"
    found: str = "UnDefTool"
    homed: bool = False
    user: bool = False
    session: bool = False
    error: bool = False
    report: tuple[str, ...] = ("X", "Y", "Z")
    daemons: dict[str, tuple[str, ...]] = field(default_factory=dict)


class MethodError(Exception):
    """An error of a number, which the method answers with."""


class Methods:
    """A CMM: each method is a generator of its data, named ``_do_`` and its name in small letters.

    Parameters
    ----------
    part_c : temperature of the part, °C; ``None``: no such property.
    version : that it says; ``None``: it does not know the question.
    """

    tools = ("RefTool", "NoTool", "Probe1", "Probe2")

    def __init__(self, *, part_c: float | None, version: str | None) -> None:
        self.state, self.part_c, self.version = State(), part_c, version
        self.radial = 0.0
        """How far the surface lies from where it is expected, along the normal, mm."""

    def said(self, line: str) -> None:
        """Say something beside the data of a method: a report of a daemon."""

    def _do_startsession(self, tag: str, method: Term) -> Iterator[str]:
        if self.state.session:
            raise MethodError(8)
        self.state.session, self.state.error, self.state.report = True, False, ("X", "Y", "Z")
        yield from ()

    def _do_endsession(self, tag: str, method: Term) -> Iterator[str]:
        self.state.session = False
        self.state.daemons.clear()
        yield from ()

    def _do_getdmeversion(self, tag: str, method: Term) -> Iterator[str]:
        if self.version is None:
            raise MethodError(501)
        yield f'DMEVersion("{self.version}")'

    def _do_getmachineclass(self, tag: str, method: Term) -> Iterator[str]:
        yield "GetMachineClass(CartCMM)"

    def _do_clearallerrors(self, tag: str, method: Term) -> Iterator[str]:
        self.state.error = False
        yield from ()

    def _do_aborte(self, tag: str, method: Term) -> Iterator[str]:
        self.state.error = True
        yield from ()

    def _do_geterrstatuse(self, tag: str, method: Term) -> Iterator[str]:
        yield f"ErrStatus({int(self.state.error)})"

    def _do_getxtderrstatus(self, tag: str, method: Term) -> Iterator[str]:
        yield f"IsHomed({int(self.state.homed)})"
        yield f"IsUserEnabled({int(self.state.user)})"

    def _do_home(self, tag: str, method: Term) -> Iterator[str]:
        self.state.homed, self.state.position, self.state.user = True, [0.0, 0.0, 0.0], False
        yield from ()

    def _do_ishomed(self, tag: str, method: Term) -> Iterator[str]:
        yield f"IsHomed({int(self.state.homed)})"

    def _do_enableuser(self, tag: str, method: Term) -> Iterator[str]:
        self.state.user = True
        yield from ()

    def _do_disableuser(self, tag: str, method: Term) -> Iterator[str]:
        self.state.user = False
        yield from ()

    def _do_isuserenabled(self, tag: str, method: Term) -> Iterator[str]:
        yield f"IsUserEnabled({int(self.state.user)})"

    def _do_get(self, tag: str, method: Term) -> Iterator[str]:
        yield self.reported(_names(method.arguments, ("X", "Y", "Z", "Tool.A", "Tool.B", "Tool.C")))

    def _do_onptmeasreport(self, tag: str, method: Term) -> Iterator[str]:
        self.state.report = _names(method.arguments, ("X", "Y", "Z", "IJK", "ER", "Q", "Tool.A", "Tool.B", "Tool.C"))
        yield from ()

    def _do_onmovereporte(self, tag: str, method: Term) -> Iterator[str]:
        if self.state.daemons:
            raise MethodError(515)
        rest = [one for one in method.arguments if not (isinstance(one, Term) and one.name in ("Time", "Dis"))]
        self.state.daemons[tag] = _names(tuple(rest), ("X", "Y", "Z"))
        yield from ()

    def _do_stopdaemon(self, tag: str, method: Term) -> Iterator[str]:
        if len(method.arguments) != 1 or str(method.arguments[0]) not in self.state.daemons:
            raise MethodError(513)
        del self.state.daemons[str(method.arguments[0])]
        yield from ()

    def _do_stopalldaemons(self, tag: str, method: Term) -> Iterator[str]:
        if not self.state.daemons:
            raise MethodError(512)
        self.state.daemons.clear()
        yield from ()

    def _do_goto(self, tag: str, method: Term) -> Iterator[str]:
        place, _ = _target(method, self.state.position)
        self._move(place)
        yield from ()

    def _do_ptmeas(self, tag: str, method: Term) -> Iterator[str]:
        place, normal = _target(method, self.state.position)
        size = math.hypot(*normal) or 1.0
        unit = (normal[0] / size, normal[1] / size, normal[2] / size)
        self._move([at + self.radial * n for at, n in zip(place, unit, strict=True)])
        yield self.reported(self.state.report, unit)

    def _do_enumtools(self, tag: str, method: Term) -> Iterator[str]:
        yield from (f'"{name}"' for name in self.tools)

    def _do_findtool(self, tag: str, method: Term) -> Iterator[str]:
        self.state.found = self._tool(method)
        yield from ()

    def _do_changetool(self, tag: str, method: Term) -> Iterator[str]:
        self.state.tool, self.state.user = self._tool(method), False
        yield from ()

    def _do_settool(self, tag: str, method: Term) -> Iterator[str]:
        self.state.tool = self._tool(method)
        yield from ()

    def _do_getprop(self, tag: str, method: Term) -> Iterator[str]:
        told = []
        for one in method.arguments:
            name = one.name if isinstance(one, Term) else ""
            if name == "Tool.Name":
                told.append(f'Tool.Name("{self.state.tool}")')
            elif name == "FoundTool.Name":
                told.append(f'FoundTool.Name("{self.state.found}")')
            elif name == "Part.Temperature" and self.part_c is not None:
                told.append(f"Part.Temperature({number_text(self.part_c)})")
            else:
                raise MethodError(510)
        yield ", ".join(told)

    def _tool(self, method: Term) -> str:
        if len(method.arguments) != 1 or method.arguments[0] not in self.tools:
            raise MethodError(1502)
        return str(method.arguments[0])

    def _move(self, place: list[float]) -> None:
        if any(abs(value) > LIMIT_MM for value in place):
            raise MethodError(2500)
        self.state.position, self.state.user = place, False
        for tag, names in self.state.daemons.items():
            self.said(f"{tag} # {self.reported(names)}")

    def reported(self, names: tuple[str, ...], normal: tuple[float, float, float] = (0, 0, 1)) -> str:
        """What a report says of the names, with the direction of a measured point."""
        places = {axis: f"{value:.4f}" for axis, value in zip("XYZ", self.state.position, strict=True)}
        further = {"IJK": ", ".join(map(number_text, normal)), "ER": "1.0", "Q": "0"}
        return ", ".join(f"{name}({places.get(name) or further.get(name) or '0'})" for name in names)


def _names(arguments: tuple[Argument, ...], known: tuple[str, ...]) -> tuple[str, ...]:
    names = tuple(one.name for one in arguments if isinstance(one, Term) and not one.arguments)
    if not names or len(names) != len(arguments) or not set(names) <= set(known):
        raise MethodError(510)
    return names


def _target(method: Term, position: list[float]) -> tuple[list[float], tuple[float, float, float]]:
    """Where a command goes, axes that it does not name staying, and the direction that it names."""
    place, normal = list(position), (0.0, 0.0, 1.0)
    for one in method.arguments:
        if not isinstance(one, Term) or not all(isinstance(value, float) for value in one.arguments):
            raise MethodError(509)
        numbers = [value for value in one.arguments if isinstance(value, float)]
        if one.name in ("X", "Y", "Z") and len(numbers) == 1:
            place["XYZ".index(one.name)] = numbers[0]
        elif one.name == "IJK" and len(numbers) == 3:
            normal = (numbers[0], numbers[1], numbers[2])
        else:
            raise MethodError(509)
    return place, normal
