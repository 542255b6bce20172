"""The seal: what is seen of an electronic signature on the first page of a PDF, in its foot, where no text stands."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable

from cmm_uq.base.languages.language import code_of
from cmm_uq.base.messages import Text, Verbatim, commas, say, sentences
from cmm_uq.certificate.pdf import picture
from cmm_uq.certificate.sign import TEST_NOTE, Seal, Signer

WIDTH_MM, HEIGHT_MM = 84.0, 8.0
LEFT_MM, BOTTOM_MM, GAP_MM = 20.0, 3.5, 2.0
"""Of the first seal on a page A4; a second stands beside it. The text of a page ends 22 mm, its foot 10 mm above the edge."""

SEALS = 2

_POINTS = 72 / 25.4


def same(text: Text) -> Text:
    """A text as it is."""
    return text


def seal(
    signer: Signer, at: dt.datetime, laboratory: Text, accreditation: Text, *, language: str = "en",
    said: Callable[[Text], Text] = same,
) -> Seal:  # fmt: skip
    """The seal of a signer.

    Parameters
    ----------
    signer : who signs.
    at : time of signing, with its zone.
    laboratory : that answers for the document; empty where it does not say.
    accreditation : of the laboratory, as it is printed; empty where there is none.
    language : of the document.
    said : says a text in that language.
    """
    time = Verbatim(at.astimezone(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"))
    head = say("Electronically signed by {name}", name=Verbatim(signer.name))
    facts = commas([part for part in (laboratory, accreditation, time) if part])
    mark = [say("TEST KEY: {note}.", note=TEST_NOTE)] if signer.test_key else []
    shown = picture("seal.typ", {
        "width": WIDTH_MM, "height": HEIGHT_MM, "language": language.split("-")[0].lower(),
        "lines": [str.__str__(said(head)), str.__str__(said(facts))],
        "mark": str.__str__(said(say("TEST"))) if signer.test_key else "",
    }, code_of(language))  # fmt: skip
    says = said(sentences([*mark, say("{head}: {facts}.", head=head, facts=facts)]))
    return Seal(shown, tuple(_place(i) for i in range(SEALS)), str.__str__(says))


def _place(number: int) -> tuple[float, float, float, float]:
    left = LEFT_MM + number * (WIDTH_MM + GAP_MM)
    return (left * _POINTS, BOTTOM_MM * _POINTS, (left + WIDTH_MM) * _POINTS, (BOTTOM_MM + HEIGHT_MM) * _POINTS)
