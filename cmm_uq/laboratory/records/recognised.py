"""By what machines and artefacts are recognised: serial numbers, however they are spelled."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Any

BY_NAME = "name:"
"""What begins the key of something without a serial number."""


def spelled(serial: str) -> str:
    """A serial number for comparing: NFKC, without case and blanks."""
    return "".join(unicodedata.normalize("NFKC", serial).casefold().split())


def machine_key(facts: Mapping[str, Any]) -> str:
    """By manufacturer and serial number, or by name where it has none.

    Parameters
    ----------
    facts : ``serial``, ``manufacturer`` and ``name`` of the machine.
    """
    if serial := spelled(str(facts.get("serial") or "")):
        return f"{spelled(str(facts.get('manufacturer') or ''))}/{serial}"
    return BY_NAME + spelled(str(facts.get("name") or ""))


def artefact_key(facts: Mapping[str, Any]) -> str:
    """By serial number, else by the number of its certificate, else by name; empty where none of them is given."""
    if serial := spelled(str(facts.get("serial") or "")):
        return serial
    if number := spelled(str(facts.get("certificate") or "")):
        return f"certificate:{number}"
    name = spelled(str(facts.get("name") or ""))
    return BY_NAME + name if name else ""


def called(facts: Mapping[str, Any], *names: str) -> str:
    """The first of the names under which the facts say something, as it is printed."""
    return next((text for name in names if (text := " ".join(str(facts.get(name) or "").split()))), "")
