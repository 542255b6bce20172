"""A digital calibration certificate (DCC), whole."""

from __future__ import annotations

from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.administrative import Contact, CoreData, Items, Laboratory, Person, RefTypeDefinition, Software
from cmm_uq.jobs.dcc.fields import Attribute, Child, Foreign, Many, Part
from cmm_uq.jobs.dcc.results import Measurement, Statement
from cmm_uq.jobs.dcc.simple import Simple
from cmm_uq.jobs.dcc.texts import Attached
from cmm_uq.jobs.dcc.tree import Node

VERSION = "3.2.1"
"""Of the schema that is written."""


def _version(text: str) -> str:
    if not text.startswith("3."):
        raise ValueError(text)
    return text


class Administrative(Part):
    """Administrative data; its parts stand in any order."""

    UNORDERED: ClassVar[bool] = True

    software: Annotated[tuple[Software, ...], Many("software", within="dccSoftware")]
    ref_types: Annotated[tuple[RefTypeDefinition, ...], Many("refTypeDefinition", within="refTypeDefinitions")] = ()
    core: Annotated[CoreData, Child("coreData")]
    items: Annotated[Items, Child("items")]
    laboratory: Annotated[Laboratory, Child("calibrationLaboratory")]
    persons: Annotated[tuple[Person, ...], Many("respPerson", within="respPersons")]
    customer: Annotated[Contact, Child("customer")]
    statements: Annotated[tuple[Statement, ...], Many("statement", within="statements")] = ()


class Comment(Part):
    """Whatever else is said, in XML of any kind."""

    nodes: Annotated[tuple[Node, ...], Foreign()] = ()


class Certificate(Part):
    """A certificate.

    Parameters
    ----------
    version : of the schema.
    document : the human-readable copy.
    signatures : XML signatures (XAdES), as they stand: what they are worth is the business of ``cmm_uq.certificate.sign``.
    """

    version: Annotated[str, Attribute("schemaVersion", Simple("version 3 of the schema", _version))] = VERSION
    administrative: Annotated[Administrative, Child("administrativeData")]
    measurements: Annotated[tuple[Measurement, ...], Many("measurementResult", within="measurementResults")]
    comment: Annotated[Comment | None, Child("comment")] = None
    document: Annotated[Attached | None, Child("document")] = None
    signatures: Annotated[tuple[Node, ...], Foreign()] = ()
