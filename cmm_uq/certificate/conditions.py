"""The conditions under which a result was found (ISO/IEC 17025:2017, 7.8.4.1 b): as the job states them, and as recorded."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.base.messages import Text, Verbatim, commas, say, signed
from cmm_uq.base.points import Points
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Facts
from cmm_uq.jobs.job import Job

TEMPERATURES: Mapping[str, Text] = {
    "temp_artefact_c": say("artefact"), "temp_x_c": say("scale of X"), "temp_y_c": say("scale of Y"),
    "temp_z_c": say("scale of Z"), "temp_air_c": say("air"), "temp_table_top_c": say("table, top"),
    "temp_table_bottom_c": say("table, bottom"),
}  # fmt: skip


def conditions(job: Job) -> Facts:
    """As stated, and the least and largest recorded temperatures; without rows where there are none."""
    rows: list[tuple[Text, Text]] = []
    if job.facts.job.conditions:
        rows.append((say("Conditions"), Verbatim(job.facts.job.conditions)))
    if recorded := _recorded(job.points):
        rows.append((say("Temperatures recorded"), recorded))
    return Facts(tuple(rows))


def _recorded(points: Points) -> Text:
    return commas(
        say("{what} {low} to {high} {unit}", what=what, low=signed(float(points.columns[name].min()), ".2f"),
            high=signed(float(points.columns[name].max()), ".2f"), unit=unit("°C"))
        for name, what in TEMPERATURES.items() if name in points.columns
    )  # fmt: skip
