"""What a certificate shows of a plate: where each ball was found against where it belongs, before and after the model."""

from __future__ import annotations

from math import hypot
from typing import cast

from cmm_uq.documents.document import Block, Column, Paragraph, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.result import Result
from cmm_uq.documents.vector_plot import vector_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.plate.analysis import Arrows, PlateFigures, arrows, compared, figures, results
from cmm_uq.kinds.plate.observe import Plate
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import PPM

_PLATES_SHOWN = 6
_CERTIFIED = ("Positions on the plate", "Found minus certified", "After the fitted model")
_COMPARED = ("What changed between the two dates", "Now minus then", "After the fitted change")


def sections(result: Result) -> list[Section]:
    """Every placing by itself in numbers, and the first of them as arrows in the plate's own plane."""
    plate = cast("Plate", result.artefact)
    found = figures(result)
    title, *titles = _COMPARED if compared(result) else _CERTIFIED
    blocks: list[Block] = [_table(result, found), *_confounded(result, found)]
    blocks += [_picture(arrows(plate, found, number), titles) for number in plate.placings.numbers[:_PLATES_SHOWN]]
    return [Section(title, tuple(blocks))]


def _confounded(result: Result, found: PlateFigures) -> list[Block]:
    """What else would look like the change that was found."""
    if not compared(result):
        return []
    facts = result.job.facts
    since = f" of {facts.recording.earlier_date.isoformat()}" if facts.recording.earlier_date else ""
    texts = [
        f"References are the positions found by the earlier recording{since}; the error factors of this certificate are what "
        "changed since. Errors of machine and plate that were there on both dates cancel, as long as the plate stood in the "
        "same places."
    ]
    if found.common is not None:
        common, cte = found.common, found.common.cte_per_k / PPM
        value, U, _ = expanded(common.change)
        kelvin = rounded(abs(common.warmer.value), 2 * common.warmer.u)[0]
        temperature, size = ("colder", "shrunk") if common.colder else ("warmer", "grown")
        texts.append(
            f"The common part of the scales changed by {value} ppm, U = {U} ppm. A plate that was {temperature} by {kelvin} K "
            f"(at {cte:.3g} ppm/K) than its recorded temperatures account for looks the same, and so does "
            f"one that has {size} by as much."
        )
    texts.append("A plate that has sheared or bent since looks like squareness or straightness of its plane.")
    return [Paragraph(" ".join(texts))]


def _picture(one: Arrows, titles: list[str]) -> Block:
    largest = [max(hypot(*arrow) for arrow in arrows.tolist()) for arrows in (one.before, one.after)]
    first, second = ("xyz"[axis] for axis in one.axes)
    return vector_plot(
        one.place, tuple(zip(titles, (one.before, one.after), strict=True)),
        axis_labels=(f"Plate {first} / mm", f"Plate {second} / mm"),
        caption=f"Measurement {one.measurement}: displacement of each ball in the plane of the plate, "
        "placed by least squares.",
        alternative=(
            f"Arrows at {len(one.place)} balls: up to {largest[0]:.1f} µm as recorded, up to {largest[1]:.1f} µm after the "
            "fitted model."
        ),
    )  # fmt: skip


def _table(result: Result, found: PlateFigures) -> Table:
    noise = result.noise.coordinate.value
    rows = []
    for one in found.spread:
        sizes = (one.rms_before_um, one.largest_before_um, one.rms_after_um, one.largest_after_um)
        rows.append((str(one.measurement), str(one.count), *(rounded(size, noise)[0] for size in sizes)))
    columns = (
        Column("Placing", numeric=False), Column("Balls"), Column("rms before", "µm"), Column("Largest before", "µm"),
        Column("rms after", "µm"), Column("Largest after", "µm"),
    )  # fmt: skip
    note = "Coordinates of every ball minus its reference position, before and after the fitted model; the placing is fitted."
    return Table("Deviation of a coordinate", columns, tuple(rows), (note,))


PAGE = Page(sections, results)
