"""The interval by the drift model: until the probability that an error has crossed its limit is no longer small enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.laboratory.due.crossing import crossing
from cmm_uq.laboratory.due.drift_prior import Prior
from cmm_uq.laboratory.due.observed import calibrations, is_of_machine
from cmm_uq.laboratory.records import Certificate, Series


def series_from(certificates: Sequence[Certificate], name: str) -> Series:
    """One value over certificates of one machine, by day, as the records give it.

    Parameters
    ----------
    certificates : with their values; those without this one are left out.
    name : of the value.
    """
    rows = [(one, value) for one in certificates for value in one.values if value.name == name]
    last = rows[-1][1]
    limits = [value.limit for _, value in rows if value.limit is not None]
    since = (one.adjusted_since for one, _ in rows)
    return Series(
        name, last.quantity, last.unit, limits[-1] if limits else None,
        np.array([one.day.toordinal() for one, _ in rows]), np.array([value.value for _, value in rows]),
        np.array([value.u for _, value in rows]), np.array([value.u_artefact for _, value in rows]),
        np.array([one.artefact for one, _ in rows]), np.array([one.entry for one, _ in rows]),
        np.array([0 if day is None else day.toordinal() for day in since]), np.array([one.interim for one, _ in rows]),
    )  # fmt: skip


def drift_interval(
    certificates: Sequence[Certificate], reliability: float, priors: Mapping[str, Prior]
) -> tuple[float, str, bool]:
    """Days after the last calibration until the first of the errors may have crossed its limit, and which one it is.

    Parameters
    ----------
    certificates : of the machine, by day, interim checks too: the model takes all that was seen, as its history does.
    reliability : probability with which no single error has crossed yet.
    priors : of the machine's fleet, by the value's name; the default one where there is none.

    Returns
    -------
    days, infinite beyond the model's horizon, the quantity's name, and whether its prior is a fleet's.

    Raises
    ------
    CmmUqError : no value has a limit, or none of them a history that the model takes.
    """
    last = calibrations(certificates)[-1]
    stated = (series_from(certificates, one.name) for one in last.values if is_of_machine(one.unit))
    limited = [(one, one.limit) for one in stated if one.limit]
    if not limited:
        raise CmmUqError(say("its certificate has no limits"))
    found: list[tuple[float, str, bool]] = []
    refused: CmmUqError | None = None
    for one, limit in limited:
        try:
            crossed = crossing(one, limit, priors.get(one.name)).quantile(1 - reliability)
        except CmmUqError as error:
            refused = error
            continue
        days = float("inf") if crossed is None else float((crossed - last.day).days)
        found.append((days, one.quantity, one.name in priors))
    if not found:
        raise refused or CmmUqError(say("nothing in its history can be followed"))
    return min(found)
