"""What signatures are made with: the extra ``cmm-uq[sign]``, imported when it is needed, and missed in one line."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

from cmm_uq.errors import CmmUqError

_SILENT = logging.NullHandler()


@contextlib.contextmanager
def installed() -> Iterator[None]:
    """Imports inside that may miss a package of the extra.

    Raises
    ------
    CmmUqError : one is not installed.
    """
    for name in ("pyhanko", "pyhanko_certvalidator", "signxml"):
        logging.getLogger(name).addHandler(_SILENT)  # what matters is said once, by what is found
    try:
        yield
    except ImportError as error:
        raise CmmUqError(f"signatures need {error.name or 'a package'}, which is not installed",
                         fix="Install it: pip install 'cmm-uq[sign]'") from None  # fmt: skip
