"""A signed certificate, an authority that vouches for its signer, and what may be done to a signature.

The keys are made for the study and kept beside its certificates.
"""

from __future__ import annotations

import datetime as dt
import random
import re
from pathlib import Path

from benchmarks.tampering.alter_text import Altered

AT = dt.datetime(2026, 3, 2, 9, 30, tzinfo=dt.UTC)
ROOT, OTHER = "root.pem", "signed-by-another"
"""Of the authority that is trusted, and the beginning of the names of what another one's signer signed."""


def signed(folder: Path, made: Path) -> None:
    """Put PDF and DCC of a report into a folder, signed by somebody known, and by somebody else."""
    from cmm_uq.certificate.sign import sign_pdf, sign_xml
    from tests.certificate.sign.authority import curve_key, issued, root

    anchor = root()
    folder.mkdir(parents=True, exist_ok=True)
    for signer, before in (
        (issued("A. Huber", curve_key(), anchor), ""),
        (issued("A. Huber", curve_key(), root()), OTHER),
    ):
        pdf, xml = ((made / f"certificate.{form}").read_bytes() for form in ("pdf", "xml"))
        (folder / f"{before}certificate.pdf").write_bytes(sign_pdf(pdf, signer.signer, seal=None, at=AT))
        (folder / f"{before}certificate.xml").write_bytes(sign_xml(xml, signer.signer, at=AT))
    for name in ("certificate.html", "results.json"):
        (folder / name).write_bytes((made / name).read_bytes())
    (folder / ROOT).write_bytes(anchor.pem)


def stripped(content: bytes, rng: random.Random) -> Altered:
    """Without its signature."""
    if content.startswith(b"%PDF"):
        return content[: content.index(b"%%EOF") + 5], "signature stripped"
    return re.sub(rb"<ds:Signature .*</ds:Signature>\s*", b"", content, flags=re.DOTALL), "signature stripped"


def spoilt(content: bytes, rng: random.Random) -> Altered:
    """One digit of the signature itself."""
    begin = rb"/Contents\s*<" if content.startswith(b"%PDF") else rb"<ds:Signature "
    start = list(re.finditer(begin, content))[-1].end()
    found = [match.start() for match in re.finditer(rb"[0-9]", content[start : start + 3000])]
    at = start + rng.choice(found)
    new = rng.choice([digit for digit in b"0123456789" if digit != content[at]])
    return content[:at] + bytes([new]) + content[at + 1 :], f"digit of the signature at {at}"
