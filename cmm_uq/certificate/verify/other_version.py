"""A certificate by an earlier version: its figures and decisions beside those computed here.

Its pages are made again to the byte by the version that made them, and by no other.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from cmm_uq.certificate.verify.again import Again, beyond_sampling, leaves
from cmm_uq.certificate.verify.found import AGAIN, Inquiry
from cmm_uq.certificate.verify.given import RESULTS, Given, strict_json

_STATED = re.compile(
    r"(?:accuracy|accuracy_uncertainty|estimates|differences|conformity|verdicts|characteristics|decision)\b|diagnosis\.verdict$"
)
_DECIDED = re.compile(r"(?:^|[.])(?:decision|outcome|overall|verdict)$")
_NAMED = 6  # figures that a sentence names


def compare_figures(inquiry: Inquiry, given: Given, again: Again, made: str) -> None:
    """Keep every figure and decision of a certificate by an earlier version that its inputs do not give by this one."""
    if given.results is None:
        return
    name, data, _ = given.results
    new = strict_json(again.files[RESULTS], RESULTS)
    stated, computed = _figures(data), _figures(new)
    both = [path for path in stated if path in computed]
    inquiry.looked("again", len(both))
    found = [(path, stated[path], computed[path]) for path in both if stated[path] != computed[path]]
    sampled = 2 * len(found) > len(both)  # by other kernels or draws, not of one that was altered
    beyond = list(beyond_sampling(data, new, found, sampled=sampled))
    for path, stands, should in beyond:
        inquiry.wrong("again", name, path, "is not what its inputs give", stands, should)
    moved = [path for path, *_ in found if path not in {place for place, *_ in beyond}]
    if moved:
        how = "within Monte Carlo error" if sampled else "within their last digit"
        inquiry.notes.append(f"{len(moved)} of {len(both)} figures moved {how} since version {made}: {_some(moved)}.")
    for only, other in ((stated, computed), (computed, stated)):
        if further := [path for path in only if path not in other]:
            of = f"version {made}" if only is stated else "this version"
            inquiry.left(f"{len(further)} figures", f"only {of} states them: {_some(further)}")


def _figures(data: Any) -> dict[str, Any]:
    """Figures and decisions by their path; no words, and nothing of how they were computed."""
    return {
        path: value
        for path, value in leaves(data)
        if _STATED.match(path)
        and (_DECIDED.search(path) if isinstance(value, str) else isinstance(value, (int, float)))
    }


def _some(paths: Sequence[str]) -> str:
    return ", ".join([*paths[:_NAMED], *(["…"] if len(paths) > _NAMED else [])])


def plugins_missing(inquiry: Inquiry, data: Mapping[str, Any]) -> bool:
    """Packages that took part and are not here as they were then."""
    missing = False
    for package, wanted in (data["software"].get("plugins") or {}).items():
        try:
            here = version(str(package))
        except PackageNotFoundError:
            here = ""
        if here != wanted:
            missing = True
            told = f"version {here} is installed" if here else "it is not installed"
            inquiry.left(AGAIN, f"{package} {wanted} took part, and {told}")
    return missing
