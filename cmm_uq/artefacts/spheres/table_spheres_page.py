"""What a certificate shows of spheres on turning tables, or under a turning head: ranges, location of the axes, deviations."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.spheres.table_spheres import DIRECTIONS, FIGURES, RANGES, TableSpheres, sphere_name
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Plot, Section, Table, columns, figure_columns, section
from cmm_uq.certificate.plots.residuals import deviations_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.machine.physics.effects.rotary import OfItsAxis
from cmm_uq.maths.uncertainty.quantity import rounded


def results(result: Result) -> dict[str, Any]:
    artefact = cast("TableSpheres", result.artefact)
    found, points = artefact.figures(np.ones(len(artefact.points), dtype=bool)), artefact.points
    each, several = [], artefact.machine.fourth is None
    at = dict.fromkeys((True, False), 0)  # how many of either kind came before
    for first, *_ in artefact.runs:
        one: dict[str, Any] = {"measurement": int(points.measurement[first]), "point": int(points.point[first])}
        by_axis = bool(artefact.by_axis[first])
        if several:
            one["turning"] = list(artefact.turns[one["measurement"]].upper())
        if by_axis:
            one |= {"radius_mm": float(artefact.radius[first]), "height_mm": float(artefact.axial[first])}
        names = FIGURES if by_axis else RANGES
        each.append(one | {f"{name}_um": float(found[name].values[at[by_axis]]) / MICROMETRE for name in names})
        at[by_axis] += 1
    return {"spheres": each} | ({"by_angle": by_angle(artefact)} if several else {})


def by_angle(artefact: TableSpheres) -> list[dict[str, Any]]:
    """Of each sphere at each set of angles: mean deviation along X, Y, Z and scatter about it, µm."""
    points = artefact.points
    about = (points.xyz - artefact.placings.means(points.xyz)) / MICROMETRE
    keys = np.column_stack([points.point, *(np.round(read, 3) for read in artefact.read.values())])
    whole, index = np.unique(keys, axis=0, return_inverse=True)
    found = []
    for i, (point, *angles) in enumerate(whole.tolist()):
        own = about[index.ravel() == i]
        one: dict[str, Any] = {"point": int(point)}
        one |= {f"{letter}_deg": angle for letter, angle in zip(artefact.read, angles, strict=True)}
        s = own.std(axis=0, ddof=1).tolist() if len(own) > 1 else None
        found.append(one | {"count": len(own), "mean_um": own.mean(axis=0).tolist(), "s_um": s})
    return found


def sections(result: Result) -> list[Section]:
    artefact = cast("TableSpheres", result.artefact)
    plots = [_over_positions(result, artefact, k) for k in range(3)]
    if artefact.machine.fourth:
        return [section(say("Four-axis errors"), _table(result, FIGURES), *plots)]
    tables = (_table(result, names) for names in (FIGURES, RANGES))
    return [section(say("Rotary axes"), _axes(result), *tables, *plots)]


def _axes(result: Result) -> Table | None:
    """Location and tilt of the axes, by their names."""
    rows = []
    for effect in result.model.effects:
        if isinstance(effect, OfItsAxis) and (known := result.parameters.get(effect.name)):
            (quantity,) = known.values()
            value, expanded = rounded(quantity.value, quantity.expanded)
            rows.append((Verbatim(effect.symbol), effect.title, value, expanded, quantity.unit))
    heads = columns([say("Error"), say("What it is"), say("Value"), say("U"), say("Unit")])
    note = say("Names as ISO 230-7:2015 forms them: the error, 0, and the axis. Signs as of the effects.")
    return Table(say("Location and tilt of the rotary axes"), heads, tuple(rows), (note,)) if rows else None


def _table(result: Result, names: tuple[str, ...]) -> Table | None:
    several = cast("TableSpheres", result.artefact).machine.fourth is None
    spheres = [one for one in results(result)["spheres"] if f"{names[0]}_um" in one]
    if not spheres:
        return None
    places = ("radius_mm", "height_mm") if names == FIGURES else ()
    rows = [
        (
            say("measurement {number}, {sphere}", number=one["measurement"], sphere=sphere_name(one["point"])),
            *((Verbatim(", ".join(one["turning"])),) if several else ()),
            *(number(one[name], ".1f") for name in places),
            *(rounded(one[f"{name}_um"], result.noise.expanded / 2)[0] for name in names),
        )
        for one in spheres
    ]
    where = figure_columns(say("Radius"), say("Height"), unit=unit("mm")) if places else ()
    note = say(
        "Range of the coordinate of the centre on the table over all its positions: along the radius (FR), the tangent (FT) "
        "and the axis (FA), as recorded. Radius and height are from the stated point of the axis."
    )
    if not places:
        note = say(
            "Range of the centre's coordinates on the table, or in the machine without one, where several axes turned."
        )
    what = [say("Sphere"), *((say("Turning"),) if several else ())]
    heads = columns([*what, *where, *figure_columns(*map(Verbatim, names), unit=unit("µm"))])
    return Table(say("Ranges") if places else say("Ranges along X, Y and Z"), heads, tuple(rows), (note,))


def _over_positions(result: Result, artefact: TableSpheres, k: int) -> Plot:
    before, direction, points = artefact.deviations()[:, k] / MICROMETRE, DIRECTIONS[k], artefact.points
    if not artefact.by_axis.all():
        direction = say("{direction}, or {axis},", direction=direction, axis=Verbatim(AXES[k].upper()))
    visit = points.repeat if artefact.machine.fourth else points.group + 1
    caption = say(
        "{direction:capital} coordinate of each centre about the mean of its sphere, with U (k = {k}).",
        direction=direction,
        k=number(result.noise.coverage_factor, ".2f"),
    )
    return deviations_plot(
        result, before, say("{count} centres deviate", count=len(before)),
        say("{direction} from the mean of their sphere", direction=direction), position=visit,
        after_um=result.residuals[k::3] / MICROMETRE, flagged=result.flagged[k::3], reference=say("mean of the sphere"),
        position_label=say("Position of the table, in order"), caption=caption,
    )  # fmt: skip


PAGE = Page(sections, results)
