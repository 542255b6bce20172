"""The diagnosis of error maps in words that a service technician acts on, in four lines, as a page and as results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq import __version__
from cmm_uq.artefacts.error_maps import diagnosis
from cmm_uq.artefacts.error_maps.comparison import ColumnComparison
from cmm_uq.artefacts.error_maps.diagnosis import Difference, MapsDiagnosed, MapsDiagnosis
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, plural, say, semicolons, sentences, signed
from cmm_uq.certificate import document as parts
from cmm_uq.certificate.diagnosis.overview import STANDING, gained, held_out, share_of, summary_of, sure
from cmm_uq.certificate.diagnosis.page import improvement_table
from cmm_uq.certificate.document import Block, Column, Document, Facts, Overview, Paragraph, Section, Table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.results.contents import effect_data, false_alarms, finding_data, head, improvement_data
from cmm_uq.certificate.wording import effect_of, effect_title, probability, size_of, titles

# a verdict as the title of its overview, and in a sentence
VERDICTS: Mapping[str, tuple[Text, Text]] = {
    "consistent": (say("Consistent: the maps agree"), say("The maps agree with each other within their noise.")),
    "explained": (
        say("Explained: what makes the maps differ is found"),
        say("The maps differ from each other, and what makes them differ is found."),
    ),
    "partial": (
        say("Partly explained: a cause is found, and maps differ besides"),
        say("The maps differ from each other; something that makes them differ is found, but it does not account for all."),
    ),
    "unexplained": (
        say("Unexplained: maps differ, and no known effect accounts for it"),
        say("The maps differ from each other, and no known effect accounts for it."),
    ),
}  # fmt: skip


def difference_words(difference: Difference) -> Text:
    rival, column = difference.rival, difference.column
    low, high = (signed(end, "g") for end in difference.region)
    size = say(
        "by up to {amplitude:.2g}\u00a0{unit}, most of all from {axis} = {low} to {high}\u00a0mm",
        amplitude=difference.amplitude, unit=column.unit[0], axis=Verbatim(column.axis.upper()), low=low, high=high,
    )  # fmt: skip
    what, chance = rival.name, probability(difference.probability)
    if rival.map is not None:
        text = say(
            "{what:capital} differs from the others {size} (probability {chance}).", what=what, size=size, chance=chance
        )
    elif len(column.temperatures) == 2:
        text = say("{what:capital}: {size}; which of the two is right they cannot say (probability {chance}).",
                   what=what, size=size, chance=chance)  # fmt: skip
    else:
        text = say("{what:capital}, changes {size} (probability {chance}).", what=what, size=size, chance=chance)
    more = [say("With the sign of its figures turned it would agree.")] if difference.turned else []
    if difference.instead:
        others = semicolons([effect_title(name) for name in difference.instead])
        more.append(say("It could also be: {others}.", others=others))
    return sentences([text, *more])


def noise_words(d: MapsDiagnosis) -> list[Text]:
    return [
        say(
            "Standard uncertainty of one reading of a {what} {value:.2g}\u00a0{unit} (95\u00a0% interval "
            "{low:.2g} to {high:.2g}\u00a0{unit}).",
            what=what, value=noise.value, unit=noise.unit, low=noise.interval95[0], high=noise.interval95[1],
        )
        for what, noise in ((say("displacement"), d.displacement), (say("rotation"), d.rotation))
        if noise is not None
    ]  # fmt: skip


def next_words(d: MapsDiagnosis) -> list[tuple[tuple[Text, ...], Text]]:
    found: list[tuple[tuple[Text, ...], Text]] = []
    for title in dict.fromkeys(difference.column.title for difference in d.differences):
        some = [difference for difference in d.differences if difference.column.title == title]
        names = tuple(dict.fromkeys(name for one in some for name in (one.rival.name, *one.instead)))
        temperatures = some[0].column.temperatures
        what = say("Map the {title} a third time: with two maps nothing says which of them is off.", title=title)
        if len(temperatures) != 2:
            chosen = [t for k, t in enumerate(temperatures) if any(k in one.maps for one in some)]
            shown = messages.listed([number(t, "g") for t in (chosen if len(chosen) == 1 else temperatures)])
            what = say("Measure the {title} again at {temperatures} °C.", title=title, temperatures=shown)
        found.append((names, what))
    return found


_SHOWN = 3  # differences that are told; the page has all


def overview_of(found: MapsDiagnosed) -> Overview:
    d = found.diagnosis
    rows = (
        (say("Found"), _found(d)), (say("Where"), _where(d)), (say("How sure"), _sure(d)),
        (say("What to do"), _to_do(found)),
    )  # fmt: skip
    return Overview(VERDICTS[d.verdict][0], STANDING[d.verdict], tuple(row for row in rows if row[1]))


def told(found: MapsDiagnosed) -> list[Text]:
    d = found.diagnosis
    said: list[Text] = [VERDICTS[d.verdict][1]]
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
    said += [
        say("{what:capital}: off by up to {amplitude:.2g}\u00a0{unit}.",
            what=item.rival.name, amplitude=item.amplitude, unit=item.column.unit[0])
        for item in d.differences[:_SHOWN]
    ]  # fmt: skip
    if (more := len(d.differences) - _SHOWN) > 0:
        one = say("One more difference is told below.")
        many = say("{more} more differences are told below.", more=more)
        said.append(plural(more, one=one, many=many))
    return messages.lines(said)


def _where(d: MapsDiagnosis) -> Text:
    places = [
        say("{what} from {axis} = {low} to {high}\u00a0mm", what=item.column.title,
            axis=Verbatim(item.column.axis.upper()), low=signed(item.region[0], "g"), high=signed(item.region[1], "g"))
        for item in d.differences[:_SHOWN]
    ]  # fmt: skip
    return say("{places:capital}.", places=semicolons(places)) if places else NOTHING


def _sure(d: MapsDiagnosis) -> Text:
    said: list[Text] = [say("Noise alone looks like this in {share} sets of maps.", share=share_of(d.p_value))]
    each = [say("{what} {probability}", what=one.title, probability=probability(one.probability)) for one in d.effects]
    if each:
        said += [say("Probability: {each}.", each=semicolons(each)), gained(d.improvement)]
    return messages.lines(said)


def _to_do(found: MapsDiagnosed) -> Text:
    d = found.diagnosis
    said: list[Text] = [
        say("{what:capital}.", what=each) for each in dict.fromkeys(item.points_to for item in d.effects)
    ]
    said += [what for _, what in next_words(d)[:_SHOWN]]
    said += [say("See the warnings on the maps.")] if found.findings else []
    return messages.lines(said) if said else say("Nothing on account of these maps.")


def maps_results(found: MapsDiagnosed, seed: int) -> dict[str, Any]:
    d, noise = found.diagnosis, found.diagnosis.displacement
    squareness = diagnosis.squareness_data(found.maps)
    nothing = {"value": None, "u": None, "interval95": None}
    return {
        **head(found.job, effects=False),
        "sampling": {"sampler": None, "seed": seed, "ess_min": None, "rhat_max": None, "converged": True},
        "diagnosis": {
            "verdict": d.verdict, "p_value": d.p_value, **false_alarms(d.alpha),
            "where": [
                {
                    "covariate": f"{item.column.axis}_mm", "region": list(item.region), "p_value": min(1.0, item.p_value),
                    "amplitude_um": item.amplitude_um, "what": item.rival.name, "probability": item.probability,
                    "instead": list(item.instead), "sign_turned": item.turned,
                }
                for item in d.differences
            ],
            "effects": [effect_data(item, d.improvement) for item in d.effects],
            "indistinguishable": [],
            "suggested_measurements": [
                {"separates": list(names), "what": what, "repetitions": 1, "odds": None}
                for names, what in next_words(d)
            ],
            "noise": {
                "stated_coordinate_um": None, "coordinate_um": nothing if noise is None else quantity_data(noise),
                "rotation_arcsec": nothing if d.rotation is None else quantity_data(d.rotation), "placing_um": nothing,
                "correlated_in_time": False, "heavy_tails": False, "contradicts_stated": False,
            },
            "screening": [finding_data(finding, "") for finding in found.findings],
            "improvement": improvement_data(d.improvement),
            "compared": [_compared(compared, d.p_of(compared)) for compared in d.comparisons],
            **({"squareness_arcsec": squareness} if squareness else {}),
        },
    }  # fmt: skip


def _compared(compared: ColumnComparison, p_value: float) -> dict[str, Any]:
    column, ordered = compared.column, sorted(compared.combinations.probability.items(), key=lambda item: -item[1])
    return {
        "what": column.title, "positions": len(column.positions), "temperatures_c": column.temperatures.tolist(),
        "p_value": p_value,
        "explanations": [
            {"together": [compared.rivals[i].name for i in key], "probability": p} for key, p in ordered[:6]
        ],
    }  # fmt: skip


_PICTURES = 3


def maps_document(found: MapsDiagnosed, seed: int) -> Document:
    facts, d = found.job.facts, found.diagnosis
    maps = messages.lines(
        say("{file}, {temperature_c:g} °C", file=Verbatim(given.file), temperature_c=given.temperature_c)
        for given in facts.machine.error_map
    )
    note = say(
        "A fifth of the travel at a time is predicted from the rest. Rotations count at a lever of "
        "one metre; ± is one standard error."
    )
    rms = say("Rms of how the maps differ"), say("Rms on held-out parts of the travel")
    sections = (
        Section(say("What makes the maps differ"), _told(found)),
        parts.section(say("What to measure next"), *(Paragraph(what) for _, what in next_words(d))),
        parts.section(
            say("Before and after"), None if d.verdict == "consistent" else improvement_table(d.improvement, *rms, note)
        ),
        *diagnosis.squareness_sections(found.maps),
        parts.section(say("Noise"), *(Paragraph(text) for text in noise_words(d))),
        parts.section(say("Errors compared"), _compared_of_page(found)),
    )
    tested = (
        (say("Machine"), Verbatim(facts.machine.name)),
        (say("p-value of “the maps differ by noise alone”"), number(d.p_value, ".2g")),
        (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
    )
    named = messages.commas(titles(facts.model.effects)) or say("none")
    program = say("cmm-uq {version}", version=Verbatim(__version__))
    return parts.working_page(
        facts, say("Diagnosis of error maps"), messages.day(facts.job.date), overview=overview_of(found),
        particulars=(Facts(tested), Facts(((say("Error maps"), maps), (say("Effects that the job names"), named)))),
        warnings=(say("{why:capital}.", why=f.why) for f in found.findings),
        sections=sections, produced_by=messages.commas((program, say("seed {seed}", seed=seed))),
        attachments=(*messages.names(found.job.inputs), Verbatim("results.json")),
    )  # fmt: skip


def _told(found: MapsDiagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    blocks: list[Block] = [Paragraph(VERDICTS[d.verdict][1])]
    blocks += [
        Facts((
            (say("Effect"), item.title),
            (say("Size"), say("{size:capital}.", size=size_of(effect_of(item.effect), item.parameters))),
            (say("Look at"), say("{what:capital}.", what=item.points_to)),
            (say("How sure"), say("{sure:capital}.", sure=sure(item))),
        ))
        for item in d.effects
    ]  # fmt: skip
    if d.effects:
        blocks.append(Paragraph(say("{gain:capital}.", gain=held_out(d.improvement))))
    for i, difference in enumerate(d.differences):
        blocks.append(Paragraph(difference_words(difference)))
        if i < _PICTURES:
            blocks.append(_picture(difference))
    return tuple(blocks)


def _picture(difference: Difference) -> Block:
    x, y, u = difference.curve
    unit, size = difference.column.unit[0], difference.amplitude
    return curve_with_band(
        x, y, 2 * u, x_label=say("{axis} / mm", axis=Verbatim(difference.column.axis.upper())),
        y_label=say("Difference / {unit}", unit=unit),
        caption=say("{name:capital}: the difference, with U (k = 2).", name=difference.rival.name),
        alternative=say("A function with a largest value of {amplitude:.3g} {unit}.", amplitude=size, unit=unit),
    )  # fmt: skip


def _compared_of_page(found: MapsDiagnosed) -> Table | None:
    d, rows = found.diagnosis, []
    for one in d.comparisons:
        counts = number(len(one.column.values)), number(len(one.column.positions))
        short = messages.commas([one.rivals[i].short for i in sorted(one.best)]) or say("noise")
        chance = probability(one.combinations.probability[one.best])
        rows.append((one.column.title, *counts, number(d.p_of(one), ".2g"), short, chance))
    figures = parts.figure_columns(say("Maps"), say("Positions"), say("p"))
    best = say("Most probable explanation")
    note = say(
        "p is corrected for having looked at all of them. Each error is a free function of position that the maps share."
    )
    return parts.table(say("What was compared"), [say("Error"), *figures, best, Column(say("Probability"))], rows, note)


def outcome(found: MapsDiagnosed, seed: int) -> Outcome:
    verdict = found.diagnosis.verdict
    short = summary_of(found.job.facts, verdict, told(found), found.findings)
    with lettered_in(found.job.facts.job.language):
        document = maps_document(found, seed)
    consistent = verdict == "consistent"
    return Outcome(found, lambda: document, maps_results(found, seed), short, document.warnings, in_order=consistent)


OWN = OwnAnalysis(diagnose=Recipe(diagnosis.diagnose_error_maps, outcome))
