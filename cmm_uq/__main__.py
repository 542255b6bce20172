"""``python -m cmm_uq`` is the command ``cmm-uq``."""

from cmm_uq.cli import main

main()
