"""The diagnosis of error maps in words that a service technician acts on."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.artefacts.error_maps.diagnosis import Difference, MapsDiagnosis
from cmm_uq.base.messages import Text, Verbatim, listed, number, say, semicolons, sentences, signed
from cmm_uq.certificate.wording import effect_title, probability

VERDICTS: Mapping[str, Text] = {
    "consistent": say("The maps agree with each other within their noise."),
    "explained": say("The maps differ from each other, and what makes them differ is found."),
    "partial": say(
        "The maps differ from each other; something that makes them differ is found, but it does not account for all."
    ),
    "unexplained": say("The maps differ from each other, and no known effect accounts for it."),
}


def difference_words(difference: Difference) -> Text:
    rival = difference.rival
    low, high = difference.region
    size = say(
        "by up to {amplitude:.2g}\u00a0{unit}, most of all from {axis} = {low} to {high}\u00a0mm",
        amplitude=difference.amplitude, unit=difference.column.unit[0], axis=Verbatim(difference.column.axis.upper()),
        low=signed(low, "g"), high=signed(high, "g"),
    )  # fmt: skip
    chance = probability(difference.probability)
    if rival.map is not None:
        told = say("{what:capital} differs from the others {size} (probability {chance}).",
                   what=rival.name, size=size, chance=chance)  # fmt: skip
    elif len(difference.column.temperatures) == 2:
        told = say("{what:capital}: {size}; which of the two is right they cannot say (probability {chance}).",
                   what=rival.name, size=size, chance=chance)  # fmt: skip
    else:
        told = say("{what:capital}, changes {size} (probability {chance}).", what=rival.name, size=size, chance=chance)
    said: list[Text] = [told]
    if difference.turned:
        said.append(say("With the sign of its figures turned it would agree."))
    if difference.instead:
        said.append(
            say("It could also be: {others}.", others=semicolons([effect_title(name) for name in difference.instead]))
        )
    return sentences(said)


def noise_words(d: MapsDiagnosis) -> list[Text]:
    found: list[Text] = []
    for what, noise in ((say("displacement"), d.displacement), (say("rotation"), d.rotation)):
        if noise is not None:
            low, high = noise.interval95
            found.append(
                say(
                    "Standard uncertainty of one reading of a {what} {value:.2g}\u00a0{unit} (95\u00a0% interval "
                    "{low:.2g} to {high:.2g}\u00a0{unit}).",
                    what=what,
                    value=noise.value,
                    unit=noise.unit,
                    low=low,
                    high=high,
                )
            )
    return found


def next_words(d: MapsDiagnosis) -> list[tuple[tuple[Text, ...], Text]]:
    found: list[tuple[tuple[Text, ...], Text]] = []
    for title in dict.fromkeys(difference.column.title for difference in d.differences):
        some = [difference for difference in d.differences if difference.column.title == title]
        names = tuple(dict.fromkeys(name for one in some for name in (one.rival.name, *one.instead)))
        temperatures = some[0].column.temperatures
        if len(temperatures) == 2:
            what = say("Map the {title} a third time: with two maps nothing says which of them is off.", title=title)
        else:
            chosen = [t for k, t in enumerate(temperatures) if any(k in one.maps for one in some)]
            shown = [number(t, "g") for t in (chosen if len(chosen) == 1 else temperatures)]
            what = say("Measure the {title} again at {temperatures} °C.", title=title, temperatures=listed(shown))
        found.append((names, what))
    return found
