"""What :mod:`cmm_uq` offers in Python; imported when it is first used."""
