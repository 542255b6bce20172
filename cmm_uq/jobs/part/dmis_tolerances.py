"""Tolerances of DMIS programs, ``T(…)=TOL/…``, as keys of a characteristic."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.jobs.part.characteristic import ASKS, What
from cmm_uq.jobs.part.dmis_frames import numbers_of, reference
from cmm_uq.jobs.part.drawing import Facts, NotUnderstoodError, limits, refuse_other_kind

_TOLERANCES: Mapping[str, What] = {
    "FLAT": "flatness", "STRGHT": "straightness", "CIRLTY": "roundness", "CYLCTY": "cylindricity", "DIAM": "size",
    "POS": "position", "PARLEL": "parallelism", "PERP": "perpendicularity", "CONCEN": "coaxiality",
    "CRNOUT": "circular_runout", "TRNOUT": "total_runout",
}  # fmt: skip

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
        raise NotUnderstoodError(f"is a tolerance {sort or 'of no kind'}, which is not read")
    what, kind = _TOLERANCES[sort], feature["kind"]
    refuse_other_kind(what, kind)
    plain = [word.upper() for word in words[1:] if not reference(word)[0]]
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
    raise NotUnderstoodError(f"is about the datum {label}, which is no feature that is read")
