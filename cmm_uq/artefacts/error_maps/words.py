"""The diagnosis of error maps in words that a service technician acts on, and in four lines."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.artefacts.error_maps.diagnosis import Difference, MapsDiagnosed, MapsDiagnosis
from cmm_uq.base.messages import (
    NOTHING,
    Text,
    Verbatim,
    lines,
    listed,
    number,
    plural,
    say,
    semicolons,
    sentences,
    signed,
)
from cmm_uq.certificate.diagnosis.overview import STANDING, gained, share_of
from cmm_uq.certificate.document import Overview
from cmm_uq.certificate.wording import effect_of, effect_title, probability, size_of

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


# a verdict as the title of its overview
VERDICT_TITLES: Mapping[str, Text] = {
    "consistent": say("Consistent: the maps agree"),
    "explained": say("Explained: what makes the maps differ is found"),
    "partial": say("Partly explained: a cause is found, and maps differ besides"),
    "unexplained": say("Unexplained: maps differ, and no known effect accounts for it"),
}

_SHOWN = 3  # differences that are told; the page has all


def overview_of(found: MapsDiagnosed) -> Overview:
    d = found.diagnosis
    rows = (
        (say("Found"), _found(d)), (say("Where"), _where(d)), (say("How sure"), _sure(d)),
        (say("What to do"), _to_do(found)),
    )  # fmt: skip
    return Overview(VERDICT_TITLES[d.verdict], STANDING[d.verdict], tuple(row for row in rows if row[1]))


def told(found: MapsDiagnosed) -> list[Text]:
    d = found.diagnosis
    said: list[Text] = [VERDICTS[d.verdict]]
    said += [say("{label}: {text}", label=label, text=text) for label, text in overview_of(found).rows]
    said += [difference_words(difference) for difference in d.differences]
    return [*said, *noise_words(d), *(what for _, what in next_words(d))]


def _found(d: MapsDiagnosis) -> Text:
    if d.verdict == "consistent":
        return say("Nothing beyond noise.")
    said: list[Text] = [
        say("{title}: {size}.", title=item.title, size=size_of(effect_of(item.effect), item.parameters, factors=False))
        for item in d.effects
    ]
    said += [_difference(difference) for difference in d.differences[:_SHOWN]]
    if (more := len(d.differences) - _SHOWN) > 0:
        said.append(plural(
            more, one=say("One more difference is told below."),
            many=say("{more} more differences are told below.", more=more),
        ))  # fmt: skip
    return lines(said)


def _difference(item: Difference) -> Text:
    return say(
        "{what:capital}: off by up to {amplitude:.2g}\u00a0{unit}.",
        what=item.rival.name, amplitude=item.amplitude, unit=item.column.unit[0],
    )  # fmt: skip


def _where(d: MapsDiagnosis) -> Text:
    places = [
        say("{what} from {axis} = {low} to {high}\u00a0mm", what=item.column.title,
            axis=Verbatim(item.column.axis.upper()), low=signed(item.region[0], "g"), high=signed(item.region[1], "g"))
        for item in d.differences[:_SHOWN]
    ]  # fmt: skip
    return say("{places:capital}.", places=semicolons(places)) if places else NOTHING


def _sure(d: MapsDiagnosis) -> Text:
    if d.verdict == "consistent":
        return say("Noise alone looks like this in {share} sets of maps.", share=share_of(d.p_value))
    said: list[Text] = [say("Noise alone looks like this in {share} sets of maps.", share=share_of(d.p_value))]
    if d.effects:
        each = semicolons(
            say("{what} {probability}", what=item.title, probability=probability(item.probability))
            for item in d.effects
        )
        said.append(say("Probability: {each}.", each=each))
        said.append(gained(d.improvement))
    return lines(said)


def _to_do(found: MapsDiagnosed) -> Text:
    d = found.diagnosis
    said: list[Text] = [
        say("{what:capital}.", what=what) for what in dict.fromkeys(item.points_to for item in d.effects)
    ]
    said += [what for _, what in next_words(d)[:_SHOWN]]
    if found.findings:
        said.append(say("See the warnings on the maps."))
    return lines(said) if said else say("Nothing on account of these maps.")
