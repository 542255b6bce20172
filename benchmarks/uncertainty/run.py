"""Times of the uncertainty engine beside its peers, each in a process of its own, as a table in Markdown.

    python benchmarks/uncertainty/run.py

Peers that are not installed are left out: pip install uncertainties GTC openturns suncal metrolopy.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
IMPORTS = ("cmm_uq.maths.uncertainty.evaluation", "cmm_uq.maths.uncertainty.models.model_file")


def contend(task: str, name: str) -> None:
    """One contender: its figures as JSON on the last line."""
    from contenders import CONTENDERS

    start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        seconds, figures, remark = CONTENDERS[task][name]()
    except ImportError:
        print(json.dumps(None))
        return
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start) / 1024
    print(json.dumps([seconds, grown, figures, remark]))


def ask(*arguments: str) -> list[object] | None:
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": str(HERE.parents[1]),
    }
    command = [sys.executable, __file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=HERE, check=False)
    if done.returncode:
        return [float("nan"), float("nan"), [], done.stderr.strip().splitlines()[-1][:80]]
    answer: list[object] | None = json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def importing(module: str) -> float:
    """Best of five fresh imports, s, beyond starting the interpreter."""
    environment = {**os.environ, "PYTHONPATH": str(HERE.parents[1])}

    def once(code: str) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, env=environment)
        return time.perf_counter() - start

    return min(once(f"import {module}") for _ in range(5)) - min(once("pass") for _ in range(5))


def main() -> None:
    from contenders import CONTENDERS

    for task, contenders in CONTENDERS.items():
        print(f"\n## {task}\n\n| | s | to NumPy | memory, MiB | figures | |\n| --- | ---: | ---: | ---: | --- | --- |")
        floor = None
        for name in contenders:
            found = ask(task, name)
            if found is None:
                print(f"| {name} | | | | | not installed |")
                continue
            seconds, grown, figures, remark = found
            floor = floor or seconds
            shown = ", ".join(f"{figure:.6g}" for figure in figures)
            print(f"| {name} | {seconds:.3g} | {seconds / floor:.3g} | {grown:.0f} | {shown} | {remark} |")
    print("\n## Import, beyond starting the interpreter\n\n| | s |\n| --- | ---: |")
    for module in ("numpy", *IMPORTS):
        print(f"| {module} | {importing(module):.2f} |")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        contend(sys.argv[1], sys.argv[2])
    else:
        main()
