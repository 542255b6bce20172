"""Quantities as a certificate states them: a table of value, U, k and unit, and the sentences that such a table needs."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.document import Column, Table
from cmm_uq.certificate.wording import expanded
from cmm_uq.maths.uncertainty.quantity import Quantity

SIGN = say("Sign rule: true coordinate = indicated coordinate + error.")

UNCERTAINTY = say(
    "U is the expanded uncertainty for a coverage probability of 95 %, from the 95 % coverage interval of the posterior "
    "distribution; k = U/u is its ratio to the standard uncertainty u."
)


def stated_table(
    caption: Text,
    named: Iterable[tuple[Text, Quantity]],
    notes: tuple[Text, ...] = (),
    *,
    what: Text = say("Quantity"),
    value: Text = say("Value"),
) -> Table:
    """A row for each quantity.

    Parameters
    ----------
    named : each quantity with its name.
    what, value : headings of the names and of the values.
    """
    columns = (
        Column(what, numeric=False), Column(value), Column(say("U")), Column(say("k")), Column(say("Unit"), numeric=False),
    )  # fmt: skip
    return Table(caption, columns, tuple((name, *expanded(one), one.unit) for name, one in named), notes)
