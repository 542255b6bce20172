"""Proof of the diagnosis on a laboratory's own set-ups: sealed cases, what was found of them, and how it is judged.

Cases are drawn by the forward model of the job itself (``design``), their truth is sealed by a hash
before the first of them is diagnosed (:mod:`~cmm_uq.laboratory.proving.cases`), processes diagnose them
(``answers``), and what they say is compared with the truth (``judgement``). Knows no
kind of measurement, and not how a job is diagnosed.
"""
