"""``python -m cmm_uq`` is the command ``cmm-uq``."""

from cmm_uq.app.cli import main

main()
