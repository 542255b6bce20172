"""Tolerances of DMIS programs, ``T(…)=TOL/…``, as keys of a characteristic."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.jobs.part.characteristic import ASKS, What
from cmm_uq.jobs.part.common import BETWEEN
from cmm_uq.jobs.part.dmis_frames import numbers_of, reference
from cmm_uq.jobs.part.drawing import Facts, NotUnderstoodError, limits, refuse_other_kind
from cmm_uq.jobs.part.not_modelled import (
    FREE_STATE,
    LEAST_MATERIAL,
    LINE_PROFILE,
    MAXIMUM_MATERIAL,
    POINT_PROFILE,
    PROJECTED,
    SURFACE_PROFILE,
    TWO_POINT,
)

_TOLERANCES: Mapping[str, What] = {
    "FLAT": "flatness", "STRGHT": "straightness", "CIRLTY": "roundness", "CYLCTY": "cylindricity", "DIAM": "size",
    "POS": "position", "PARLEL": "parallelism", "PERP": "perpendicularity", "CONCEN": "coaxiality",
    "CRNOUT": "circular_runout", "TRNOUT": "total_runout",
}  # fmt: skip

_REFUSED: Mapping[str, str] = {
    "PROFL": LINE_PROFILE, "PROFS": SURFACE_PROFILE, "PROFP": POINT_PROFILE, "MMC": MAXIMUM_MATERIAL, "LMC": LEAST_MATERIAL,
    "LP": TWO_POINT, "FREE": FREE_STATE, "PROJ": PROJECTED,
}  # fmt: skip
"""Words that change what a tolerance means, refused in words of their own."""

_PLAIN = ("RFS", "2D", "3D")
"""Words that leave a tolerance as it is, or say what its feature says already."""


def toleranced(words: list[str], feature: Facts, millimetres: float, datums: Mapping[str, str]) -> Facts:
    """Keys of the characteristic that a tolerance is of a feature, but its name.

    Parameters
    ----------
    words : of the tolerance.
    feature : that it was given to, as its table.
    millimetres : in the program's unit of length.
    datums : names of features that are read, by the labels of datums.

    Raises
    ------
    NotUnderstoodError : it is none that is read.
    """
    sort = words[0].upper() if words else ""
    if sort not in _TOLERANCES:
        raise NotUnderstoodError(_REFUSED.get(sort) or f"is a tolerance {sort or 'of no kind'}, which is not read")
    what, kind = _TOLERANCES[sort], feature["kind"]
    refuse_other_kind(what, kind)
    plain = [word.upper() for word in words[1:] if not reference(word)[0]]
    refused = next((_REFUSED[word] for word in plain if word in _REFUSED), None)
    if refused:
        raise NotUnderstoodError(refused)
    number = numbers_of([word for word in plain if word not in _PLAIN])
    if what == "size":
        if len(number) < 2:
            raise NotUnderstoodError("has a diameter without two limits, which is not read")
        low, high = (feature["diameter_mm"] + millimetres * limit for limit in number[:2])
        return {"what": what, "features": [feature["name"]], **limits(what, low, high)}
    if what == "position" and ("3D" in plain) != (kind in ("point", "sphere")):
        said = "3D" if "3D" in plain else "2D"
        raise NotUnderstoodError(f"is a position in {said} of a {kind}, which is not read")
    if not number or number[0] <= 0:
        raise NotUnderstoodError("is a tolerance of 0, which nothing conforms with")
    about = [_datum(name, datums) for of, name in map(reference, words[1:]) if of in ("DAT", "FA")]
    if len(about) < ASKS[what].datums:
        raise NotUnderstoodError("names no datum")
    if about and not ASKS[what].datum_kinds:
        raise NotUnderstoodError(f"is a {what} with a datum, which has none")
    named = {"datums": about} if about else {}
    return {"what": what, "features": [feature["name"]], **named, "tolerance_mm": millimetres * number[0]}


def _datum(label: str, datums: Mapping[str, str]) -> str:
    if label in datums:
        return datums[label]
    if label in datums.values():
        return label
    parts = label.split(BETWEEN)
    if len(parts) > 1:
        return BETWEEN.join(_datum(each.strip(), datums) for each in parts)
    raise NotUnderstoodError(f"is about the datum {label}, which is no feature that is read")
