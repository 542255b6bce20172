"""Packages as an installer leaves them: their modules beside a dist-info folder with their entry points."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

OUTSIDE_KINDS = Path(__file__).parent / "outside_kinds"
OUTSIDE_EFFECTS = Path(__file__).parent / "outside_effects"
OUTSIDE_IMPORTS = Path(__file__).parent / "outside_imports"
OUTSIDE_STANDARDS = Path(__file__).parent / "outside_standards"
"""Sources of packages of their own: what their authors write."""


def install(project: Path, site: Path) -> Path:
    """Put a project's modules and metadata into a folder that packages are looked for in."""
    about = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for module in project.glob("*.py"):
        shutil.copy(module, site)
    describe(site, about["name"], about["version"], about["entry-points"])
    return site


def describe(site: Path, name: str, version: str, offers: dict[str, dict[str, str]]) -> None:
    """Write the metadata of a package that offers something by entry points, in groups."""
    info = site / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    lines = []
    for group, entries in offers.items():
        lines += [f"[{group}]", *(f"{entry} = {where}" for entry, where in entries.items()), ""]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
