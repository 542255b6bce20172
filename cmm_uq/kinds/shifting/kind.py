"""An axis or a plane calibrated by shifting an artefact: one kind, whose facts say which."""

from __future__ import annotations

from cmm_uq.kinds.shifting.facts import ShiftFacts
from cmm_uq.model.kind import Kind

KIND = Kind(
    name="shift",
    table=ShiftFacts,
    plan="cmm_uq.kinds.shift_axis.plan:PLANNING",
    begin="cmm_uq.kinds.shifting.begin:AXIS",
    begin_also={"shift_plate": "cmm_uq.kinds.shifting.begin:PLANE"},
    check="cmm_uq.kinds.shifting.check:refuse_unfit",
    own="cmm_uq.kinds.shifting.analysis:OWN",
    refusal="a shift job cannot be {}: its machine error is a free function, no list of effects",
    instead="cmm-uq report JOB estimates it",
)
