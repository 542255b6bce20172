"""Further certificates of a machine, whose recordings are taken together with that of its calibration."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, listed, names, number, say
from cmm_uq.certificate.document import Table, table


@dataclass(frozen=True)
class FurtherCertificate:
    """Another certificate of the machine, whose recording is taken together with that of its calibration."""

    file: str
    number: str
    laboratory: str
    artefact: str
    date: dt.date
    verdict: str  # of the verification
    corrected: bool  # whether the machine then corrected what its calibration found
    origin: str  # of the recording
    observations: int = 0  # that are reckoned with
    chance: float = 1.0  # of a recording that contradicts the machine as much, as its other certificates have it
    used: bool = True


@dataclass(frozen=True)
class FurtherCertificates:
    """All of them, and what the reader must know."""

    each: tuple[FurtherCertificate, ...] = ()
    warnings: tuple[Text, ...] = ()

    @property
    def used(self) -> tuple[FurtherCertificate, ...]:
        return tuple(one for one in self.each if one.used)

    @property
    def together(self) -> Text:
        """Which of them are taken together with the recording of the calibration, in a sentence."""
        numbers = listed(names(one.number for one in self.used))
        return (
            say("The recordings of {certificates} are taken together with it.", certificates=numbers)
            if numbers
            else NOTHING
        )


NO_FURTHER = FurtherCertificates()


def further_table(certificates: Sequence[FurtherCertificate]) -> Table | None:
    heads = [say("Certificate"), say("Issued by"), say("Artefact"), say("Calibrated on"), say("Machine")]
    figures = [say("Observations"), say("Chance of as much contradiction"), say("Reckoned with")]
    rows = []
    for one in certificates:
        seen = say("corrected") if one.corrected else say("not corrected")
        named = (Verbatim(one.number), Verbatim(one.laboratory), Verbatim(one.artefact), day(one.date), seen)
        used = say("yes") if one.used else say("no")
        rows.append((*named, number(one.observations), number(one.chance, ".2g"), used))
    return table(say("Further certificates of the machine"), [*heads, *figures], rows)


def further_data(certificates: Sequence[FurtherCertificate]) -> dict[str, Any]:
    """Of results.json: ``further``, nothing where there is none."""
    told = [asdict(one) | {"date": one.date.isoformat()} for one in certificates]
    return {"further": told} if told else {}
