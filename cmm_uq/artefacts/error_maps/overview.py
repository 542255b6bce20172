"""A diagnosis of error maps in four lines: what was found, where, how sure that is, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.artefacts.error_maps.analysis import MapsDiagnosed
from cmm_uq.artefacts.error_maps.diagnosis import Difference, MapsDiagnosis
from cmm_uq.artefacts.error_maps.words import VERDICTS, difference_words, next_words, noise_words
from cmm_uq.base.messages import NOTHING, Text, Verbatim, lines, plural, say, semicolons, signed
from cmm_uq.certificate.diagnosis.overview import STANDING, gained, share_of
from cmm_uq.certificate.document import Overview
from cmm_uq.certificate.wording import effect_of, probability, size_of

VERDICT_TITLES: Mapping[str, Text] = {
    "consistent": say("Consistent: the maps agree"),
    "explained": say("Explained: what makes the maps differ is found"),
    "partial": say("Partly explained: a cause is found, and maps differ besides"),
    "unexplained": say("Unexplained: maps differ, and no known effect accounts for it"),
}
"""A verdict as the title of its overview."""

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
