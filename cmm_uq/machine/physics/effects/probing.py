"""Errors of probing and of the artefact's support: effective radius, lobing, sag of a bar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import Amount, Effect, Harmonic, Parameter
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets


def normals_of(points: Points) -> Floats:
    """Outward unit normals (n, 3), as recorded."""
    return np.column_stack([points.column(f"n{a}") for a in AXES])


class ProbeRadius(Effect):
    """Error of the effective stylus radius."""

    name = "probe_radius"
    title = say("Effective stylus radius")
    formula = "true surface point = indicated + r·n"
    mechanism = "probe"
    points_to = say("the effective stylus radius is wrong: qualify the probe again")
    coefficients = (Parameter("um", unit("µm"), 10.0),)
    columns = ("nx", "ny", "nz")

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "probed surfaces are indicated {size} too {wrong}",
            size=amount.size, wrong=amount.more(say("deep, inside the material"), say("early, outside the material")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return MICROMETRE * normals_of(points)[:, :, None]


class ProbeLobing(Harmonic):
    """Three-lobed pre-travel."""

    name = "probe_lobing"
    title = say("Lobing of the probe")
    formula = "true surface point = indicated + A·cos(3θ + φ)·n, θ = atan2(ny, nx)"
    mechanism = "probe"
    points_to = say("the probe's pre-travel has three lobes: qualify it in more directions")
    amplitude = Parameter("amplitude_um", unit("µm"), 5.0, say("amplitude"))
    coefficients = (Parameter("cosine_um", unit("µm"), 5.0), Parameter("sine_um", unit("µm"), 5.0))
    columns = ("nx", "ny", "nz")

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        size = amounts[self.amplitude.name].size
        return say("the probing error swings to either side by {size}, three times in a turn about Z", size=size)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        normals = normals_of(points)
        angle = 3 * np.arctan2(normals[:, 1], normals[:, 0])
        lobes = np.column_stack([np.cos(angle), -np.sin(angle)])
        return np.asarray(MICROMETRE * normals[:, :, None] * lobes[:, None, :], dtype=np.float64)


# of its length, by which the points of a bar or a gauge may lie beside the line from its first to its farthest
_OFF_LINE = 0.05


class ArtefactSag(Effect):
    """Bar shortened by its own weight.

    It is of points on one line: a plate, a triangle or a sphere is not shortened along a chord.

    As a displacement it draws the points apart along the bar, in proportion to their place on it, to where they would lie
    without sag.
    """

    name = "artefact_sag"
    title = say("Sag of the artefact")
    formula = "true length = length − s·cos²(elevation above the table)"
    mechanism = "artefact"
    points_to = say("the artefact sags or its supports are not at the right points")
    coefficients = (Parameter("um", unit("µm"), 10.0),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "lying level the artefact is {size} {wrong} than upright",
            size=amount.size, wrong=amount.more(say("shorter"), say("longer")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        basis = np.zeros((len(points), 3, 1))
        for rows in points.rows_of_groups:
            bar, about = _bar(points, rows)
            length = float(np.linalg.norm(bar))
            if _on_line(bar, about):
                level = 1 - (bar[2] / length) ** 2
                basis[rows, :, 0] = MICROMETRE * level * (about @ bar / length**2)[:, None] * bar / length
        return basis

    def unfit(self, points: Points) -> CmmUqError | None:
        beside = [rows[0] for rows in points.rows_of_groups if not _on_line(*_bar(points, rows))]
        if not beside:
            return None
        return CmmUqError(
            f"{self.name} shortens a bar or a gauge, and the points of measurement {points.measurement[beside[0]]} do not "
            "lie on one line", where="job.toml [model] effects",
            fix="Leave it out; what bends a plate by its own weight is artefact_bending",
        )  # fmt: skip


def _bar(points: Points, rows: Ints) -> tuple[Floats, Floats]:
    """From the first of some points to the farthest from it, (3,); and all of them about their middle, (n, 3), mm.

    Where readings are of a mount that carries what touches, as a digitizer's are, the artefact is where that is.
    """
    xyz = points.xyz[rows]
    if points.machine.tip_on_every_carriage:
        xyz = xyz + tip_offsets(points)[rows]
    first = xyz[np.argmin(points.point[rows])]
    return xyz[np.argmax(np.linalg.norm(xyz - first, axis=1))] - first, xyz - xyz.mean(axis=0)


def _on_line(bar: Floats, about: Floats) -> bool:
    if not bar.any():
        return False
    along = (about @ bar / float(bar @ bar))[:, None] * bar
    return bool(np.linalg.norm(about - along, axis=1).max() <= _OFF_LINE * np.linalg.norm(bar))


EFFECTS: tuple[Effect, ...] = (ProbeRadius(), ProbeLobing(), ArtefactSag())
