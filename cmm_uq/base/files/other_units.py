"""Keys and columns in a unit that is not read, refused by name with the conversion to the one that is."""

from __future__ import annotations

from collections.abc import Collection

_PER_METRE = "{given} · L / 1000, with the length L in mm"
_BY_ENDING = (
    ("_um_per_m_k", "_per_k", "1e-6 · {given}"), ("_ppm_per_k", "_per_k", "1e-6 · {given}"),
    ("_per_f", "_per_k", "1.8 · {given}"), ("_um_per_m", "_um", _PER_METRE), ("_um_m", "_um", _PER_METRE),
    ("_ppm", "_um", _PER_METRE), ("_mm", "_um", "1000 · {given}"), ("_nm", "_um", "{given} / 1000"),
    ("_inch", "_um", "25400 · {given}"), ("_in", "_um", "25400 · {given}"), ("_mil", "_um", "25.4 · {given}"),
    ("_inch", "_mm", "25.4 · {given}"), ("_in", "_mm", "25.4 · {given}"), ("_mil", "_mm", "0.0254 · {given}"),
    ("_um", "_mm", "{given} / 1000"), ("_cm", "_mm", "10 · {given}"), ("_m", "_mm", "1000 · {given}"),
    ("_f", "_c", "({given} − 32) / 1.8"), ("_f", "_k", "{given} / 1.8"), ("_k", "_c", "{given} − 273.15"),
    ("_min", "_s", "60 · {given}"), ("_h", "_s", "3600 · {given}"), ("_kpa", "_hpa", "10 · {given}"),
    ("_pa", "_hpa", "{given} / 100"),
    ("_deg", "_arcsec", "3600 · {given}"),
)  # fmt: skip
_FREEDOM = ("dof", "nu", "nu_eff", "v_eff", "degrees_of_freedom", "freiheitsgrade")


def conversion(given: str, known: Collection[str]) -> str | None:
    """What to give instead of a key in another unit; ``None`` where it is none of a known one.

    Parameters
    ----------
    given : key or column as it was written.
    known : those that are read.

    Notes
    -----
    An uncertainty u with ν degrees of freedom has a t distribution, whose standard deviation is u·√(ν/(ν − 2)) (JCGM 101:2008,
    6.4.9).
    """
    if given.startswith("U_") and (standard := f"u_{given[2:]}") in known:
        return f"Give {standard} = U/k, the standard uncertainty: U is k times as large"
    if given.casefold() in _FREEDOM and (standard := next((key for key in known if key.startswith("u_")), "")):
        return (
            f"Give {standard} = u · √(ν/(ν − 2)), the standard deviation of a t distribution with ν degrees of freedom"
        )
    for ending, wanted, formula in _BY_ENDING:
        key = given[: -len(ending)] + wanted
        if given.endswith(ending) and key in known:
            return f"Give {key} = {formula.format(given=given)}"
    return None
