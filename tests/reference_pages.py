"""The pages of docs/reference and the schemas in the package: ``python -m tests.reference_pages`` writes them anew."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.commands.schemas import SCHEMAS, as_text, schema_named
from tests.conftest import ROOT

SHIPPED = ROOT / "cmm_uq" / "schemas"


def files() -> dict[Path, str]:
    """Every generated file with what it must say."""
    return {SHIPPED / f"{name}.schema.json": as_text(schema_named(name)) for name in SCHEMAS}


def main() -> None:
    """Write them."""
    for path, text in files().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
