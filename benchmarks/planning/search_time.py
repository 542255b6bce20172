"""Time of one step of the search for 300 candidates and 30 effects: ``python benchmarks/planning/search_time.py``."""

from __future__ import annotations

import time

import numpy as np
from settings import MACHINE, SIX, setting

from cmm_uq.analysis.planning.candidates import candidates, set_up_information
from cmm_uq.analysis.planning.exchange import CRITERIA, choose, score_of
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.artefacts import artefact_facts


def main() -> None:
    columns = {f"temp_{part}_c": 21.0 for part in ("x", "y", "z", "artefact", "table_top", "table_bottom")}
    plan = setting(artefact_facts(kind="step_gauge", u_um=0.4), SIX, pitch_mm=20.0, length_mm=1000.0, columns=columns)
    began = time.perf_counter()
    possible = candidates(plan)
    rivals = plan.rivals(join(possible[:2], columns=columns))[:24]
    known = set_up_information(plan, possible, rivals)
    print(f"{MACHINE.name}: {len(possible)} candidates, {len(SIX) + len(rivals)} effects, "
          f"their information {time.perf_counter() - began:.2f} s")  # fmt: skip
    for criterion in CRITERIA:
        rows = known.where(rivals) if criterion == "separation" else known.where((*plan.named, *rivals))
        score = score_of(criterion, known, rows)
        start = known.prior + known.each[:7].sum(axis=0)
        times = []
        for _ in range(5):
            began = time.perf_counter()
            score(start + known.each)
            times.append(time.perf_counter() - began)
        began = time.perf_counter()
        choose(known, known.prior, score, 20)
        print(f"{criterion}: a step {1e3 * np.median(times):.0f} ms, twenty placings with exchange "
              f"{time.perf_counter() - began:.2f} s")  # fmt: skip


if __name__ == "__main__":
    main()
