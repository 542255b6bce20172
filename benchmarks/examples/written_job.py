"""Writes a simulated example: a folder with job.toml and recording.csv."""

from __future__ import annotations

import sys
from pathlib import Path


def write(name: str, toml: str, recording: str) -> None:
    """Into the folder named on the command line, or the project's examples."""
    place = (Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "examples") / name
    place.mkdir(parents=True, exist_ok=True)
    (place / "job.toml").write_text(toml, encoding="utf-8")
    (place / "recording.csv").write_text(recording, encoding="utf-8")
