"""Keys on a PKCS#11 token, here SoftHSM: they sign PDF and XML, and never leave it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign import Trust, sign_pdf, sign_xml, signatures_of_pdf, signatures_of_xml
from cmm_uq.certificate.sign.signer import place_of, signer_of_token
from tests.certificate.sign.authority import SIGNED, Held, named

MODULES = (
    "/usr/lib/softhsm/libsofthsm2.so",
    "/usr/lib64/pkcs11/libsofthsm2.so",
    "/usr/local/lib/softhsm/libsofthsm2.so",
)
PIN, TOKEN = "4711-4711", "LABORATORY"


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory, held: Held, curve_held: Held) -> Iterator[str]:
    """A token with an RSA and an ECDSA key, and its module."""
    found = next((path for path in MODULES if Path(path).exists()), None)
    if found is None or shutil.which("softhsm2-util") is None:
        pytest.skip("no SoftHSM is installed")
    folder = tmp_path_factory.mktemp("token")
    (folder / "tokens").mkdir()
    (folder / "softhsm2.conf").write_text(f"directories.tokendir = {folder / 'tokens'}\nlog.level = ERROR\n")
    os.environ["SOFTHSM2_CONF"] = str(folder / "softhsm2.conf")

    def softhsm(*arguments: str) -> None:
        done = subprocess.run(
            ["softhsm2-util", *arguments, "--token", TOKEN, "--pin", PIN], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    subprocess.run(["softhsm2-util", "--init-token", "--free", "--label", TOKEN, "--so-pin", PIN, "--pin", PIN],
                   check=True, capture_output=True)  # fmt: skip
    for number, (label, each) in enumerate((("rsa", held), ("curve", curve_held))):
        key = folder / f"{label}.pem"
        key.write_bytes(each.key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                                               serialization.NoEncryption()))  # fmt: skip
        softhsm("--import", str(key), "--label", label, "--id", f"a{number}")
        key.unlink()
        _put(found, label, each)
    yield found
    del os.environ["SOFTHSM2_CONF"]


def _put(module: str, label: str, held: Held) -> None:
    """The certificate of a key, beside it."""
    import pkcs11
    from pkcs11 import Attribute, CertificateType, ObjectClass

    with pkcs11.lib(module).get_token(token_label=TOKEN).open(rw=True, user_pin=PIN) as session:
        session.create_object({
            Attribute.CLASS: ObjectClass.CERTIFICATE, Attribute.CERTIFICATE_TYPE: CertificateType.X_509,
            Attribute.TOKEN: True, Attribute.LABEL: label,
            Attribute.SUBJECT: named(label).public_bytes(),
            Attribute.VALUE: held.certificate.public_bytes(serialization.Encoding.DER),
        })  # fmt: skip


def uri(module: str, label: str, token: str = TOKEN) -> str:
    return f"pkcs11:token={token};object={label}?module-path={module}"


@pytest.mark.parametrize("label", ["rsa", "curve"])
def test_a_key_on_a_token_signs(label: str, module: str, pdf: bytes, xml: bytes, trust: Trust, held: Held) -> None:
    """The RSA key's issuer is in no file here: it is trusted by itself."""
    signer = signer_of_token(uri(module, label), PIN)
    everybody = Trust((*trust.anchors, held.chain[0].public_bytes(serialization.Encoding.DER)))
    (of_pdf,) = signatures_of_pdf(sign_pdf(pdf, signer, seal=None, at=SIGNED), everybody)
    (of_xml,) = signatures_of_xml(sign_xml(xml, signer, at=SIGNED), everybody)
    assert of_pdf.good
    assert of_xml.good
    assert of_pdf.name == {"rsa": "A. Huber", "curve": "B. Maier"}[label]


def test_an_rsa_token_gives_the_bytes_that_the_key_in_a_file_gives(module: str, held: Held) -> None:
    assert signer_of_token(uri(module, "rsa"), PIN).signed(b"content") == held.signer.signed(b"content")


@pytest.mark.parametrize(("label", "token", "pin", "why"), [
    ("rsa", TOKEN, "0000-0000", "the PIN does not open the token"),
    ("rsa", "OTHER", PIN, "no token 'OTHER' is there"),
    ("other", TOKEN, PIN, "the token has no key 'other'"),
])  # fmt: skip
def test_what_is_wrong_is_named_and_the_pin_is_not(label: str, token: str, pin: str, why: str, module: str) -> None:
    with pytest.raises(CmmUqError, match=why) as refused:
        signer_of_token(uri(module, label, token), pin)
    assert pin not in str(refused.value)


def test_a_module_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "module.so").write_text("nothing")
    with pytest.raises(CmmUqError, match="the token cannot be used"):
        signer_of_token(uri(str(tmp_path / "module.so"), "rsa"), PIN)


@pytest.mark.parametrize(("given", "why"), [
    ("pkcs11:token=A;object=B", "says no module-path"),
    ("pkcs11:token=A;objekt=B?module-path=m", "'objekt' is not known"),
    ("pkcs11:token=A;object=B?module-path=m&pin-value=1234", "a PIN does not stand on the command line"),
])  # fmt: skip
def test_a_place_that_is_none_is_refused(given: str, why: str) -> None:
    with pytest.raises(CmmUqError, match=why) as refused:
        place_of(given)
    assert "1234" not in str(refused.value)
