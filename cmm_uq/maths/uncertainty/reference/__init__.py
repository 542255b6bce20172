"""Reference cases: published figures that the engine reproduces, run by :mod:`cmm_uq.maths.uncertainty.reference.selftest`."""
