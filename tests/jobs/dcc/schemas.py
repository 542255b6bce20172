"""The schemas of PTB, where they are at hand beside the project, read by lxml: nothing is fetched."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import pytest
import xmlschema
from lxml import etree

from tests.conftest import ROOT

FOLDER = Path(os.environ.get("CMM_UQ_SCHEMAS", ROOT.parent / "shared" / "schemas"))
DSIG = Path(xmlschema.__file__).parent / "schemas" / "DSIG" / "xmldsig-core-schema.xsd"
SI = {"3.2.1": "2.1.0", "3.3.0": "2.2.1"}
"""Version of D-SI that a version of the DCC imports."""


class _Local(etree.Resolver):
    """What the schemas import, from the folder."""

    def __init__(self, version: str) -> None:
        super().__init__()
        self.version = version

    def resolve(self, system_url: str | None, public_id: str | None, context: object) -> object:
        name = "" if system_url is None else system_url.rpartition("/")[2]
        if "xmldsig" in name:
            text = DSIG.read_text(encoding="utf-8")
            return self.resolve_string(text[text.index("<schema") :], context)
        if "SI_Format" in name or "/dsi/" in str(system_url):
            return self.resolve_filename(str(FOLDER / f"SI_Format-{SI[self.version]}.xsd"), context)
        if "qudt" in str(system_url):
            return self.resolve_filename(str(FOLDER / "qudt.xsd"), context)
        return None


@cache
def by_lxml(version: str) -> etree.XMLSchema:
    """The schema of a version; the test is skipped where it is not at hand."""
    file = FOLDER / f"dcc-{version}.xsd"
    if not file.is_file():
        pytest.skip(f"no {file.name} in {FOLDER}")
    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(_Local(version))
    return etree.XMLSchema(etree.parse(str(file), parser))
