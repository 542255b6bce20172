"""A logo is a picture and nothing else: it runs nothing, asks for nothing, and is the same on every machine."""

from __future__ import annotations

import base64
import shutil
import struct
import zlib
from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.certificate.verify.opened import read_html
from cmm_uq.jobs.logo import checked_logo
from tests.conftest import ROOT


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(width: int = 4, height: int = 2, rows: int | None = None, *further: bytes) -> bytes:
    """A red PNG with so many rows of pixels."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = (b"\0" + b"\xc0\x10\x20" * width) * (height if rows is None else rows)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + b"".join(further) + chunk(b"IDAT", zlib.compress(pixels))
            + chunk(b"IEND", b""))  # fmt: skip


def svg(inside: str = "", more: str = 'viewBox="0 0 60 20"') -> bytes:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" {more}>'
        f'<rect width="60" height="20" fill="#125"/>{inside}</svg>'
    ).encode()


EMBEDDED = base64.b64encode(png()).decode()


@pytest.mark.parametrize(("content", "form"), [
    (png(), "png"), (svg(), "svg"), (svg(more='width="60mm" height="20mm"'), "svg"),
    (svg('<linearGradient id="a"/><path fill="url(#a)" d="M0 0h9"/>'), "svg"),
    (svg(f'<image width="9" height="9" xlink:href="data:image/png;base64,{EMBEDDED}"/>'), "svg"),
    (b'<?xml version="1.0" encoding="UTF-8"?>\n' + svg(), "svg"),
])  # fmt: skip
def test_the_format_is_that_of_the_content(content: bytes, form: str) -> None:
    assert checked_logo(content, "logo").format == form


@pytest.mark.parametrize(("content", "why"), [
    (b"GIF89a", "neither SVG nor PNG"), (b"", "neither SVG nor PNG"), (b"<html></html>", "its root is no svg"),
    (png()[:-5], "cut off"), (png() + b"<script>", "follows its end"), (png().replace(b"IDAT", b"IDAX"), "cut off or changed"),
    (png(5000, 1), "5000 × 1 pixels"), (png(rows=1), "has not the pixels"), (png(rows=90_000), "has not the pixels"),
    (png(4, 2, None, chunk(b"acTL", b"\0" * 8)), "moves"),
    (svg("<script>alert(1)</script>"), "<script>"), (svg('<path onload="a()"/>'), "a script (onload)"),
    (svg("<foreignObject/>"), "<foreignObject>"), (svg("<animate/>"), "<animate>"), (svg("<text>A</text>"), "font"),
    (svg('<use xlink:href="#a"/>'), "<use>"), (svg('<image href="https://a.example/b.png"/>'), "outside the file"),
    (svg('<image href="data:image/svg+xml;base64,AAAA"/>'), "outside the file"),
    (svg('<image href="data:image/png;base64,AAAA"/>'), "no sound PNG"),
    (svg('<path fill="url(http://a.example/#b)"/>'), "outside the file"),
    (svg('<style>@import "a.css";</style>'), "outside the file"), (svg("<style>path{fill:url('b.svg#c')}</style>"), "outside"),
    (svg('<h:p xmlns:h="http://www.w3.org/1999/xhtml"/>'), "no SVG"),
    (svg(more=""), "no width and height"), (svg(more='viewBox="0 0 600 2"'), "a strip"), (svg("<path/>" * 5001), "elements"),
    (b'<?xml version="1.0"?><?xml-stylesheet href="a"?>' + svg(), "instruction"),
    (b'<!DOCTYPE svg [<!ENTITY a "b">]>' + svg(), "entities"), (svg("<path"), "damaged XML"),
    (b"<svg>" + b" " * 500_000, "larger than 500000 bytes"),
])  # fmt: skip
def test_what_can_do_more_than_be_looked_at_is_refused(content: bytes, why: str) -> None:
    with pytest.raises(CmmUqError, match="logo") as refused:
        checked_logo(content, "logo.svg")
    assert why in str(refused.value)


@pytest.mark.long
@pytest.mark.parametrize("content", [png(), svg()], ids=["png", "svg"])
def test_it_stands_at_the_head_of_both_views_and_is_an_input(tmp_path: Path, content: bytes) -> None:
    job = tmp_path / "job"
    shutil.copytree(ROOT / "examples" / "sphere-simulated", job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(
        text + '\n[laboratory]\nname = "Metrology Ltd"\nlogo = "logo.svg"\n', encoding="utf-8"
    )
    with pytest.raises(CmmUqError, match=r"logo\.svg"):
        read_job(job)
    (job / "logo.svg").write_bytes(content)
    outcome = outcome_of(analyse(job))
    assert "logo.svg" in outcome.results["job"]["inputs_sha256"]
    page = read_html(render_html(outcome.document).encode(), "certificate.html")
    assert page.pictures == [content]
    assert not page.problems
    made = render_pdf(outcome.document, {})
    assert made == render_pdf(outcome.document, {})
    assert (b"/Subtype /Image" in made or b"/Subtype/Image" in made) == (content == png())
