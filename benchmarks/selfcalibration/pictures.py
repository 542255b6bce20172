"""Pictures of the page on self-calibration.

Run:  python -m benchmarks.selfcalibration.pictures

``shift-blind.svg``: two errors of a machine that no reading of two placings shows apart. ``shift-curve.svg``: the curve of
the example with its band, and the error that was put in.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.examples.shift_job import error as example_error
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.base.points import Floats
from cmm_uq.certificate.plots.style import ACCENT, INK, MUTED, as_svg, house_style, new_figure

ROOT = Path(__file__).parents[2]
PITCH, SHIFT = 40.0, 20.0


def one(x: Floats) -> Floats:
    return np.asarray(12 * np.sin(x / 70))


def other(x: Floats) -> Floats:
    """The same but for a period that the shift is a multiple of."""
    return one(x) + 4 * np.sin(2 * np.pi * x / SHIFT + 1.0)


def blind() -> str:
    x = np.linspace(0, 460, 2000)
    a = PITCH * np.arange(12)
    with house_style():
        figure = new_figure(96)
        top, below = figure.subplots(2, 1, sharex=True)
        figure.subplots_adjust(left=0.085, right=0.99, bottom=0.11, top=0.95, hspace=0.3)
        for e, colour in ((other, MUTED), (one, ACCENT)):
            top.plot(x, e(x), color=colour, lw=1.1)
            top.plot(a, e(a), ls="", marker="o", ms=4, mfc=colour, mec=colour)
            top.plot(a + SHIFT, e(a + SHIFT), ls="", marker="o", ms=4, mfc="white", mec=colour)
        top.set_title(
            "Two machines: error at the readings, before (dots) and after the shift (rings)", loc="left", fontsize=8
        )
        top.set_ylabel("e / µm")
        for e, colour, size in ((other, MUTED, 6), (one, ACCENT, 3)):
            below.plot(a, e(a) - e(a + SHIFT), ls="", marker="o", ms=size, color=colour)
        below.set_title("What the shift shows of them, b − a − D: the same", loc="left", fontsize=8)
        below.set(xlabel="Scale reading / mm", ylabel="µm")
        for axes in (top, below):
            axes.axhline(0, color=INK, lw=0.6)
            axes.grid(axis="y")
        return as_svg(figure)


def curve() -> str:
    result = analyse(ROOT / "examples" / "shift-simulated")
    assert isinstance(result, ShiftResult)
    fine, k = result.fine, result.estimate.curve.simultaneous_factor
    true = 1e3 * (example_error(fine.position) - example_error(fine.position[:1]))
    with house_style():
        figure = new_figure(72)
        axes = figure.subplots()
        figure.subplots_adjust(left=0.085, right=0.975, bottom=0.14, top=0.97)
        band = 1e3 * k * fine.u
        axes.fill_between(
            fine.position, 1e3 * fine.error - band, 1e3 * fine.error + band, color=ACCENT, alpha=0.16, lw=0
        )
        axes.plot(fine.position, 1e3 * fine.error, color=ACCENT, lw=1.3)
        axes.plot(fine.position, true, color=INK, lw=0.9, ls="--")
        axes.grid(axis="y")
        axes.set(xlabel="Scale reading x / mm", ylabel="Error e / µm")
        return as_svg(figure)


if __name__ == "__main__":
    for name, picture in (("shift-blind.svg", blind()), ("shift-curve.svg", curve())):
        (ROOT / "docs" / "images" / name).write_text(picture, encoding="utf-8")
