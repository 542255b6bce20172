"""Which of a kind's keys its artefact's certificate states, and by which words a certificate calls them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class CertifiedValue:
    """A value of ``[artefact]`` that a digital certificate may state.

    Parameters
    ----------
    key : of it; with a dot where it stands in a table of its own, which the job must have.
    u_key : of its standard uncertainty, µm; empty where it has none.
    words : parts of the names by which certificates call it, in small letters.
    count : of values; of several the largest uncertainty is taken, where they have one key.
    needed : whether a certificate without it is of no use.
    """

    key: str
    u_key: str
    words: Sequence[str]
    count: int = 1
    needed: bool = True

    @property
    def micrometres(self) -> bool:
        """Whether it is in µm, and not in mm."""
        return self.key.endswith("_um")


LENGTH_WORDS = ("length", "distance", "länge", "abstand", "longueur", "長さ", "距離")
DIAMETER_WORDS = ("diameter", "durchmesser", "diamètre", "直径")
FORM_WORDS = (
    "form dev",
    "form error",
    "formabweichung",
    "roundness",
    "sphericity",
    "rundheit",
    "circularité",
    "真球度",
)
"""In English, German, French and Japanese."""

LENGTH = CertifiedValue("length_mm", "u_um", LENGTH_WORDS)
DIAMETER = CertifiedValue("length_mm", "u_um", DIAMETER_WORDS)
