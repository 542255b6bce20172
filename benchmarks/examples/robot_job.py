"""Writes the example of a robot that a tracker measured, simulated by the equations of the coverage study.

Run:  python -m benchmarks.examples.robot_job
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.artefacts.arm_coverage import NAMED, robot

NAME, SEED = "robot-simulated", 4
FOLDER = Path(__file__).parents[2] / "examples" / NAME


def files() -> dict[str, bytes]:
    """job.toml and recording.csv: play of joint 1 is put in, and named."""
    made, truth = robot(SEED, "slack_q1")
    told = "; ".join(f"{effect} {name} = {value:.0f}" for (effect, name), value in truth.items())
    text = made["job.toml"].decode()
    text = text.replace(f'id = "robot-{SEED}"\ndate = 2026-11-30', f'''id = "{NAME}"
date = 2026-01-01
origin = "simulated"
procedure = "Poses of a robot, a reflector on its flange seen by a laser tracker"
remarks = """
Simulated, no machine was measured. True errors: {told}; slack_q1 gap_arcsec = 80."""''')  # fmt: skip
    text = text.replace(f'"Robot {SEED}"', '"Simulated robot"').replace(str(list(NAMED))[:-1].replace("'", '"'), str(
        [*NAMED, "slack_q1"])[:-1].replace("'", '"')).replace('kind = "tracked_points"', '''kind = "tracked_points"
name = "Laser tracker"''')  # fmt: skip
    for table in ("[machine]", "[[machine.joint]]", "[recording]", "[model]"):
        text = text.replace(f"\n{table}", f"\n\n{table}").replace(f"\n\n\n{table}", f"\n\n{table}")
    head = "# Simulated with benchmarks/examples/robot_job.py: no machine was measured.\n\n"
    return {"job.toml": (head + text).encode(), "recording.csv": made["recording.csv"]}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, content in files().items():
        (FOLDER / name).write_bytes(content)
