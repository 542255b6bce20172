"""Small drawings of artefacts, each in the frame of a machine's volume, by the kind of measurement."""

from __future__ import annotations

_FRAME = (
    '<path class="rule" d="M14 62 60 76 106 60 60 47ZM14 62V22L60 8 106 20V60M60 47V8M14 22 60 35 106 20M60 35V76"/>'
)
_BALL = '<circle class="fill" cx="{}" cy="{}" r="{}"/>'


def _balls(*places: tuple[float, float], r: float = 4) -> str:
    return "".join(_BALL.format(x, y, r) for x, y in places)


def _line(*places: tuple[float, float]) -> str:
    return '<path class="bold" d="M' + " ".join(f"{x} {y}" for x, y in places) + '"/>'


_STEPS = _line((26, 62), (94, 40)) + "".join(
    _line((x, 62 - (x - 26) * 0.32), (x, 54 - (x - 26) * 0.32)) for x in range(30, 94, 9)
)
_PLATE = '<path class="wash" d="M30 58 62 68 92 52 60 43Z"/>'
_GRID = _balls((40, 57), (52, 60), (64, 63), (50, 52), (62, 55), (74, 58), (60, 47), (72, 50), (83, 53), r=2.6)
_BEAM = '<path class="beam" d="M10 50H104"/>'
_CIRCLE = '<ellipse class="bold" cx="60" cy="52" rx="30" ry="13"/>'
DRAWINGS: dict[str, str] = {
    "ballbar": _line((32, 60), (88, 30)) + _balls((32, 60), (88, 30), r=6),
    "bryan": _line((60, 54), (90, 34)) + _CIRCLE + _balls((60, 54), (90, 34), r=5),
    "step_gauge": _STEPS,
    "gauge_blocks": '<path class="wash" d="M30 60 80 42 88 46 88 54 38 72 30 68Z"/>' + _line((30, 60), (80, 42)),
    "plate": _PLATE + _GRID,
    "triangle": _line((34, 62), (88, 58), (58, 30), (34, 62)) + _balls((34, 62), (88, 58), (58, 30), r=5),
    "sphere": _line((60, 66), (60, 46)) + _balls((60, 38), r=15),
    "plane": '<path class="wash" d="M22 60 60 72 100 56 60 44Z"/>' + _GRID,
    "shift": _line((20, 58), (80, 42)) + _line((36, 66), (96, 50)) + _balls((20, 58), (50, 50), (80, 42), r=3),
    "shift_plate": _PLATE + '<path class="bold" d="M40 50 72 60 100 44 68 36Z"/>',
    "digitizer": _balls((60, 58), r=13) + '<path class="beam" d="M60 14 44 54M60 14 76 54"/>',
    "axis_runs": _BEAM + _line((60, 42), (60, 58)) + _line((82, 42), (82, 58)),
    "circular_test": _CIRCLE + _line((60, 52), (86, 46)) + _balls((60, 52), r=4),
    "multilateration": '<path class="beam" d="M18 60 66 30M102 58 66 30M60 74 66 30M24 24 66 30"/>'
    + _balls((66, 30), r=5),
    "scanned_planes": '<path class="wash" d="M28 60 60 70 60 48 28 38ZM60 70 94 58 94 36 60 48Z"/>'
    '<path class="beam" d="M60 12 46 52M60 12 78 54"/>',
}


def drawing(kind: str) -> str:
    """The drawing of a kind, or the volume alone for one of another package."""
    return f'<svg viewBox="0 0 120 84" aria-hidden="true">{_FRAME}{DRAWINGS.get(kind, "")}</svg>'
