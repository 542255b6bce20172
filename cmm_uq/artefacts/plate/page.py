"""What a certificate shows of a plate: where each ball was found against where it belongs, before and after the model."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import cast

from cmm_uq.artefacts.plate.analysis import Arrows, PlateFigures, arrows, compared, figures, results
from cmm_uq.artefacts.plate.observe import Plate
from cmm_uq.base.messages import Text, Verbatim, day, number, say, sentences
from cmm_uq.base.units import PPM, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.vectors import vector_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.maths.uncertainty.quantity import alike, rounded

_PLATES_SHOWN = 6
_CERTIFIED = (say("Positions on the plate"), say("Found minus certified"), say("After the fitted model"))
_COMPARED = (say("What changed between the two dates"), say("Now minus then"), say("After the fitted change"))


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
    earlier = facts.recording.earlier_date
    recording = say("the earlier recording of {date}", date=day(earlier)) if earlier else say("the earlier recording")
    texts: list[Text] = [
        say(
            "References are the positions found by {recording}; the error factors of "
            "this certificate are what changed since. Errors of machine and plate that were there on "
            "both dates cancel, as long as the plate stood in the same places.",
            recording=recording,
        )
    ]
    if found.common is not None:
        common, cte = found.common, found.common.cte_per_k / PPM
        value, U, _ = expanded(common.change)
        kelvin = rounded(abs(common.warmer.value), 2 * common.warmer.u)[0]
        told = say("The common part of the scales changed by {value} ppm, U = {U} ppm.", value=value, U=U)
        texts += [told, _alike(kelvin, cte, colder=common.colder)]
    texts.append(say("A plate that has sheared or bent since looks like squareness or straightness of its plane."))
    return [Paragraph(sentences(texts))]


def _alike(kelvin: Text, cte: float, *, colder: bool) -> Text:
    if colder:
        return say(
            "A plate that was colder by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for looks the "
            "same, and so does one that has shrunk by as much.",
            kelvin=kelvin,
            cte=cte,
        )
    return say(
        "A plate that was warmer by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for looks the "
        "same, and so does one that has grown by as much.",
        kelvin=kelvin,
        cte=cte,
    )


def _picture(one: Arrows, titles: Sequence[Text]) -> Block:
    before, after = alike(*(max(hypot(*arrow) for arrow in arrows.tolist()) for arrows in (one.before, one.after)))
    first, second = ("xyz"[axis] for axis in one.axes)
    return vector_plot(
        one.place,
        tuple(zip(titles, (one.before, one.after), strict=True)),
        axis_labels=(
            say("Plate {first} / mm", first=Verbatim(first)),
            say("Plate {second} / mm", second=Verbatim(second)),
        ),
        caption=say(
            "Measurement {measurement}: displacement of each ball in the plane of the plate, placed by least squares.",
            measurement=one.measurement,
        ),
        alternative=say(
            "Arrows at {count} balls: up to {before} µm as recorded, up to {after} µm after the fitted model.",
            count=len(one.place),
            before=before,
            after=after,
        ),
    )


def _table(result: Result, found: PlateFigures) -> Table:
    noise = result.noise.coordinate.value
    rows = []
    for one in found.spread:
        sizes = (one.rms_before_um, one.largest_before_um, one.rms_after_um, one.largest_after_um)
        rows.append((number(one.measurement), number(one.count), *(rounded(size, noise)[0] for size in sizes)))
    columns = (
        Column(say("Placing"), numeric=False),
        Column(say("Balls")),
        Column(say("rms before"), unit("µm")),
        Column(say("Largest before"), unit("µm")),
        Column(say("rms after"), unit("µm")),
        Column(say("Largest after"), unit("µm")),
    )
    note = say(
        "Coordinates of every ball minus its reference position, before and after the fitted model; "
        "the placing is fitted."
    )
    return Table(say("Deviation of a coordinate"), columns, tuple(rows), (note,))


PAGE = Page(sections, results)
