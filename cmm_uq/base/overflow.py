"""Numbers that leave the range of a double: refused where a result is handed over, never handed over as ``nan``.

The ranges of what is read keep this from happening; this is the last check.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import naming_package

_NOT_FINITE = "infs or NaNs"  # in what SciPy says of an array


@contextmanager
def refusing_overflow(where: str, fix: str) -> Iterator[None]:
    """A computation whose overflow is an error of its input, told in one line without the warnings before it."""
    with warnings.catch_warnings(record=True) as told:
        try:
            with naming_package():
                yield
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise _overflow(where, fix) from error
        except ValueError as error:
            if _NOT_FINITE not in str(error):
                raise
            raise _overflow(where, fix) from error
    for warning in told:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)


def must_be_finite(figures: Iterable[float], where: str, fix: str) -> None:
    """Refuse a result of which a figure is no finite number."""
    if not np.isfinite(np.fromiter(figures, dtype=np.float64)).all():
        raise _overflow(where, fix)


def _overflow(where: str, fix: str) -> CmmUqError:
    return CmmUqError("the figures leave the range of numbers, so there is no result", where=where, fix=fix)
