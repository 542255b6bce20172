"""What ``cmm-uq new`` asks on a terminal: machine, artefact, its certificate, limits; each answer may be its default."""

from __future__ import annotations

from typing import Any

import typer

from cmm_uq.app.cli.new import value_of


def answers(name: str) -> dict[str, dict[str, Any]]:
    """What the user says of a new job of a kind, by table and key; only what differs from what it begins with."""
    from cmm_uq.app.commands.jobs.new import usual

    found: dict[str, dict[str, Any]] = {}
    for table, key, question, default in _questions(usual(name)):
        said = typer.prompt(question, default=default, show_default=default != "")
        if said != default:
            found.setdefault(table, {})[key] = (
                said if isinstance(default, str) and key in _TEXTS else value_of(str(said))
            )
    certificate = found.get("artefact", {})
    chain = {key: certificate.pop(f"certificate_{key}") for key in _CHAIN if f"certificate_{key}" in certificate}
    if chain:
        certificate["certificate"] = chain
    return {table: keys for table, keys in found.items() if keys}


_CHAIN = {
    "number": "Number of its certificate", "laboratory": "Laboratory that certified it",
    "issuer": "What that is (national institute, accredited, not accredited, in-house)",
    "arrangement": "Arrangement that covers it (CIPM MRA, ILAC MRA, EA MLA, …)",
    "accreditation": "Number of its accreditation", "accredited_by": "Body that accredited it",
    "date": "Date of the certificate, as 2026-05-31", "due": "Last day on which it holds",
}  # fmt: skip
_TEXTS = ("name", "serial", "customer", "mpe", *(f"certificate_{key}" for key in _CHAIN if key not in ("date", "due")))


def _questions(usual: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """Table, key, question and default of each."""
    machine, artefact = usual["machine"], usual["artefact"]
    travel = ", ".join(f"{axis} = {span}" for axis, span in machine["travel_mm"].items())
    asked = [
        ("machine", "name", "Machine", machine["name"]), ("machine", "serial", "Its serial number", ""),
        ("machine", "travel_mm", "Its travel, lowest and highest reading in mm", f"{{ {travel} }}"),
        ("job", "customer", "Customer", ""),
    ]  # fmt: skip
    if "name" in artefact:
        asked += [
            ("artefact", "name", "Artefact", artefact["name"]), ("artefact", "serial", "Its serial number", ""),
            *(("artefact", f"certificate_{key}", question, "") for key, question in _CHAIN.items()),
        ]  # fmt: skip
    for key, question in (
        ("length_mm", "Certified length or diameter in mm"),
        ("u_um", "Its standard uncertainty (k = 1) in µm"),
    ):
        if key in artefact:
            asked.append(("artefact", key, question, str(artefact[key])))
    for wish in usual.get("conformity", ()):
        for key, question in (("limit_um", "Limit in µm"), ("mpe", "Maximum permissible error, L in mm, in µm")):
            if key in wish:
                asked.append(("conformity", key, f"{question} ({wish['standard']})", str(wish[key])))
    return asked
