"""What a measurement can tell before anyone makes it: which set-ups determine what, and which would tell more.

Set-ups are ready ones (:mod:`~cmm_uq.analysis.planning.candidates`) or candidates in the machine's volume
(``candidates``). What they determine follows from the design of the measurement model alone, so that
nothing about an artefact or an effect is typed by hand here.
"""
