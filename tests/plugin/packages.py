"""Packages as an installer leaves them: their modules beside a dist-info folder with their entry points."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

OUTSIDE = Path(__file__).parent / "outside_effects"
"""The source of a package of its own: what its author writes."""


def install(project: Path, site: Path) -> Path:
    """Put a project's modules and metadata into a folder that packages are looked for in."""
    about = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for module in project.glob("*.py"):
        shutil.copy(module, site)
    describe(site, about["name"], about["version"], about["entry-points"]["cmm_uq.effects"])
    return site


def describe(site: Path, name: str, version: str, effects: dict[str, str]) -> None:
    """Write the metadata of a package that offers effects."""
    info = site / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    lines = [f"{effect} = {where}" for effect, where in effects.items()]
    (info / "entry_points.txt").write_text("\n".join(["[cmm_uq.effects]", *lines, ""]), encoding="utf-8")
