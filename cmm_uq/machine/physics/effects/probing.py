"""Errors of probing, of a stylus on contact, of a laser digitizer in its own frame, and of a bar's support.

The surface pushes a tip along the outward normal n, so the machine travels too far and true = indicated + amount·n. The frame
of a digitizer turns with ``gamma_deg``, and with ``alpha_deg`` and ``beta_deg`` where they are recorded; without these w lies
along the machine's X axis (α = β = 90°, Harris 2004 section 6.2). Depth is measured along v.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.machine.physics.effect import FURTHER, Effect, Harmonic, Parameter, say
from cmm_uq.machine.physics.effects import Law
from cmm_uq.machine.physics.effects.drives import travel
from cmm_uq.machine.physics.effects.own_states import HARMONICS, NORMAL, OfDirections, harmonics, lobes_of, normals_of
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets
from cmm_uq.machine.physics.kinematics import euler_313

TIP = tuple(f"tip_{a}_mm" for a in AXES)
REFERENCE_LENGTH = 100.0  # mm; the length of stylus that bending is stated for
_MILLISECOND = 1e-3


def machine_normals(points: Points) -> Floats:
    """Outward unit normals (n, 3) along the axes of the machine."""
    return np.asarray(points.machine.turned(normals_of(points)[:, :, None], points.columns)[:, :, 0])


class ProbeLobing(Harmonic):
    """Three-lobed pre-travel.

    A probe on three seats has three lobes; stylus, adapters and strain gauges have others (ISO 230-10, Schwenke 2008).
    """

    name, title = "probe_lobing", say("Lobing of the probe")
    formula, mechanism = "true surface point = indicated + A·cos(3θ + φ)·n, θ = atan2(ny, nx)", "probe"
    points_to = say("the probe's pre-travel has three lobes: qualify it in more directions")
    means: Text = say("the probing error swings to either side by {size}, three times in a turn about Z")
    amplitude = Parameter("amplitude_um", unit("µm"), 5.0, say("amplitude"))
    coefficients = (Parameter("cosine_um", unit("µm"), 5.0), Parameter("sine_um", unit("µm"), 5.0))
    columns = NORMAL

    def __init__(self, count: int = 3) -> None:
        self.count = count
        if count != 3:
            self.name, self.tier, self.means = f"{self.name}_{count}", FURTHER, NOTHING
            self.formula = self.formula.replace("3", str(count))
            self.title = say("Probe with {count} lobes", count=count)
            self.points_to = say(
                "the probe's pre-travel has {count} lobes: check how its stylus and its seats are held, and qualify it in "
                "more directions",
                count=count,
            )

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return lobes_of(machine_normals(points), self.count)


class ProbeMap(OfDirections):
    """A probing error of its own in every direction: spherical harmonics of the degrees 2 to 5 (VDI/VDE 2617-2)."""

    name, title = "probe_map", say("Probing error by direction")
    formula, mechanism = "e = Σ c_lm·Y_lm(n)·n, l = 2 … 5", "probe"
    points_to = say(
        "the probe errs otherwise in every direction: qualify it with more points, or correct it by a map of directions"
    )
    size = Parameter("rms_um", unit("µm"), 2.0)
    coefficients = tuple(Parameter(f"c{degree}_{order}_um", unit("µm"), 2.0) for degree, order in HARMONICS)
    columns, tier = NORMAL, FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        normals = machine_normals(points)
        return np.asarray(MICROMETRE * normals[:, :, None] * harmonics(normals, 0.0)[:, None, :], dtype=np.float64)


# of its length, by which points of a bar or a gauge may lie beside the line from its first to its farthest
_OFF_LINE = 0.05


class ArtefactSag(Effect):
    """Bar shortened by its own weight.

    It is of points on one line: a plate, a triangle or a sphere is not shortened along a chord. As a displacement it draws
    the points apart along the bar, in proportion to their place on it, to where they would lie without sag.
    """

    name, title = "artefact_sag", say("Sag of the artefact")
    formula, mechanism = "true length = length − s·cos²(elevation above the table)", "artefact"
    points_to = say("the artefact sags or its supports are not at the right points")
    means = say("lying level the artefact is {size} {wrong} than upright")
    sense = (say("shorter"), say("longer"))
    coefficients = (Parameter("um", unit("µm"), 10.0),)

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
            "lie on one line",
            where="job.toml [model] effects",
            fix="Leave it out; what bends a plate by its own weight is artefact_bending",
        )


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


def _stylus(points: Points) -> Floats:
    """Unit vectors (n, 3) along each stylus; along the ram where no tip is recorded."""
    tip = tip_offsets(points)
    length = np.linalg.norm(tip, axis=1, keepdims=True)
    along_tip = tip / np.where(length > 0, length, 1.0)
    return np.where(length > 0, along_tip, np.array([0.0, 0.0, -1.0]))


def attitudes(points: Points) -> Floats:
    """Axes u, v, w of the digitizer as columns (n, 3, 3) in machine axes: Euler angles 3-1-3 (Harris 2004 eq. 7)."""
    right = np.full(len(points), 90.0)
    alpha, beta = (np.radians(points.columns.get(name, right)) for name in ("alpha_deg", "beta_deg"))
    return np.moveaxis(euler_313(alpha, beta, np.radians(points.column("gamma_deg"))), 2, 0)


def _axially(points: Points, _: str, __: str, ___: Sequence[float]) -> Floats:
    axis = _stylus(points)
    part = np.einsum("ni,ni->n", machine_normals(points), axis)
    return np.asarray(MICROMETRE * (part[:, None] * axis)[:, :, None], dtype=np.float64)


def _bending(points: Points, _: str, __: str, ___: Sequence[float]) -> Floats:
    length = np.linalg.norm([points.column(name) for name in TIP], axis=0)
    axis, normals = _stylus(points), machine_normals(points)
    across = normals - np.einsum("ni,ni->n", normals, axis)[:, None] * axis
    ratio = (length / REFERENCE_LENGTH) ** 3
    return np.asarray(MICROMETRE * ratio[:, None, None] * across[:, :, None], dtype=np.float64)


def _turning(points: Points, _: str, __: str, ___: Sequence[float]) -> Floats:
    turns = np.cross(np.eye(3)[None], np.column_stack([points.column(name) for name in TIP])[:, None])
    return np.asarray(ARCSECOND * turns.swapaxes(1, 2), dtype=np.float64)


def _askew(points: Points, _: str, __: str, ___: Sequence[float]) -> Floats:
    frame = attitudes(points)
    own = np.einsum("ni,nij->nj", machine_normals(points), frame)
    angles = np.degrees(np.arctan2(own[:, [0, 2]], np.abs(own[:, 1:2])))
    return np.asarray(MICROMETRE * frame[:, :, 1:2] * angles[:, None, :], dtype=np.float64)


_ABOUT = tuple(
    Parameter(f"about_{a}_arcsec", unit("″"), 20.0, say("about {axis}", axis=Verbatim(a.upper()))) for a in AXES
)
RADIUS, *_FURTHER, _HEAD = (row.of() for row in (
    Law("probe_radius", "Error of the effective stylus radius", say("Effective stylus radius"),
        "true surface point = indicated + r·n", "probe",
        say("the effective stylus radius is wrong: qualify the probe again"), (Parameter("um", unit("µm"), 10.0),),
        lambda p, a, b, s: MICROMETRE * machine_normals(p)[:, :, None], NORMAL,
        means=say("probed surfaces are indicated {size} too {wrong}"),
        sense=(say("deep, inside the material"), say("early, outside the material"))),
    # the same gap on every axis, unlike hysteresis, whose axes differ; travel is a unit vector against the normal
    Law("pre_travel", "Pre-travel, or a wrong stylus radius, where only the direction of travel is known",
        say("Pre-travel of the probe"), "e = −amount·travel", "probe",
        say("the probe's pre-travel or the stylus radius is wrong by as much in every direction: qualify the probe again, "
            "with the speed and the force of the measurement"), (Parameter("um", unit("µm"), 10.0),),
        lambda p, a, b, s: -MICROMETRE * travel(p)[:, :, None], tuple(f"approach_{a}" for a in AXES), FURTHER),
    # a kinematic probe head triggers at once along its axis and late across it
    Law("probe_axial",
        "Deflection along the stylus unlike that across it; t is along the stylus (the ram without tip columns)",
        say("Deflection of the probe along its axis"), "e = amount·(n·t)·t", "probe",
        say("the probe gives way differently along the stylus and across it: qualify it with points along the stylus too, "
            "and check its trigger force"), (Parameter("um", unit("µm"), 5.0),), _axially, NORMAL, FURTHER),
    # a cantilever under the probing force gives way by F·L³/(3·E·I)
    Law("stylus_bending", "Bending of the stylus t, whose length L follows from the tip columns",
        say("Bending of the stylus"), "e = amount·(L/100 mm)³·(n − (n·t)t)", "probe",
        say("the stylus bends under the probing force: take a shorter or stiffer one, or a lower force, and qualify each "
            "stylus by itself"), (Parameter("um", unit("µm"), 5.0),), _bending, (*NORMAL, *TIP), FURTHER),
    Law("trigger_delay", "Delay between contact and reading", say("Delay of the probe's trigger"), "e = delay·speed·n",
        "controller",
        say("the trigger reaches the controller late: check the probe's interface and cable, and qualify the probe at the "
            "speed of the measurement"), (Parameter("delay_ms", unit("ms"), 1.0),),
        lambda p, a, b, s: _MILLISECOND * (p.column("speed_mm_s")[:, None] * machine_normals(p))[:, :, None],
        (*NORMAL, "speed_mm_s"), FURTHER),
    # an alignment on the reference sphere that was off by [du dv], or a mount that has moved since (Harris 2004 eq. 14–25)
    Law("digitizer_offset", "Digitizer misaligned in its scan plane, which turns with the pose",
        say("Alignment of the digitizer"), "e = du·u + dv·v", "optical probe",
        say("the digitizer is out of alignment, or has moved in its mount: tighten the mount and align it on the reference "
            "sphere again, in every pose"),
        (Parameter("u_um", unit("µm"), 20.0, say("along u")), Parameter("v_um", unit("µm"), 20.0, say("along v"))),
        lambda p, a, b, s: MICROMETRE * attitudes(p)[:, :, :2], ("gamma_deg",), FURTHER),
    Law("digitizer_depth", "Error in proportion to scan depth, from the column ``depth_mm`` (Feng 2001, Xi 2001)",
        say("Depth bias of the digitizer"), "e = k·depth·v", "optical probe",
        say("the digitizer's depth scale is wrong: calibrate it over its range, and scan in its middle until then"),
        (Parameter("um_per_mm", unit("µm/mm"), 1.0),),
        lambda p, a, b, s: MICROMETRE * p.column("depth_mm")[:, None, None] * attitudes(p)[:, :, 1:2],
        ("gamma_deg", "depth_mm"), FURTHER),
    # the incident angle lies in the scan plane, the projected one across it
    Law("digitizer_incidence", "Error in proportion to the angles between beam and normal (Feng 2001, Xi 2001)",
        say("Incidence of the digitizer's light"), "e = (kᵢ·incident + kₚ·projected)·v", "optical probe",
        say("the digitizer errs where its light meets the surface askew: turn it square to the surface, or correct its "
            "readings for the angle"),
        (Parameter("incident_um_per_deg", unit("µm/°"), 1.0, say("by incidence")),
         Parameter("projected_um_per_deg", unit("µm/°"), 1.0, say("by projected angle"))), _askew,
        ("gamma_deg", *NORMAL), FURTHER),
    Law("head_alignment",
        "A probe head that stands turned against where its styli were qualified, and moves each as it is long (ISO 10360-5)",
        say("Alignment of the probe head"), "e = ω × stylus", "probe",
        say("the probe head, or its stylus changer, stands turned against how the styli were qualified: clean its seats, and "
            "qualify every stylus again"), _ABOUT, _turning, TIP, FURTHER),
))  # fmt: skip
EFFECTS: tuple[Effect, ...] = (
    RADIUS, ProbeLobing(), ArtefactSag(), *_FURTHER, *(ProbeLobing(count) for count in (2, 4, 6)), ProbeMap(), _HEAD,
)  # fmt: skip
OF_ANY_TIP = tuple(effect for effect in EFFECTS if effect.name in ("probe_radius", "pre_travel"))  # whatever carries it
