"""The diagnosis of error maps as a page and as results."""

from __future__ import annotations

from typing import Any

from cmm_uq import __version__
from cmm_uq.artefacts.error_maps.diagnosis import Difference, MapsDiagnosed, diagnose_error_maps
from cmm_uq.artefacts.error_maps.fit import squareness_data, squareness_sections
from cmm_uq.artefacts.error_maps.search import ColumnComparison
from cmm_uq.artefacts.error_maps.words import VERDICTS, difference_words, next_words, noise_words, overview_of, told
from cmm_uq.base.messages import Text, Verbatim, commas, day, lines, names, number, say
from cmm_uq.certificate.diagnosis.overview import held_out, summary_of, sure
from cmm_uq.certificate.document import Block, Column, Document, Facts, Paragraph, Section, Table, working_page
from cmm_uq.certificate.outcome import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.results.contents import effect_data, false_alarms, finding_data, head, improvement_data
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.certificate.sections.findings import improvement_table
from cmm_uq.certificate.wording import effect_of, probability, size_of, titles


def maps_results(found: MapsDiagnosed, seed: int) -> dict[str, Any]:
    d, noise = found.diagnosis, found.diagnosis.displacement
    squareness = squareness_data(found.maps)
    nothing = {"value": None, "u": None, "interval95": None}
    return {
        **head(found.job, effects=False),
        "sampling": {
            "sampler": None,
            "seed": seed,
            "ess_min": None,
            "rhat_max": None,
            "converged": True,
        },
        "diagnosis": {
            "verdict": d.verdict,
            "p_value": d.p_value,
            **false_alarms(d.alpha),
            "where": [_where(item) for item in d.differences],
            "effects": [effect_data(item, d.improvement) for item in d.effects],
            "indistinguishable": [],
            "suggested_measurements": [
                {"separates": list(names), "what": what, "repetitions": 1, "odds": None}
                for names, what in next_words(d)
            ],
            "noise": {
                "stated_coordinate_um": None,
                "coordinate_um": nothing if noise is None else quantity_data(noise),
                "rotation_arcsec": nothing if d.rotation is None else quantity_data(d.rotation),
                "placing_um": nothing,
                "correlated_in_time": False,
                "heavy_tails": False,
                "contradicts_stated": False,
            },
            "screening": [finding_data(finding, "") for finding in found.findings],
            "improvement": improvement_data(d.improvement),
            "compared": [_compared(compared, d.p_of(compared)) for compared in d.comparisons],
            **({"squareness_arcsec": squareness} if squareness else {}),
        },
    }


def _where(item: Difference) -> dict[str, Any]:
    return {
        "covariate": f"{item.column.axis}_mm",
        "region": list(item.region),
        "p_value": min(1.0, item.p_value),
        "amplitude_um": item.amplitude_um,
        "what": item.rival.name,
        "probability": item.probability,
        "instead": list(item.instead),
        "sign_turned": item.turned,
    }


def _compared(compared: ColumnComparison, p_value: float) -> dict[str, Any]:
    return {
        "what": compared.column.title,
        "positions": len(compared.column.positions),
        "temperatures_c": compared.column.temperatures.tolist(),
        "p_value": p_value,
        "explanations": [
            {"together": [compared.rivals[i].name for i in key], "probability": p}
            for key, p in sorted(compared.combinations.probability.items(), key=lambda item: -item[1])[:6]
        ],
    }


_PICTURES = 3


def maps_document(found: MapsDiagnosed, seed: int) -> Document:
    facts, d = found.job.facts, found.diagnosis
    maps = lines(
        say("{file}, {temperature_c:g} °C", file=Verbatim(given.file), temperature_c=given.temperature_c)
        for given in facts.machine.error_map
    )
    sections = (
        Section(say("What makes the maps differ"), _told(found)),
        Section(say("What to measure next"), tuple(Paragraph(what) for _, what in next_words(d))),
        Section(say("Before and after"), () if d.verdict == "consistent" else (_before_after(found),)),
        *squareness_sections(found.maps),
        Section(say("Noise"), tuple(Paragraph(text) for text in noise_words(d))),
        Section(say("Errors compared"), (_compared_of_page(found),)),
    )
    return working_page(
        facts,
        say("Diagnosis of error maps"),
        day(facts.job.date),
        overview=overview_of(found),
        particulars=(
            Facts(
                (
                    (say("Machine"), Verbatim(facts.machine.name)),
                    (say("p-value of “the maps differ by noise alone”"), number(d.p_value, ".2g")),
                    (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
                )
            ),
            Facts(
                (
                    (say("Error maps"), maps),
                    (say("Effects that the job names"), (commas(titles(facts.model.effects)) or say("none"))),
                )
            ),
        ),
        warnings=(say("{why:capital}.", why=f.why) for f in found.findings),
        sections=sections,
        produced_by=_produced_by(seed),
        attachments=(*names(found.job.inputs), Verbatim("results.json")),
    )


def _produced_by(seed: int) -> Text:
    program = say("cmm-uq {version}", version=Verbatim(__version__))
    return commas((program, say("seed {seed}", seed=seed)))


def _told(found: MapsDiagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    blocks: list[Block] = [Paragraph(VERDICTS[d.verdict])]
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
    unit = difference.column.unit[0]
    return curve_with_band(
        x,
        y,
        2 * u,
        x_label=say("{axis} / mm", axis=Verbatim(difference.column.axis.upper())),
        y_label=say("Difference / {unit}", unit=unit),
        caption=say("{name:capital}: the difference, with U (k = 2).", name=difference.rival.name),
        alternative=say(
            "A function with a largest value of {amplitude:.3g} {unit}.", amplitude=difference.amplitude, unit=unit
        ),
    )


def _before_after(found: MapsDiagnosed) -> Table:
    note = say(
        "A fifth of the travel at a time is predicted from the rest. Rotations count at a lever of "
        "one metre; ± is one standard error."
    )
    return improvement_table(
        found.diagnosis.improvement, say("Rms of how the maps differ"), say("Rms on held-out parts of the travel"), note
    )


def _compared_of_page(found: MapsDiagnosed) -> Table:
    d = found.diagnosis
    rows = tuple(
        (
            compared.column.title,
            number(len(compared.column.values)),
            number(len(compared.column.positions)),
            number(d.p_of(compared), ".2g"),
            *_most_probable(compared),
        )
        for compared in d.comparisons
    )
    heads = (Column(say("Error"), numeric=False), Column(say("Maps")), Column(say("Positions")), Column(say("p")),
             Column(say("Most probable explanation"), numeric=False), Column(say("Probability")))  # fmt: skip
    note = say(
        "p is corrected for having looked at all of them. Each error is a free function of position "
        "that the maps share."
    )
    return Table(say("What was compared"), heads, rows, (note,))


def _most_probable(compared: ColumnComparison) -> tuple[Text, Text]:
    shown = [_short(compared, i) for i in sorted(compared.best)]
    return ((commas(shown) or say("noise")), probability(compared.combinations.probability[compared.best]))


def _short(compared: ColumnComparison, index: int) -> Text:
    return compared.rivals[index].short


def outcome(found: MapsDiagnosed, seed: int) -> Outcome:
    verdict = found.diagnosis.verdict
    short = summary_of(found.job.facts, verdict, told(found), found.findings)
    with lettered_in(found.job.facts.job.language):
        document = maps_document(found, seed)
    consistent = verdict == "consistent"
    return Outcome(found, lambda: document, maps_results(found, seed), short, document.warnings, in_order=consistent)


OWN = OwnAnalysis(diagnose=Recipe(diagnose_error_maps, outcome))
