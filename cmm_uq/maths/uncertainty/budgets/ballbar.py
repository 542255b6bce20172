"""Length of a ballbar from one position of it: the budget of Harris 2004 as printed, and one that holds.

Harris 2004 (sections 6.2.3 and 6.4.1) adds the digitizer's specification and the rms residual of the sphere fit as
standard uncertainties of a centre, and worst-case scale errors as standard uncertainties of the length. A fit to
thousands of points leaves far less scatter in the centre, limits are not standard uncertainties, and what all positions
share does not average out. :func:`ballbar_length` keeps these apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import sqrt

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, foreign, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, REPEATS, SPECIFICATION, Budget, Line, joint_line


@dataclass(frozen=True, eq=False)
class BallbarPosition:
    """One position of a ballbar.

    Parameters
    ----------
    length_mm : distance of the centres.
    direction : (3,) unit vector along the bar.
    centre_covariance_mm2 : (3, 3) of one fitted centre, from the scatter of its points.
    form_shift_mm : how far, at most, a ball's form moves its centre along the bar.
    probe_mm : limits of what the probing system may shift a ball by, systematically.
    probe_common : correlation of that shift between the two balls; one when both are seen the same way.
    scale_mm : (3,) limits of the scale errors of x, y, z over the bar's full length.
    u_squareness_rad : (3,) standard uncertainties of the squarenesses xy, yz, zx.
    u_temperature_k, cte_per_k : of the bar, where its length at 20 °C is asked for.
    """

    length_mm: float
    direction: Floats
    centre_covariance_mm2: Floats
    form_shift_mm: float = 0.0
    probe_mm: float = 0.0
    probe_common: float = 0.0
    scale_mm: Sequence[float] = (0.0, 0.0, 0.0)
    u_squareness_rad: Sequence[float] = (0.0, 0.0, 0.0)
    u_temperature_k: float = 0.0
    cte_per_k: float = 0.0
    origins: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if abs(np.linalg.norm(self.direction) - 1) > 1e-6:
            raise CmmUqError("the bar's direction is no unit vector", fix="Divide it by its length")


def ballbar_length(position: BallbarPosition) -> Budget:
    """Budget of the length from one position, mm.

    A limit a enters as a rectangular distribution, u = a/√3. Along a bar of direction w the scales contribute wᵢ² of
    their error over the full length, the squarenesses wᵢwⱼ of theirs times the length.
    """
    w, length = np.asarray(position.direction), position.length_mm
    scatter = float(w @ position.centre_covariance_mm2 @ w)
    lines = [
        Line(say("scatter of the points, ball {ball}", ball=ball), sqrt(scatter), REPEATS, unit=unit("mm"))
        for ball in (1, 2)
    ]
    lines += [_limit(say("form of ball {ball}", ball=ball), position.form_shift_mm, CERTIFICATE) for ball in (1, 2)]
    lines += [
        _limit(say("probing system at ball {ball}", ball=ball), position.probe_mm, SPECIFICATION) for ball in (1, 2)
    ]
    if position.probe_mm and position.probe_common:
        # the length is a difference, so what shifts both balls alike cancels
        shared = -2 * position.probe_common * position.probe_mm**2 / 3
        both = joint_line(say("both balls shifted alike by the probing system"), shared)
        lines.append(replace(both, shared=True))
    lines += [
        _limit(say("scale {axis}", axis=Verbatim(axis)), position.scale_mm[k], CERTIFICATE, float(w[k] ** 2))
        for k, axis in enumerate("xyz")
    ]
    for name, (i, j), u in zip(("xy", "yz", "zx"), ((0, 1), (1, 2), (2, 0)), position.u_squareness_rad, strict=True):
        slope = float(abs(w[i] * w[j])) * length
        lines.append(
            Line(
                say("squareness {name}", name=Verbatim(name)),
                u,
                CERTIFICATE,
                unit=unit("rad"),
                sensitivity=slope,
                shared=True,
            )
        )
    warm, slope = position.u_temperature_k, position.cte_per_k * length
    lines.append(Line(say("temperature of the bar"), warm, JUDGEMENT, unit=unit("K"), sensitivity=slope, shared=True))
    told = [replace(line, origin=foreign(position.origins.get(line.name, line.origin))) for line in lines if line.part]
    return Budget(say("length of the ballbar, one position"), told, length, unit("mm"))


def _limit(name: Text, limit_mm: float, origin: Text, sensitivity: float = 1.0) -> Line:
    u = limit_mm / sqrt(3)
    return Line(name, u, origin, 0.0, unit("mm"), "rectangular", sensitivity=sensitivity, shared=True)


def harris_compensated() -> Budget:
    """Harris 2004 section 6.2.3: one length from compensated points, as printed (± 20 µm, 19 before rounding)."""
    centre = Budget(
        say("centre of a sphere"),
        [
            Line(say("digitizer point accuracy"), 9 * MICROMETRE, SPECIFICATION, unit=unit("mm")),
            Line(say("rms residual of the sphere fit"), 10 * MICROMETRE, say("residuals"), unit=unit("mm")),
        ],
        unit=unit("mm"),
    )
    return Budget(
        say("length of the ballbar, as printed in Harris 2004 section 6.2.3"),
        [centre.as_line(say("centre of ball 1")), centre.as_line(say("centre of ball 2"))],
        unit=unit("mm"),
        statement=_PRINTED,
    )


def harris_uncompensated(scale_um: Sequence[float] = (12.0, 18.0, 6.0)) -> Budget:
    """Harris 2004 section 6.4.1: one length from uncompensated points, as printed.

    Parameters
    ----------
    scale_um : (3,) largest scale errors of x, y, z; those of 20 °C, or (21, 30, 12) at 25 °C and (26, 38, 20) at 30 °C.
    """
    return Budget(
        say("length of the ballbar, as printed in Harris 2004 section 6.4.1"),
        [
            Line(say("digitizer point accuracy"), 9 * MICROMETRE, SPECIFICATION, unit=unit("mm")),
            Line(say("rms residual of the sphere fit"), 10 * MICROMETRE, say("residuals"), unit=unit("mm")),
            *(
                Line(
                    say("largest scale error of {axis}", axis=Verbatim(axis)),
                    limit * MICROMETRE,
                    say("error map"),
                    unit=unit("mm"),
                )
                for axis, limit in zip("xyz", scale_um, strict=True)
            ),
        ],
        unit=unit("mm"),
        statement=_PRINTED,
    )


_PRINTED = say(
    "As printed. It takes a specification and largest errors for standard uncertainties, the rms "
    "residual of a fit to thousands of points for the uncertainty of its centre, counts one ball "
    "of the two in section 6.4.1, and divides what all positions share by the root of their "
    "number."
)
