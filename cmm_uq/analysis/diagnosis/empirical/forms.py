"""Functions in closed form that errors have: what a function that no catalogue names is compared with, form by form.

A form is linear in its size. What shapes it besides lies on a grid, where most of what lies between two nodes shows at either;
about the most probable nodes it is divided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats

SMOOTH = "smooth"  # of no form in particular
PRODUCT, BOWL = "product", "bowl"  # forms of two readings
_STEPS, _HINGES, _PLACES, _SATURATES, _PHASES = 40, 19, 24, 15, 12
_WIDTHS, _SOFT, _REACHES, _DEAD = (0.03, 0.06, 0.12), (0.04, 0.08, 0.16), (0.05, 0.1, 0.2, 0.4), 6
# Frequencies, in periods over the range: less than one is a curve, and a sawtooth of less than two a step
_WHOLE, _SEVERAL, _BETWEEN, _SINES, _TEETH = 1.0, 2.0, 0.35, 25.0, 12.0
Function = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False)
class ClosedForm:
    name: str
    parameters: tuple[str, ...]  # what shapes them, in the covariate's unit
    shapes: Floats  # (K, s)
    apart: Floats  # (K, s) how far the nodes of the grid are from each other
    function: Function  # of a covariate (n, 1) and shapes (K, s), (n, K) or (n, K, r)
    formula: str  # of each for one unit of its columns: c the covariate, parameters by name; columns parted by ``;``

    def values(self, covariate: Floats, shapes: Floats) -> Floats:
        """Functions (n, K, r) of a covariate (n,)."""
        found = self.function(covariate[:, None], shapes)
        return found[:, :, None] if found.ndim == 2 else found


def forms_of(covariate: Floats, *, time: bool = False) -> Iterator[ClosedForm]:
    """Every form of a covariate (n,): of a time one that settles or grows is called exponential, of a reading saturating."""
    low, span, distinct = float(covariate.min()), float(np.ptp(covariate)), np.unique(covariate)
    high, middle, half, gaps = low + span, low + 0.5 * span, 0.5 * span, np.diff(distinct)
    between = distinct[:-1] + 0.5 * gaps
    if len(between) > _STEPS:
        parts = np.array_split(np.arange(len(gaps)), _STEPS)
        widest = np.array([part[np.argmax(gaps[part])] for part in parts])
        between, gaps = between[widest], np.maximum(gaps[widest], np.gradient(between[widest]))
    yield ClosedForm(
        "step",
        ("at",),
        between[:, None],
        gaps[:, None],
        lambda c, s: 0.5 * (1 + np.sign(c - s[:, 0])),
        "(1 + sign(c - at))/2",
    )
    at = low + span * np.arange(1, _HINGES + 1) / (_HINGES + 1)
    yield _even("ramp", ("start",), at, lambda c, s: np.maximum(c - s[:, 0], 0) / span, f"max(c - start, 0)/{span!r}")
    at = low + span * (np.arange(_PLACES) + 0.5) / _PLACES
    yield _even(
        "dent",
        ("at", "width"),
        (at, span * np.array(_WIDTHS)),
        lambda c, s: np.exp(-0.5 * ((c - s[:, 0]) / s[:, 1]) ** 2),
        "exp(-((c - at)/width)**2/2)",
    )
    yield _even("bow", (), (), lambda c, s: ((c - middle) / half) ** 2, f"((c - {middle!r})/{half!r})**2")
    yield _even("cubic", (), (), lambda c, s: ((c - middle) / half) ** 3, f"((c - {middle!r})/{half!r})**3")
    at = low + span * (np.arange(_SATURATES) + 0.5) / _SATURATES
    yield _even(
        "saturating",
        ("at", "width"),
        (at, span * np.array(_SOFT)),
        lambda c, s: np.tanh((c - s[:, 0]) / s[:, 1]),
        "tanh((c - at)/width)",
    )
    settles, reach = "exponential" if time else "saturating", span * np.array(_REACHES)
    yield _even(
        settles, ("reach",), reach, lambda c, s: 1 - np.exp(-(c - low) / s[:, 0]), f"1 - exp(-(c - {low!r})/reach)"
    )
    yield _even(settles, ("reach",), reach, lambda c, s: np.exp((c - high) / s[:, 0]), f"exp((c - {high!r})/reach)")
    period = span / np.arange(_WHOLE, min(_SINES, 0.5 * len(distinct)), _BETWEEN)
    if len(period) > 1:
        yield _even("sine", ("period",), period, _waves, "cos(2*pi*c/period);sin(2*pi*c/period)")
    period = span / np.arange(_SEVERAL, min(_TEETH, 0.25 * len(distinct)), _BETWEEN)
    if len(period) > 1:
        grid, apart = _grid(period, np.arange(_PHASES) / _PHASES)
        grid[:, 1], apart[:, 1] = grid[:, 1] * grid[:, 0], apart[:, 1] * grid[:, 0]
        yield ClosedForm("sawtooth", ("period", "at"), grid, apart, _teeth, "2/pi*atan(tan(pi*(c - at)/period))")
    zero = 0.0 if low < 0 < high else middle
    width = half * np.arange(1, _DEAD + 1) / (_DEAD + 1)
    yield _even(
        "dead_zone",
        ("width",),
        width,
        lambda c, s: np.sign(c - zero) * np.maximum(np.abs(c - zero) - s[:, 0], 0) / span,
        f"sign(c - {zero!r})*max(abs(c - {zero!r}) - width, 0)/{span!r}",
    )


def _waves(c: Floats, s: Floats) -> Floats:
    turn = 2 * np.pi * c / s[:, 0]
    return np.stack([np.cos(turn), np.sin(turn)], axis=2)


def _teeth(c: Floats, s: Floats) -> Floats:
    turn = (c - s[:, 1]) / s[:, 0]
    return np.asarray(2 * (turn - np.round(turn)))


def _even(
    name: str, parameters: tuple[str, ...], nodes: Floats | tuple[Floats, ...], function: Function, formula: str
) -> ClosedForm:
    grid, apart = _grid(*(nodes if isinstance(nodes, tuple) else (nodes,)))
    return ClosedForm(name, parameters, grid, apart, function, formula)


def _grid(*nodes: Floats) -> tuple[Floats, Floats]:
    """All combinations (K, s) of nodes, and how far each node is from the next."""
    if not nodes:
        return np.zeros((1, 0)), np.zeros((1, 0))
    apart = [np.abs(np.gradient(each)) for each in nodes]
    return tuple(
        np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, len(nodes)) for each in (nodes, apart)
    )  # type: ignore[return-value]
