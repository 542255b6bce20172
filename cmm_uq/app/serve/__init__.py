"""The page to look at: machines, certificates, artefacts and the state of the records, in a browser on the same machine.

It reads the records and the files that they name, and nothing else; it has no way to write. Pages are data
(:mod:`~cmm_uq.app.serve.page`) that one template shows, as documents are; they work without a script, without a network, and
from a keyboard.
"""

from __future__ import annotations

from cmm_uq.app.serve.due import Due, DueDates
from cmm_uq.app.serve.server import Server
from cmm_uq.app.serve.site import Site

__all__ = ["Due", "DueDates", "Server", "Site"]
