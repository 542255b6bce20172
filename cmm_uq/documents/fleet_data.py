"""A fleet for other programs: ``fleet.json``, whose ``prior`` is all that is needed to judge a further machine by it."""

from __future__ import annotations

from typing import Any

from cmm_uq import __version__
from cmm_uq.recertification.fleet_found import FleetFound, OfValue

SCHEMA = "cmm-uq/fleet/1"


def fleet_data(found: FleetFound) -> dict[str, Any]:
    """All that was found, rates per year in the unit of the value."""
    return {
        "schema": SCHEMA, "software": {"name": "cmm-uq", "version": __version__}, "seed": found.seed,
        "values": [_value(each) for each in found.values],
    }  # fmt: skip


def _value(of: OfValue) -> dict[str, Any]:
    fleet, chains = of.fleet, of.fleet.chains
    return {
        "name": of.name, "quantity": of.quantity, "unit": of.unit, "machines": _machines(of),
        "certificates_left_out": of.left_out,
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


def _machines(of: OfValue) -> list[dict[str, Any]]:
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
