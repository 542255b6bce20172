"""An axis or a plane calibrated by shifting an artefact: one kind, whose facts say which."""

from __future__ import annotations

from cmm_uq.artefacts.shifting.facts import ShiftFacts
from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="shift",
    table=ShiftFacts,
    plan="cmm_uq.artefacts.shift_axis.plan:PLANNING",
    begin="cmm_uq.artefacts.shifting.begin:AXIS",
    begin_also={"shift_plate": "cmm_uq.artefacts.shifting.begin:PLANE"},
    check="cmm_uq.artefacts.shifting.check:refuse_unfit",
    own="cmm_uq.artefacts.shifting.analysis:OWN",
    refusal="a shift job cannot be {}: its machine error is a free function, no list of effects",
    instead="cmm-uq report JOB estimates it",
)
