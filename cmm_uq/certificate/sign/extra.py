"""What signatures are made with: the extra ``cmm-uq[sign]``, imported when it is needed, and missed in one line; its ways."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from cmm_uq.base.errors import NotInstalledError

_T = TypeVar("_T")
_SILENT = logging.NullHandler()


@contextlib.contextmanager
def installed() -> Iterator[None]:
    """Imports inside that may miss a package of the extra."""
    for name in ("pyhanko", "pyhanko_certvalidator", "signxml"):
        logging.getLogger(name).addHandler(_SILENT)  # what matters is said once, by what is found
    try:
        yield
    except ImportError as error:
        raise NotInstalledError(f"signatures need {(error.name or 'a package').partition('.')[0]}, which is not installed",
                                fix="Install it: pip install 'cmm-uq[sign]'") from None  # fmt: skip


def ran(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """What a coroutine of the library returns, also where a loop runs already, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(coroutine)
    with ThreadPoolExecutor(1) as other:
        return other.submit(asyncio.run, coroutine).result()
