"""The results.json of another report that a job names: itself, or the folder it lies in; only what is needed of it is read."""

from __future__ import annotations

from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.file_names import RESULTS


class Part(BaseModel):
    """Of a results.json only what is needed; further keys are no business of its reader."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


P = TypeVar("P", bound=Part)


def results_named(given: str | None) -> str | None:
    """Name of the results.json; ``None`` where the job names none."""
    if given is None:
        return None
    name = given.removesuffix("/")
    return name if name.endswith(".json") else f"{name}/{RESULTS}"


def read_results(part: type[P], content: bytes, where: str, what: str, fix: str) -> P:
    """What is needed of it.

    Parameters
    ----------
    part : what that is.
    where : file, for messages.
    what, fix : what it should be, and what to do where it is not.

    Raises
    ------
    CmmUqError : it is none.
    """
    try:
        return part.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        at = ".".join(map(str, first["loc"]))
        told = f"{at}: {first['msg'][0].lower()}{first['msg'][1:]}" if at else "it is no JSON"
        raise CmmUqError(f"is no {what}: {told}", where=where, fix=fix) from None
