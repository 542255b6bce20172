"""``[job.replaces]``: the certificate in whose place a new one is issued (ISO/IEC 17025:2017, 7.8.8)."""

from __future__ import annotations

import datetime as dt
import re
from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.table import Table

Said = Annotated[str, Field(min_length=1, pattern=r"\S")]
"""Words that must not be left out."""

FILE = "replaced-results.json"
"""Results of the certificate that is replaced, as the records have them: an input, so that anybody can compare again."""

_FIGURES = r"(?:figures?|values?|results?|numbers?|decisions?|outcomes?)"
_WERTE = r"(?:(?:mess|zahlen)?werte?n?|zahl(?:en)?|ergebnis(?:se)?n?|entscheidung(?:en)?)"
_VALEURS = r"(?:valeurs?|chiffres?|résultats?|décisions?)"
_NOTHING_CHANGED = re.compile(
    rf"\bno (?:other |measured |further )?{_FIGURES}\b|\bnone of the {_FIGURES}\b|\b{_FIGURES}: none\b"
    rf"|\bnothing (?:else )?(?:is |was |has |has been )?chang|\bno (?:other |further )?changes?\b"
    rf"|\bwithout (?:any )?changes?\b|\b{_FIGURES}\b[^.;]{{0,30}}\b(?:unchanged|unaltered|unaffected|the same|not (?:been )?"
    rf"(?:changed|affected|altered))|\bunchanged {_FIGURES}\b"
    rf"|\bkeine?n? (?:anderen? |weiteren? )?{_WERTE}\b|\bkeine änderung|\bohne änderung|\bnichts (?:hat sich )?geändert"
    rf"|\b{_WERTE}\b[^.;]{{0,30}}\b(?:unverändert|nicht (?:geändert|verändert|betroffen)|gleich geblieben|bleiben gleich)"
    rf"|\bunveränderte[nr]? {_WERTE}\b"
    rf"|\baucune? (?:autre )?{_VALEURS}\b|\baucun changement|\baucune modification|\bsans (?:changement|modification)"
    rf"|\brien n['’ ]?a changé|\b{_VALEURS}\b[^.;]{{0,30}}\b(?:inchangée?s?|ne changent pas|n['’]ont pas changé)"
    r"|変更(?:は|が)?(?:な[しい]|ありません|ございません)|(?:数値|結果|値|判定)[^。;]{0,12}"
    r"(?:不変|変わらない|変わりません|変わっていない|変わっていません|変わりな[しい]|変更な[しい]|同じ|変更されていない|変更していない)",
    re.IGNORECASE,
)
"""The usual ways, in the languages of certificates, of saying that figures or decisions did not change."""


class Replaced(Table):
    """The certificate that this one replaces, why, and what changed."""

    number: Said
    """Number of the certificate that is replaced."""
    date: dt.date
    """Its date of issue."""
    reason: Said
    """Why it is replaced."""
    changed: Said
    """What is changed in this certificate against it (7.8.8.1)."""
    figures_changed: bool | None = None
    """Whether a figure or a decision is changed against it; `false` is refused where one is."""
    results: str | None = None
    """`results.json` of the certificate that is replaced, or the folder with it inside the job's, where no records have it."""

    @model_validator(mode="after")
    def _one_answer(self) -> Self:
        if self.figures_changed and self.denies_in_words:
            raise ValueError(
                f"figures_changed = true, and changed = {self.changed!r} says that none is: say in changed which are"
            )
        return self

    @property
    def denies_in_words(self) -> bool:
        """Whether its words say that no figure is changed."""
        return denies_a_change(self.changed)

    @property
    def denies(self) -> bool:
        """Whether it says that no figure is changed."""
        return self.figures_changed is False or self.denies_in_words


def denies_a_change(words: str) -> bool:
    """Whether words say that no figure, or nothing, is changed."""
    return _NOTHING_CHANGED.search(" ".join(words.split())) is not None
