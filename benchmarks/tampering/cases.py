"""Cases of the study: which certificate, which of its files are given, and what single thing of them is altered.

A case follows from the seed and its number alone. The generator knows files, not the package.
"""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from benchmarks.tampering import alter_text
from benchmarks.tampering.alter_pdf import PDF
from benchmarks.tampering.signatures import OTHER, ROOT, spoilt, stripped

SEED = 20261122

SETS = (
    ("pdf",), ("pdf", "html"), ("pdf", "html", "results"), ("pdf", "html", "results", "xml"), ("html", "results", "inputs"),
)  # fmt: skip
"""What an auditor has: the PDF alone, with further forms, or everything but the PDF."""


SIGNED = "iota-1102-20C-signed"
"""The certificate that is signed; one case in eight is of it."""


@dataclass(frozen=True)
class Case:
    """An altered certificate.

    Parameters
    ----------
    number : of the case.
    base : name of the certificate.
    file : that was altered.
    form : of that file.
    how, what : name of the alteration, and what it did.
    files : that are given.
    trust : certificate of the authority that is trusted, of what is signed.
    """

    number: int
    base: str
    file: str
    form: str
    how: str
    what: str
    files: Mapping[str, bytes]
    trust: bytes | None = None


def form_of(name: str, inputs: set[str]) -> str:
    """Of a file of a report."""
    if name in inputs or name.endswith(".npz"):
        return "inputs"
    if name == "results.json":
        return "results"
    return {"pdf": "pdf", "html": "html", "xml": "xml"}.get(name.rpartition(".")[2], "other")


def case(number: int, bases: Mapping[str, Mapping[str, bytes]], seed: int = SEED) -> Case:
    """One of the study.

    Parameters
    ----------
    bases : files of each certificate, its inputs among them, by name.
    """
    rng = random.Random(f"{seed}:{number}")
    plain = sorted(set(bases) - {SIGNED})
    base = SIGNED if rng.random() < 1 / 8 else plain[rng.randrange(len(plain))]
    files = dict(bases[base])
    others = {name: files.pop(name) for name in list(files) if name.startswith(OTHER) or name == ROOT}
    inputs = set(json.loads(files["results.json"])["job"]["inputs_sha256"])
    given = rng.choice(SETS[:4] if base == SIGNED else SETS)
    forms = {name: form_of(name, inputs) for name in files}
    kept = {name: content for name, content in files.items() if forms[name] in given}
    asked = rng.choice([form for form in given if form in forms.values()])
    name = rng.choice(sorted(one for one in kept if forms[one] == asked))
    if asked == "inputs" and rng.random() < 0.4 and not name.endswith(".npz"):
        how, what, kept = _forged(name, kept, rng)
    else:
        alterations = {"pdf": PDF, "html": alter_text.HTML, "results": alter_text.JSON}.get(asked, alter_text.TEXT)
        if base == SIGNED and asked in ("pdf", "xml"):
            alterations = (*alterations, *(stripped, spoilt, _by_another(others[OTHER + name])) * 2)
        alteration = rng.choice(alterations)
        new, what = alteration(kept[name], rng)
        how, kept = alteration.__name__, {**kept, name: new}
    return Case(number, base, name, asked, how, what, kept, others.get(ROOT))


def _by_another(content: bytes) -> Callable[[bytes, random.Random], alter_text.Altered]:
    def signed_by_another(before: bytes, rng: random.Random) -> alter_text.Altered:
        return content, "signed by somebody else of the same name"

    return signed_by_another


def _forged(name: str, files: Mapping[str, bytes], rng: random.Random) -> tuple[str, str, dict[str, bytes]]:
    """An input altered, and its hash in results.json with it."""
    new, what = rng.choice((alter_text.one_digit, alter_text.one_line, alter_text.one_date))(files[name], rng)
    old, now = (hashlib.sha256(content).hexdigest().encode() for content in (files[name], new))
    return "forged_hash", what, {**files, name: new, "results.json": files["results.json"].replace(old, now)}
