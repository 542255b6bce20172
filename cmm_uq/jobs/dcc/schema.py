"""A certificate against the XML schema of PTB, by the xmlschema package: a second opinion, where the schema is at hand.

The schema is not part of this package (LGPL). A folder has it as ``dcc-3.2.1.xsd`` and ``SI_Format-2.1.0.xsd``, and further
versions beside them; what it imports is looked up there, and xmldsig-core in the xmlschema package: nothing is fetched.
"""

from __future__ import annotations

import re
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc.tree import NAMESPACES, parsed

_MOST = 20  # problems that are told
_IMPORT = re.compile(r'namespace="([^"]+)"\s+schemaLocation="([^"]+)"')


def checked_by_schema(data: bytes, folder: Path, where: str) -> None:
    """Refuse a certificate that the schema of its version refuses."""
    version = parsed(data, where).attributes.get("schemaVersion", "")
    schema = _schema(folder, version, where)
    import defusedxml.ElementTree

    root, fix = defusedxml.ElementTree.fromstring(data), f"The schema of DCC {version} asks for it"
    errors = [
        CmmUqError(str(error.reason), where=f"{where}, {error.path}", fix=fix)
        for error in islice(schema.iter_errors(root), _MOST)
    ]
    if errors:
        errors[0].also = tuple(errors[1:])
        raise errors[0]


@cache
def _schema(folder: Path, version: str, where: str) -> Any:
    try:
        import xmlschema
    except ImportError:
        fix = "pip install xmlschema, or leave --schema out"
        raise CmmUqError("the package xmlschema is not installed", where="--schema", fix=fix) from None
    file = folder / f"dcc-{version}.xsd"
    if not re.fullmatch(r"3\.\d+\.\d+", version) or not file.is_file():
        fix = f"Put PTB's dcc.xsd there; {where} is of that version"
        raise CmmUqError(f"no schema of DCC {version}", where=str(file), fix=fix)
    # the newest schema of D-SI in the folder, and the schema of XML signatures that the xmlschema package has
    places = {NAMESPACES["si"]: max(folder.glob("SI_Format-*.xsd"), default=None)}
    places[NAMESPACES["ds"]] = Path(xmlschema.__file__).parent / "schemas" / "DSIG" / "xmldsig-core-schema.xsd"
    text = file.read_text(encoding="utf-8")
    for space, location in _IMPORT.findall(text):
        schema = _of_version(folder, space, location) or places.get(space)
        if schema is None:
            fix = "Put it into the same folder"
            raise CmmUqError(f"imports {location}, which is not beside it", where=str(file), fix=fix)
        text = text.replace(f'"{location}"', f'"{schema.as_uri()}"')
    beside = {"http://qudt.org/vocab/": str(folder / "qudt.xsd")} if (folder / "qudt.xsd").is_file() else None
    try:
        return xmlschema.XMLSchema(text, base_url=str(folder), locations=beside, allow="local", defuse="always")
    except xmlschema.XMLSchemaException as error:
        problem, fix = str(error).strip().partition("\n")[0], "What it imports has to be in the same folder"
        raise CmmUqError(f"cannot be used: {problem}", where=str(file), fix=fix) from None


def _of_version(folder: Path, space: str, location: str) -> Path | None:
    """The file of an imported schema by the version in its address."""
    version = re.search(r"v(\d+\.\d+\.\d+)", location)
    if space != NAMESPACES["si"] or version is None:
        return None
    file = folder / f"SI_Format-{version[1]}.xsd"
    return file if file.is_file() else None
