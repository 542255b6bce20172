"""The squareness of the axes in each map, side by side: one figure a map, so that there is no noise to test it against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.base.messages import Text, Verbatim, commas, number, say, signed
from cmm_uq.base.units import ARCSECOND
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.machine.physics.error_map import ErrorMap


def squareness_data(maps: Sequence[ErrorMap]) -> list[dict[str, float]]:
    """Of each map for ``results.json``, ″; empty where no map states any."""
    if not _stated(maps):
        return []
    return [{"temperature_c": m.temperature, **m.squareness_arcsec} for m in _by_temperature(maps)]


def squareness_findings(maps: Sequence[ErrorMap]) -> list[Finding]:
    """Maps with all three figures the same: they were measured once."""
    if not _stated(maps):
        return []
    same: dict[tuple[float, ...], list[float]] = {}
    for m in _by_temperature(maps):
        same.setdefault(tuple(m.squareness.tolist()), []).append(m.temperature)
    return [
        Finding(
            "copied",
            (),
            (),
            say(
                "squareness: the maps at {temperatures} °C give the same figures. They were measured once, and say "
                "nothing of how it changes; measure it at each temperature",
                temperatures=commas(number(t, "g") for t in temperatures),
            ),
        )
        for temperatures in same.values()
        if len(temperatures) > 1
    ]


def squareness_sections(maps: Sequence[ErrorMap]) -> tuple[Section, ...]:
    """The figures as a section of the page; none where no map states any."""
    if not _stated(maps):
        return ()
    ordered = _by_temperature(maps)
    figures = np.array([m.squareness for m in ordered]) / ARCSECOND
    rows: list[tuple[Text, ...]] = [
        (say("{temperature:g}\u00a0°C", temperature=m.temperature), *(signed(value, ".5g") for value in row))
        for m, row in zip(ordered, figures, strict=True)
    ]
    rows.append((say("Largest less smallest"), *(number(value, ".5g") for value in np.ptp(figures, axis=0))))
    heads = (
        Column(say("Map"), numeric=False),
        *(Column(say("{pair} / ″", pair=Verbatim(pair))) for pair in ("XY", "YZ", "ZX")),
    )
    note = say(
        "There is one figure a map, without an uncertainty: whether they differ is not tested. One "
        "arc second moves a point by 2.4 µm over 500 mm."
    )
    return (Section(say("Squareness of the axes"), (Table(say("Squareness"), heads, tuple(rows), (note,)),)),)


def _stated(maps: Sequence[ErrorMap]) -> bool:
    return any(m.squareness.any() for m in maps)


def _by_temperature(maps: Sequence[ErrorMap]) -> list[ErrorMap]:
    return sorted(maps, key=lambda m: m.temperature)
