"""A fleet as a document: all its values in one table, then each by itself."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.base.messages import Text, Verbatim, number, plural, say
from cmm_uq.certificate.document import Block, Document, Paragraph, Section
from cmm_uq.certificate.fleet.plot import fleet_plot
from cmm_uq.certificate.fleet.summary import fleet_overview, fleet_warnings, machines_of
from cmm_uq.certificate.fleet.tables import all_values, groups_shown, outsiders, soonest, spreads_table, usual_table
from cmm_uq.certificate.fleet.words import called, counted, date_of, group_words, per_year, usual_rate
from cmm_uq.laboratory.due.fleet import FleetResult, FleetValue


def fleet_document(found: FleetResult) -> Document:
    """The page of a fleet, as of its newest certificate."""
    return Document(
        title=say("Drift of a fleet"),
        number=date_of(found.newest),
        subject=say(
            "{machines}, {values}",
            machines=counted(len(machines_of(found))),
            values=plural(len(found.values), one=say("one value"), many=say("{count} values", count=len(found.values))),
        ),
        issuer=(),
        particulars=(),
        warnings=fleet_warnings(found),
        sections=(
            Section(say("All values"), (all_values(found),)),
            *(Section(called(of), _blocks(of)) for of in found.values),
        ),
        statements=(),
        signatures=(),
        attachments=(Verbatim("fleet.json"), Verbatim("fleet.csv")),
        produced_by=say("cmm-uq {version}, seed {seed}", version=Verbatim(__version__), seed=found.seed),
        end=say("End of page"),
        overview=fleet_overview(found),
    )


def _blocks(of: FleetValue) -> tuple[Block, ...]:
    shown = groups_shown(of)
    picture = fleet_plot(
        shown, [group_words(each) for each in shown], axis=say("Rate in {unit}, with 95 % interval", unit=per_year(of)),
        caption=say("Usual drift of models and places."),
        alternative=say("Average machine: {rate}.", rate=usual_rate(of)),
    )  # fmt: skip
    return (
        usual_table(of),
        picture,
        outsiders(of),
        soonest(of),
        spreads_table(of),
        Paragraph(_sampled(of), tone="note"),
    )


def _sampled(of: FleetValue) -> Text:
    chains = of.fleet.chains
    return say(
        "Hyper-parameters sampled by {sampler} from {machines}: R-hat at most {rhat}, at least {ess} effective samples, "
        "{steps} steps.", sampler=Verbatim(chains.sampler), machines=counted(of.fleet.learnt_from),
        rhat=number(chains.rhat_max, ".3f"), ess=number(chains.ess_min, ".0f"), steps=chains.steps,
    )  # fmt: skip
