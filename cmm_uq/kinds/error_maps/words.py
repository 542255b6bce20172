"""The diagnosis of error maps in words that a service technician acts on."""

from __future__ import annotations

from cmm_uq.documents.diagnosis_words import sentence
from cmm_uq.documents.wording import probability
from cmm_uq.kinds.error_maps.analysis import MapsDiagnosed
from cmm_uq.kinds.error_maps.diagnosis import Difference, MapsDiagnosis

VERDICTS = {
    "consistent": "The maps agree with each other within their noise.",
    "explained": "The maps differ from each other, and what makes them differ is found.",
    "partial": "The maps differ from each other; something that makes them differ is found, but it does not account for all.",
    "unexplained": "The maps differ from each other, and no known effect accounts for it.",
}


def lines(found: MapsDiagnosed) -> list[str]:
    """Verdict and everything that follows from it, a sentence or two each."""
    d = found.diagnosis
    said = [VERDICTS[d.verdict]]
    said += [sentence(item, d.improvement) for item in d.effects]
    said += [difference_words(difference) for difference in d.differences]
    return [*said, *noise_words(d), *(what for _, what in next_words(d))]


def difference_words(difference: Difference) -> str:
    """Where maps differ, by how much, and which of them it may be."""
    unit, rival = difference.column.unit[0], difference.rival
    low, high = difference.region
    axis = difference.column.axis.upper()
    size = f"by up to {difference.amplitude:.2g}\u00a0{unit}, most of all from {axis} = {low:g} to {high:g}\u00a0mm"
    what = f"{rival.name[0].upper()}{rival.name[1:]}"
    if rival.map is not None:
        text = f"{what} differs from the others {size}"
    elif len(difference.column.temperatures) == 2:
        text = f"{what}: {size}; which of the two is right they cannot say"
    else:
        text = f"{what}, changes {size}"
    text += f" (probability {probability(difference.probability)})."
    if difference.turned:
        text += " With the sign of its figures turned it would agree."
    if difference.instead:
        text += f" It could also be: {'; '.join(difference.instead)}."
    return text


def noise_words(d: MapsDiagnosis) -> list[str]:
    """Scatter of a reading about smooth functions."""
    found = []
    for what, noise in (("displacement", d.displacement), ("rotation", d.rotation)):
        if noise is not None:
            low, high = noise.interval95
            found.append(
                f"Standard uncertainty of one reading of a {what} {noise.value:.2g}\u00a0{noise.unit} "
                f"(95\u00a0% interval {low:.2g} to {high:.2g}\u00a0{noise.unit})."
            )
    return found


def next_words(d: MapsDiagnosis) -> list[tuple[tuple[str, ...], str]]:
    """What to measure next, once for each error: explanations that it would part, and in words."""
    found = []
    for title in dict.fromkeys(difference.column.title for difference in d.differences):
        some = [difference for difference in d.differences if difference.column.title == title]
        names = tuple(dict.fromkeys(name for one in some for name in (one.rival.name, *one.instead)))
        temperatures = some[0].column.temperatures
        if len(temperatures) == 2:
            what = f"Map the {title} a third time: with two maps nothing says which of them is off."
        else:
            chosen = [t for t in temperatures if any(name.endswith(f" {t:g} °C") for name in names)]
            listed = [f"{t:g}" for t in (chosen if len(chosen) == 1 else temperatures)]
            what = (
                f"Measure the {title} again at {' and '.join(filter(None, (', '.join(listed[:-1]), listed[-1])))} °C."
            )
        found.append((names, what))
    return found
