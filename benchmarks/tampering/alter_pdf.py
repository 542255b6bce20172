"""Single alterations of PDFs: bytes, pages, attached files, metadata, what is appended. Knows nothing of the package."""

from __future__ import annotations

import io
import random
import re
import zlib
from collections.abc import Callable

import pikepdf

from benchmarks.tampering import alter_text
from benchmarks.tampering.alter_text import Altered


def packed_text(content: bytes, rng: random.Random) -> Altered:
    """A glyph in the text of a page: one byte of a packed stream, which is packed again, with lengths as they must be."""
    streams = list(re.finditer(rb"/Length (\d+)[^>]*>>\s*stream\r?\n", content))
    rng.shuffle(streams)
    for match in streams:
        raw = content[match.end() : match.end() + int(match[1])]
        try:
            data = zlib.decompress(raw)
        except zlib.error:
            continue
        places = [one.start() for one in re.finditer(rb"(?<=\\00)[0-7](?=[\\)])", data) if b" Tm[" in data]
        if places:
            at = rng.choice(places)
            new = rng.choice([digit for digit in b"1234567" if digit != data[at]])
            changed = data[:at] + bytes([new]) + data[at + 1 :]
            return _repacked(content, changed, match), f"glyph at {at} of the stream at {match.start()}"
    return alter_text.one_byte(content, rng)


def packed_number(content: bytes, rng: random.Random) -> Altered:
    """A digit of any packed stream: places, widths, characters of fonts, attached files."""
    streams = list(re.finditer(rb"/Length (\d+)[^>]*>>\s*stream\r?\n", content))
    rng.shuffle(streams)
    for match in streams:
        try:
            data = zlib.decompress(content[match.end() : match.end() + int(match[1])])
        except zlib.error:
            continue
        if re.search(rb"\d", data):
            new, what = alter_text.one_digit(data, rng)
            return _repacked(content, new, match), f"stream at {match.start()}, {what}"
    return alter_text.one_byte(content, rng)


def _repacked(content: bytes, data: bytes, match: re.Match[bytes]) -> bytes:
    """With a stream in place of another, the file written anew so that every place in it is right."""
    raw = zlib.compress(data)
    length = content[match.start() : match.end()].replace(
        b"/Length " + match[1], b"/Length " + str(len(raw)).encode(), 1
    )
    spoilt = content[: match.start()] + length + raw + content[match.end() + int(match[1]) :]
    try:
        with pikepdf.open(io.BytesIO(spoilt), attempt_recovery=True) as pdf:
            return _saved(pdf)
    except pikepdf.PdfError:
        return spoilt


def attached_digit(content: bytes, rng: random.Random) -> Altered:
    """A digit of an attached file, its size and checksum as they must be."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        name = rng.choice(list(pdf.attachments))
        data = pdf.attachments[name].get_file().read_bytes()
        how = rng.choice((alter_text.one_digit, alter_text.one_byte, alter_text.one_line))
        new, what = how(data, rng)
        spec = pdf.attachments[name]
        stream = spec.obj.EF.F
        stream.write(new)
        params = stream.get("/Params", pikepdf.Dictionary())
        if "/Size" in params:
            params.Size = len(new)
        if "/CheckSum" in params:
            del params["/CheckSum"]
        return _saved(pdf), f"attachment {name}, {what}"


def attached_changed(content: bytes, rng: random.Random) -> Altered:
    """An attached file removed, added, renamed, or there twice."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        name, how = rng.choice(list(pdf.attachments)), rng.choice(("removed", "added", "climbing", "twice", "renamed"))
        if how == "removed":
            del pdf.attachments[name]
        elif how == "added":
            pdf.attachments["more.csv"] = pikepdf.AttachedFileSpec(pdf, b"1,2\n", filename="more.csv")
        elif how == "climbing":
            pdf.attachments["../../x.csv"] = pikepdf.AttachedFileSpec(pdf, b"1,2\n", filename="../../x.csv")
        else:
            tree = pdf.Root.Names.EmbeddedFiles
            node = tree if "/Names" in tree else tree.Kids[0]
            at = next(i for i in range(0, len(node.Names), 2) if str(node.Names[i]) == name)
            if how == "twice":
                node.Names.insert(at, node.Names[at + 1])
                node.Names.insert(at, pikepdf.String(name))
            else:
                node.Names[at] = pikepdf.String(name + "x")
        return _saved(pdf), f"attachment {name} {how}"


def pages_changed(content: bytes, rng: random.Random) -> Altered:
    """Pages removed, exchanged, doubled."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        how, count = rng.choice(("removed", "exchanged", "doubled")), len(pdf.pages)
        at = rng.randrange(count)
        if how == "removed" and count > 1:
            del pdf.pages[at]
        elif how == "exchanged" and count > 1:
            other = (at + 1) % count
            pages = list(pdf.pages)
            pages[at], pages[other] = pages[other], pages[at]
            pdf.pages[at], pdf.pages[other] = pages[at], pages[other]
        else:
            pdf.pages.append(pdf.pages[at])
        return _saved(pdf), f"page {at + 1} {how}"


def active_content(content: bytes, rng: random.Random) -> Altered:
    """JavaScript, an action, a note over the page, an optional layer, a link outside."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        how, D, N = rng.choice(("script", "launch", "note", "layer", "link", "stamp")), pikepdf.Dictionary, pikepdf.Name
        page = pdf.pages[rng.randrange(len(pdf.pages))]
        box = pikepdf.Array([100, 100, 300, 200])
        if how == "script":
            pdf.Root.OpenAction = D(S=N.JavaScript, JS=pikepdf.String("app.alert(1)"))
        elif how == "launch":
            pdf.Root.OpenAction = D(S=N.Launch, F=pikepdf.String("x.exe"))
        elif how == "layer":
            pdf.Root.OCProperties = D(OCGs=pikepdf.Array([pdf.make_indirect(D(Type=N.OCG, Name=pikepdf.String("x")))]))
        else:
            kind = {"note": N.FreeText, "link": N.Link, "stamp": N.Stamp}[how]
            note = D(Type=N.Annot, Subtype=kind, Rect=box, Contents=pikepdf.String("U = 1"))
            if how == "link":
                note.A = D(S=N.URI, URI=pikepdf.String("https://example.org"))
            page.obj.Annots = pikepdf.Array([pdf.make_indirect(note)])
        return _saved(pdf), how


def covered(content: bytes, rng: random.Random) -> Altered:
    """A figure covered by a white field, another written over it, or text that nobody sees."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        at = rng.randrange(len(pdf.pages))
        how = rng.choice(("field", "invisible"))
        x, y = rng.randint(50, 400), rng.randint(50, 700)
        more = (
            f"q 1 1 1 rg {x} {y} 120 40 re f Q".encode()
            if how == "field"
            else b"q BT 3 Tr /f0 9 Tf (\\000\\001) Tj ET Q"
        )
        pdf.pages[at].contents_add(more)
        return _saved(pdf), f"page {at + 1}: {how}"


def told(content: bytes, rng: random.Random) -> Altered:
    """Title, subject or date in the file's information."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        key = rng.choice([key for key in ("/Title", "/Subject", "/CreationDate", "/Keywords") if key in pdf.docinfo])
        pdf.docinfo[key] = str(pdf.docinfo[key]) + "0"
        return _saved(pdf), f"information {key}"


def appended(content: bytes, rng: random.Random) -> Altered:
    """Bytes, a comment or a whole revision behind the end; or the end cut off."""
    how = rng.choice(("bytes", "comment", "revision", "cut"))
    if how == "cut":
        return content[: -rng.randint(1, 2000)], how
    if how == "revision":
        start = int(re.findall(rb"startxref\s+(\d+)", content)[-1])
        trailer = re.findall(rb"trailer\s*<<(.*?)>>\s*startxref", content, re.DOTALL)[-1]
        head = "\n9999 0 obj\n<< /More 1 >>\nendobj\n"
        at = len(content) + 1
        xref = f"xref\n9999 1\n{at:010d} 00000 n\r\ntrailer\n<<".encode()
        place = len(content) + len(head)
        more = head.encode() + xref + trailer + f" /Prev {start}>>\nstartxref\n{place}\n%%EOF\n".encode()
        return content + more, how
    return content + (b"%x\n" if how == "comment" else rng.randbytes(rng.randint(1, 40))), how


def resaved(content: bytes, rng: random.Random) -> Altered:
    """Written anew by another program, with nothing in it changed."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        return _saved(pdf), "saved by another program"


def _saved(pdf: pikepdf.Pdf) -> bytes:
    out = io.BytesIO()
    pdf.save(
        out, object_stream_mode=pikepdf.ObjectStreamMode.disable, deterministic_id=True, fix_metadata_version=False
    )
    return out.getvalue()


PDF: tuple[Callable[[bytes, random.Random], Altered], ...] = (
    alter_text.one_byte, alter_text.one_byte, packed_text, packed_text, packed_number, attached_digit, attached_digit,
    attached_changed, pages_changed, active_content, covered, told, appended, resaved,
)  # fmt: skip
