"""Effects move points: the machine, temperature, the probe. No statistics here.

Whoever adds a physical effect writes one small class (:class:`cmm_uq.machine.physics.effect.Effect`) and names it in the
catalogue; every artefact, estimator, simulator and certificate then works with it.
"""
