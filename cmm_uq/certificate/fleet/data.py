"""A fleet for other programs: ``fleet.json``, whose ``prior`` is all that is needed to judge a further machine by it.

``fleet.csv`` has its machines alone, for a spreadsheet.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from cmm_uq import __version__
from cmm_uq.base.files.cells import FORMULA
from cmm_uq.laboratory.due.fleet import FleetResult, FleetValue

SCHEMA = "cmm-uq/fleet/1"


def fleet_data(found: FleetResult) -> dict[str, Any]:
    """All that was found, rates per year in the unit of the value."""
    return {
        "schema": SCHEMA, "software": {"name": "cmm-uq", "version": __version__}, "seed": found.seed,
        "values": [_value(each) for each in found.values],
    }  # fmt: skip


def _value(of: FleetValue) -> dict[str, Any]:
    fleet, chains = of.fleet, of.fleet.chains
    return {
        "name": of.name, "quantity": of.quantity, "unit": of.unit, "machines": _machines(of),
        "certificates_left_out": of.left_out, "compared": of.compared,
        "usual": [
            {"kind": each.kind, "name": each.name, "machines": each.machines, "rate": each.rate, "u": each.u,
             "lower": each.lower, "upper": each.upper}
            for each in fleet.usual
        ],
        "spreads": [
            {"name": each.name, "median": each.median, "lower": each.lower, "upper": each.upper} for each in fleet.spreads
        ],
        "convergence": {
            "converged": chains.converged, "rhat_max": chains.rhat_max, "ess_min": chains.ess_min, "steps": chains.steps,
            "sampler": chains.sampler, "machines": fleet.learnt_from,
        },
        "prior": fleet.data(),
    }  # fmt: skip


def _machines(of: FleetValue) -> list[dict[str, Any]]:
    e = of.fleet.estimates
    return [
        {
            "machine": member.machine, "model": member.model, "place": member.place,
            "certificates": len(member.history.day), "rate": float(e.rate[i]), "u": float(e.u_rate[i]),
            "expected": float(e.expected[i]), "u_expected": float(e.u_expected[i]), "p": float(e.p[i]),
            "belongs": bool(of.belongs[i]), "limit": member.limit,
            "crossing": None if e.crossing is None or member.limit is None else e.crossing.one(i).data(),
        }
        for i, member in enumerate(of.members)
    ]  # fmt: skip


def fleet_csv(data: Mapping[str, Any]) -> bytes:
    """A row a machine and value, of what :func:`fleet_data` gave; rates per year in the unit of the row.

    A name that a spreadsheet would compute has an apostrophe before it, as a spreadsheet marks text.
    """
    rows = [
        {"value": of["name"], "quantity": of["quantity"], "unit": of["unit"], **one} | (one["crossing"] or {})
        for of in data["values"]
        for one in of["machines"]
    ]
    text = io.StringIO()
    columns = [*(name for name in rows[0] if name not in ("crossing", *_CROSSING)), *_CROSSING]
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(cell) for name, cell in row.items()} for row in rows)
    return text.getvalue().encode()


_CROSSING = ("last", "day_5", "day_50", "day_95", "already", "within_a_year")


def _cell(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
