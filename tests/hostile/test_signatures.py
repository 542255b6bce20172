"""Every attack on a signature once, by authorities made here: none is taken for good, and what is good is."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

pytest.importorskip("pyhanko")
pytest.importorskip("signxml")

from benchmarks.hostile.authorities import World, world
from benchmarks.hostile.signatures import ATTACKS, GOOD, forged, verdict
from cmm_uq.certificate.sign import LEVELS

ALLOWED = {"not good", "refused", "no signature"}


@pytest.fixture(scope="module")
def of() -> Iterator[World]:
    with world() as made:
        yield made


@pytest.mark.long(but="xml-")
@pytest.mark.parametrize(("form", "name"), ATTACKS, ids=lambda each: each)
def test_an_attack_is_not_taken_for_good(form: str, name: str, of: World) -> None:
    assert verdict(form, *forged(of, form, name, random.Random(f"{form} {name}"))) in ALLOWED


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("twice", [False, True])
def test_a_good_signature_is_good(level: str, twice: bool, of: World) -> None:
    assert verdict("pdf", of.signed("pdf", level, twice), of.trust) == GOOD


def test_a_good_signature_of_a_digital_certificate_is_good(of: World) -> None:
    assert verdict("xml", of.signed("xml"), of.trust) == GOOD
