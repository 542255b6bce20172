"""Uncertainty of coordinate measuring machines, and the certificates that state it.

The public API: each name is imported when it is first used, so that ``import cmm_uq`` costs nothing.

>>> import cmm_uq
>>> job = cmm_uq.read("examples/iota-1102-20C")
>>> job.origin
'measured'
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing alone would cost ten times as much as all of this
if TYPE_CHECKING:
    from cmm_uq.app.api.calls import (
        budget,
        check,
        compensate,
        diagnose,
        job,
        new,
        part,
        plan,
        prove,
        read,
        read_export,
        report,
        simulate,
    )
    from cmm_uq.app.api.recertification import due, history
    from cmm_uq.base.errors import CmmUqError
    from cmm_uq.machine.physics.catalogue import register

__version__ = "0.15.0"

__all__ = [
    "CmmUqError", "__version__", "budget", "check", "compensate", "diagnose", "due", "history", "job", "new", "part",
    "plan", "prove", "read", "read_export", "register", "report", "simulate",
]  # fmt: skip


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    places = {"CmmUqError": "cmm_uq.base.errors", "check": "cmm_uq.app.api.calls", "new": "cmm_uq.app.api.calls",
              "due": "cmm_uq.app.api.recertification", "history": "cmm_uq.app.api.recertification",
              "register": "cmm_uq.machine.physics.catalogue"}  # fmt: skip
    found = getattr(import_module(places.get(name, "cmm_uq.app.api.calls")), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__
