"""Attacks on signatures, each by its number, and what is found of them; one in ten is a good signature, which must hold."""

from __future__ import annotations

import random
import traceback
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

from benchmarks.hostile.authorities import IMPOSTORS, Forged, World, world
from benchmarks.hostile.signature_pdf import PDF_ATTACKS
from benchmarks.hostile.signature_xml import XML_ATTACKS
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign import LEVELS, signatures_of_pdf, signatures_of_xml

GOOD = "good"
ATTACKS = [
    *(("xml", name) for name in XML_ATTACKS), *(("pdf", name) for name in PDF_ATTACKS),
    *((form, name) for name in IMPOSTORS for form in ("xml", "pdf")),
]  # fmt: skip
"""Every form and attack, in an order that does not change."""


def forged(of: World, form: str, name: str, rng: random.Random) -> Forged:
    """The file of an attack, and whom the reader trusts."""
    if name in IMPOSTORS:
        return IMPOSTORS[name](of, form)
    return (XML_ATTACKS if form == "xml" else PDF_ATTACKS)[name](of, rng), of.trust


def good(of: World, rng: random.Random) -> tuple[str, bytes]:
    """A file as it is signed."""
    if rng.random() < 0.3:
        return "xml", of.signed("xml")
    return "pdf", of.signed("pdf", rng.choice(LEVELS), rng.random() < 0.3)


def verdict(form: str, data: bytes, trust: Any) -> str:
    """What is found of a file: every signature good, not, none there, or refused; a fault is told whole."""
    try:
        found = (signatures_of_xml if form == "xml" else signatures_of_pdf)(data, trust)
    except CmmUqError:
        return "refused"
    except Exception:
        return traceback.format_exc()
    return "no signature" if not found else GOOD if all(one.good for one in found) else "not good"


def attacked(of: World, number: int, seed: int) -> dict[str, Any]:
    """The record of a case."""
    rng = random.Random(f"signatures:{seed}:{number}")
    if number % 10 == 9:
        form, data = good(of, rng)
        name, said, expected = "none", verdict(form, data, of.trust), True
    else:
        form, name = ATTACKS[(number - number // 10) % len(ATTACKS)]
        said, expected = verdict(form, *forged(of, form, name, rng)), False
    wrong = ["a fault"] if "Traceback" in said else []
    if not wrong and (said == GOOD) != expected:
        wrong = [f"{name} is taken for good" if said == GOOD else f"a good signature is {said}"]
    outcome = "fault" if wrong == ["a fault"] else said
    return {"number": number, "target": f"{form}: {'good' if expected else 'attacked'}", "what": name, "code": outcome,
            "found": wrong, "said": said if wrong else "", "ran": ""}  # fmt: skip


def run(seed: int, numbers: Iterable[int]) -> Iterator[dict[str, Any]]:
    """Records of cases; keys are new in each run of the study."""
    with world() as of:
        yield from map(partial(attacked, of, seed=seed), numbers)
