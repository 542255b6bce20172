"""``[machine_state]`` of a part's job: what states the machine's errors, and what is stated of them besides."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Position, Triple, Uncertainty, key, required
from cmm_uq.jobs.part.feature import Name
from cmm_uq.jobs.tables.length_formula import Permissible
from cmm_uq.jobs.tables.machine import AxesFacts, FurtherList, Travel
from cmm_uq.jobs.tables.rotary_axes import check_carriages

Readings = Annotated[list[Position], Field(min_length=6, max_length=6)]


class BoundFacts(JobTable):
    """One ``[[machine_state.bound]]``: what a datasheet or certificate says that errors of the machine do not exceed."""

    errors: Annotated[list[Name], Field(min_length=1)] = required("Effects that it is of.")
    largest_um: Annotated[float, Field(gt=0, le=1000)] = required(
        "What 95 of 100 do not exceed: the gap of play, the amplitude of a periodic error."
    )
    source: Name = required("Where that is stated, for the report: datasheet or certificate, with its date.")


class PassedFacts(JobTable):
    """One ``[[machine_state.passed]]``: a test of lengths that the machine passed, whose readings nobody has."""

    mpe: Permissible = required(
        'What no length erred by more than: `mpe = "2.5 + L/300"`, L in mm and the error in µm.'
    )
    certificate: Name = required(
        "Who states that it passed: the certificate of the test, or its report, with its number."
    )
    date: dt.date = required("Day of the test.")
    u_um: Uncertainty = required("Standard uncertainty of the test value of a length.")
    u_um_per_m: Uncertainty = key(0.0, "What it grows by with the length, in a metre.")
    readings_mm: Annotated[list[Readings], Field(max_length=105)] = []
    """Scale readings x, y, z at either end of each length tested. Where left out those that ISO 10360-2 prescribes: five on
    each of four space diagonals and three lines along the axes through the middle of the travel, up to 66 % of it."""
    repeats: Annotated[int, Field(ge=1, le=100)] = key(3, "How often each length was measured.")
    bidirectional: bool = True
    """Whether both ends were reached from outside, or both from inside, so that the play of the drives is in the length."""
    corrected: bool = False
    """Whether the machine corrected what its calibration found when it was tested."""

    def problems(self) -> Iterator[str]:
        if any(one[:3] == one[3:] for one in self.readings_mm):
            yield "readings_mm has a length whose ends are one place"


class MachineStateFacts(JobTable):
    """``[machine_state]``: the machine as its certificate states it, and where its axes go."""

    certificate: Name | None = None
    """The certificate (PDF), its `results.json`, or the folder with it, inside the job's."""
    posterior: str = ""
    """Draws of the machine's errors (`posterior.npz`), where they do not lie beside `results.json`."""
    job: Name | None = None
    """In place of a certificate the folder of the machine's job, from this job's folder on; it is analysed anew."""
    valid_until: dt.date | None = None
    """Last day on which the certificate holds; where it is left out, the day that it names for the next calibration."""
    travel_mm: Travel = Travel.left_out()
    """Lowest and highest scale reading of each axis; as the certificate says where left out. A part outside is refused."""
    chain: Annotated[str, Field(pattern=r"^[XYZF]{3,4}$")] = "XYZ"
    """Carriages from the table to the ram, with F for the frame where the workpiece moves; as the certificate says where it is
    left out."""
    origin_mm: Triple = [0.0, 0.0, 0.0]
    """Scale reading of the origin of the coordinates that `[placing]` speaks of."""
    corrected: bool = key(True, "Whether the machine corrects the errors that its calibration found.")
    axes: AxesFacts = key([], "How axes are read; as the certificate says where left out.")
    bound: Annotated[list[BoundFacts], Field(max_length=LISTED.most)] = []
    """Bounds of errors that the calibration's recording cannot show, with their sources."""
    further: FurtherList = []
    """Further certificates of the machine, whose recordings are taken together with that of its calibration: another
    artefact, other lines, an earlier year."""
    passed: Annotated[list[PassedFacts], Field(max_length=8)] = []
    """Tests of lengths that the machine passed, of which there is no recording: no length erred by more than its limit."""

    def problems(self) -> Iterator[str]:
        stated = [name for one in self.bound for name in one.errors]
        for name in sorted({name for name in stated if stated.count(name) > 1}):
            yield f"{name} has more than one bound: state the one that holds"
        if (self.certificate is None) == (self.job is None):
            yield "give either certificate or job: what states the machine's errors"
        if self.job is not None and self.posterior:
            yield "a job is analysed anew and needs no posterior: leave it out"
        check_carriages(self.chain)
