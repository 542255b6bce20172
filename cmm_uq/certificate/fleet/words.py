"""A fleet's figures and groups in words, as page and terminal say them."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable

import numpy as np

from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, commas, day, number, plural, say, signed
from cmm_uq.base.units import unit_as_written
from cmm_uq.laboratory.due.fleet import FleetValue, UsualRate

MOST_SERIALS = 12
"""Machines in a line."""


def counted(count: int) -> Text:
    """So many machines."""
    return plural(count, one=say("one machine"), many=say("{count} machines", count=count))


def serials(machines: Iterable[str]) -> Text:
    """Machines by name, the first of very many; nothing of none."""
    named = sorted(set(machines))
    shown = commas([Verbatim(each) for each in named[:MOST_SERIALS]])
    left = len(named) - MOST_SERIALS
    return say("{shown} and {count} more", shown=shown, count=left) if left > 0 else shown if named else NOTHING


def date_of(ordinal: float) -> Text:
    """A day."""
    return day(dt.date.fromordinal(int(ordinal)))


def called(of: FleetValue) -> Text:
    """A value, with its name in the records."""
    return say("{quantity} ({name})", quantity=Verbatim(of.quantity), name=Verbatim(of.name))


def group_words(each: UsualRate) -> Text:
    """What a group of machines is called."""
    if each.kind == "fleet":
        return say("Average machine")
    name = Verbatim(each.name) if each.name else say("not stated")
    return say("Model {name}", name=name) if each.kind == "model" else say("Place {name}", name=name)


def per_year(of: FleetValue) -> Text:
    """Unit of rates."""
    return say("{unit}/year", unit=unit_as_written(of.unit) or Verbatim("1"))


def digits(of: FleetValue) -> str:
    """Format of rates: two digits of the usual standard uncertainty of a machine's."""
    u = float(np.median(of.fleet.estimates.u_rate))
    return f".{int(np.clip(1 - np.floor(np.log10(u)), 0, 9))}f" if u > 0 else ".3g"


def signed_rate(rate: float, spec: str) -> Number:
    """Without a sign where nothing is left of it."""
    text = format(rate, spec)
    return number(0.0, spec) if float(text) == 0 else signed(rate, spec)


def rate_words(rate: float, U: float, of: FleetValue) -> Text:
    """A rate, its expanded uncertainty and unit."""
    spec = digits(of)
    return say("{rate} ± {U} {unit}", rate=signed_rate(rate, spec), U=number(U, spec), unit=per_year(of))


def usual_rate(of: FleetValue) -> Text:
    """Of the average machine."""
    average = of.fleet.usual[0]
    return rate_words(average.rate, 1.96 * average.u, of)
