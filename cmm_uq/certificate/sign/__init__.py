"""Keys, electronic signatures of PDF (PAdES) and XML (XAdES), time stamps, and what is found of them in a file.

What it is made with comes with the extra ``cmm-uq[sign]`` and is imported when something is signed or checked.
"""

from __future__ import annotations

from cmm_uq.certificate.sign.found import AFTER, FileSignature, Trust, trust_of
from cmm_uq.certificate.sign.pdf import LEVELS, Level, Seal, Stamping, sign_pdf, signatures_of_pdf, signing_time
from cmm_uq.certificate.sign.signer import TEST_NOTE, Signer, signer_of_file, trial_key
from cmm_uq.certificate.sign.xml import sign_xml, signatures_of_xml

__all__ = [
    "AFTER", "LEVELS", "TEST_NOTE", "FileSignature", "Level", "Seal", "Signer", "Stamping", "Trust", "sign_pdf", "sign_xml",
    "signatures_of_pdf", "signatures_of_xml", "signer_of_file", "signing_time", "trial_key", "trust_of",
]  # fmt: skip
