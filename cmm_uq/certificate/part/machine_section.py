"""The machine that measured a part: its certificate, how it was verified, and how its errors are drawn."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, names, number, plural, say
from cmm_uq.certificate.document import Facts, Paragraph, Section
from cmm_uq.certificate.part.found import PartFound, Source, Standing

_SOURCES: Mapping[Source, Text] = {
    "certificate": say("its certificate, with the recording of the calibration inside"),
    "results": say("the figures and draws of its certificate, without the recording of the calibration"),
    "job": say("the job of its calibration, analysed anew; no certificate is verified"),
}


def machine_section(found: PartFound) -> Section:
    """What states the machine, and what of it was verified."""
    standing = found.standing
    rows = (
        (say("Taken from"), _SOURCES[standing.source]),
        *certificate_rows(standing),
        (say("Files"), commas(names(standing.files))),
        (say("Verified"), verified_words(standing)),
        (say("Signatures"), say("by trusted certificates") if standing.trusted else say("not asked for")),
        (say("Temperature of the scales at the calibration"), _celsius(standing.temperature_c)),
        (say("Noise of a coordinate"), _noise(found)),
    )
    told = (standing.path, standing.drift)
    return Section(
        say("The machine and its certificate"),
        (Facts(tuple(row for row in rows if row[1])), *(Paragraph(text) for text in told if text)),
    )


def certificate_rows(standing: Standing) -> tuple[tuple[Text, Text], ...]:
    """Machine, number, issuer, date with its age, validity of the certificate."""
    serial = say("serial number {serial}", serial=Verbatim(standing.serial)) if standing.serial else NOTHING
    number_of = (
        say("{number}, a draft", number=Verbatim(standing.number)) if standing.draft else Verbatim(standing.number)
    )
    return (
        (say("Machine"), commas(text for text in (Verbatim(standing.machine), serial) if text)),
        (say("Certificate of the machine"), number_of),
        (say("Issued by"), Verbatim(standing.laboratory)),
        (say("Calibrated on"), _calibrated(standing)),
        (say("Valid until"), day(standing.valid_until) if standing.valid_until else NOTHING),
    )


def _calibrated(standing: Standing) -> Text:
    days, date = standing.age.days, day(standing.date)
    if not days:
        return say("{date}, the day of the measurement", date=date)
    age = plural(days, one=say("one day"), many=say("{count} days", count=days))
    return say("{date}, {age} before", date=date, age=age)


def verified_words(standing: Standing) -> Text:
    """What was compared and what was not."""
    done = [one for one in standing.checked if one.count]
    if not done:
        return say("no: analysed anew") if standing.source == "job" else say("no")
    told = say(
        "{count} comparisons of {sorts} sorts between its documents, figures, decisions and inputs, none of which failed",
        count=sum(one.count for one in done), sorts=len(done),
    )  # fmt: skip
    again = say("computed again from its inputs") if standing.again else say("not computed again")
    return say("{told}; {again}", told=told, again=again)


def _celsius(value: float | None) -> Text:
    return NOTHING if value is None else say("{value} °C", value=number(value, ".2f"))


def _noise(found: PartFound) -> Text:
    usual = found.given.machine.noise.usual_mm * 1e3
    if not usual.any():
        return NOTHING
    return say("{x}, {y}, {z} µm along x, y, z", x=number(usual[0], ".2g"), y=number(usual[1], ".2g"),
               z=number(usual[2], ".2g"))  # fmt: skip
