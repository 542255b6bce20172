"""Keys, a PDF of a report and a small DCC, made once."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

pytest.importorskip("pyhanko")
pytest.importorskip("signxml")

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa

from cmm_uq.certificate.render import render_pdf
from cmm_uq.certificate.sign import Trust
from tests.certificate.samples import ballbar_certificate
from tests.certificate.sign.authority import Held, curve_key, issued, root

XML = """<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.2.1">
  <dcc:administrativeData id="a">Prüfling</dcc:administrativeData>
  <si:real><si:value>73.2</si:value><si:unit>\\micro\\metre</si:unit></si:real>
</dcc:digitalCalibrationCertificate>
""".encode()


@pytest.fixture(autouse=True)
def no_loop_of_other_tests() -> Iterator[None]:
    """A browser that tests before these have opened keeps its loop running in this thread; others' programs here begin one."""
    before = asyncio._get_running_loop()
    asyncio._set_running_loop(None)
    yield
    asyncio._set_running_loop(before)


@pytest.fixture(scope="session")
def anchor() -> Held:
    return root()


@pytest.fixture(scope="session")
def rsa_key() -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(public_exponent=65537, key_size=2048)


@pytest.fixture(scope="session")
def held(anchor: Held, rsa_key: rsa.RSAPrivateKey) -> Held:
    """An RSA key of a laboratory, below an intermediate authority."""
    return issued("A. Huber", rsa_key, issued("Test Issuer", curve_key(), anchor, authority=True))


@pytest.fixture(scope="session")
def curve_held(anchor: Held) -> Held:
    return issued("B. Maier", curve_key(), anchor)


@pytest.fixture(scope="session")
def trust(anchor: Held) -> Trust:
    return Trust((anchor.certificate.public_bytes(serialization.Encoding.DER),))


@pytest.fixture(scope="session")
def pdf() -> bytes:
    """A certificate with two attachments: PDF/A-3a and PDF/UA-1."""
    return render_pdf(ballbar_certificate(), {"job.toml": b"[job]", "results.json": b"{}"})


@pytest.fixture(scope="session")
def xml() -> bytes:
    return XML
