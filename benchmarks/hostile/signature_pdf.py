"""Attacks on PDF signatures: revisions behind them, bytes that belong to nothing, shadows, and ranges that cover less."""

from __future__ import annotations

import io
import random
import re
from collections.abc import Callable
from typing import Any

from asn1crypto import cms, core
from cryptography.hazmat.primitives.serialization import Encoding
from pyhanko.pdf_utils import generic
from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
from pyhanko.pdf_utils.reader import PdfFileReader
from pyhanko.sign.fields import SigFieldSpec, append_signature_field
from pyhanko.sign.signers import PdfTimeStamper
from pyhanko.sign.signers.pdf_byterange import DocumentTimestamp

from benchmarks.hostile.authorities import World
from cmm_uq.certificate.sign import sign_pdf
from cmm_uq.certificate.sign.found import appending, ran
from cmm_uq.certificate.sign.pdf_library import Server
from tests.certificate.sign.authority import SIGNED, curve_key, issued, root
from tests.certificate.sign.responders import revocations

TEXT = "U = 0.1 µm"
Attack = Callable[[World, random.Random], bytes]
Change = Callable[[IncrementalPdfFileWriter, random.Random], None]
NAME, TEXT_OF = generic.NameObject, generic.pdf_string


def _base(world: World, rng: random.Random) -> bytes:
    return world.signed("pdf", rng.choice(("B-B", "B-T", "B-LT", "B-LTA")))


def _dictionary(**pairs: Any) -> generic.DictionaryObject:
    return generic.DictionaryObject({NAME(f"/{key}"): value for key, value in pairs.items()})


def _stream(data: bytes, **pairs: Any) -> generic.StreamObject:
    return generic.StreamObject({NAME(f"/{key}"): value for key, value in pairs.items()}, stream_data=data)


def _revision(data: bytes, change: Change, rng: random.Random) -> bytes:
    writer, output = appending(data), io.BytesIO()  # which leaves metadata and the document's information as they are
    change(writer, rng)
    writer.write(output)
    return output.getvalue()


def _page(writer: IncrementalPdfFileWriter, rng: random.Random) -> generic.DictionaryObject:
    return writer.root["/Pages"]["/Kids"][0]  # type: ignore[no-any-return]


def drawn_over(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    writer.add_stream_to_page(0, writer.add_object(_stream(b"1 1 1 rg 0 0 600 900 re f")))


def content_replaced(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    page = _page(writer, rng)
    page[NAME("/Contents")] = writer.add_object(_stream(b"BT ET"))
    writer.update_container(page)


def content_redefined(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    """The same number, another stream: what a shadow attack hides or shows (Mainka et al. 2021)."""
    held = _page(writer, rng).raw_get("/Contents")
    number = held if isinstance(held, generic.IndirectObject) else held[0]
    writer.objects[(number.generation, number.idnum)] = _stream(b"BT ET")


def a_font_redefined(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    fonts = _page(writer, rng)["/Resources"]["/Font"]
    font = fonts[rng.choice(list(fonts))]
    font[NAME("/Encoding")] = NAME("/MacExpertEncoding")
    writer.update_container(font)


def pages_exchanged(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    kids = writer.root["/Pages"]["/Kids"]
    kids[0], kids[1] = kids.raw_get(1), kids.raw_get(0)
    writer.update_container(writer.root["/Pages"])


def _note(subtype: str) -> Change:
    def noted(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
        box = generic.ArrayObject(map(generic.NumberObject, (50, 50, 500, 700)))
        look = writer.add_object(
            _stream(b"1 1 1 rg 0 0 450 650 re f", Type=NAME("/XObject"), Subtype=NAME("/Form"), BBox=box)
        )
        note = writer.add_object(_dictionary(
            Type=NAME("/Annot"), Subtype=NAME(f"/{subtype}"), Rect=box, Contents=TEXT_OF(TEXT), F=generic.NumberObject(4),
            AP=_dictionary(N=look), T=TEXT_OF("A. Huber"),
        ))  # fmt: skip
        page = _page(writer, rng)
        page[NAME("/Annots")] = generic.ArrayObject([*page.get("/Annots", ()), note])
        writer.update_container(page)

    noted.__name__ = f"a_note_{subtype}"
    return noted


def _catalogue(key: str, value: Callable[[], Any]) -> Change:
    def changed(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
        writer.root[NAME(f"/{key}")] = value()
        writer.update_root()

    changed.__name__ = f"catalogue_{key}"
    return changed


def _script() -> generic.DictionaryObject:
    return _dictionary(S=NAME("/JavaScript"), JS=TEXT_OF("app.alert(1)"))


CATALOGUE = (
    _catalogue("Lang", lambda: TEXT_OF("tlh")), _catalogue("OpenAction", _script), _catalogue("AA", _script),
    _catalogue("Perms", lambda: _dictionary(DocMDP=_dictionary(Type=NAME("/Sig"), Reason=TEXT_OF(TEXT)))),
    _catalogue("MarkInfo", lambda: _dictionary(Marked=generic.BooleanObject(False))),
    _catalogue("Extensions", lambda: _dictionary(U=TEXT_OF(TEXT))), _catalogue("Version", lambda: NAME("/1.4")),
    _catalogue("PageMode", lambda: NAME("/UseAttachments")), _catalogue("U", lambda: TEXT_OF(TEXT)),
    _catalogue("OCProperties", lambda: _dictionary(D=_dictionary())), _catalogue("AF", generic.ArrayObject),
    _catalogue("Names", _dictionary), _catalogue("Outlines", _dictionary), _catalogue("StructTreeRoot", _dictionary),
    _catalogue("AcroForm", lambda: _dictionary(Fields=generic.ArrayObject(), NeedAppearances=generic.BooleanObject(True))),
    _catalogue("Legal", lambda: _dictionary(Attestation=TEXT_OF(TEXT))), _catalogue("Threads", generic.ArrayObject),
)  # fmt: skip


def title_changed(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    held = writer.trailer["/Info"]
    held[NAME(rng.choice(("/Title", "/Author", "/Subject", "/Keywords", "/U")))] = TEXT_OF(TEXT)
    writer.update_container(held)


def metadata_changed(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    old = writer.root["/Metadata"]
    new = old.data.replace(b"</rdf:RDF>", f"<!-- {TEXT} --></rdf:RDF>".encode())
    held = writer.root.raw_get("/Metadata")
    writer.objects[(held.generation, held.idnum)] = _stream(new, Type=NAME("/Metadata"), Subtype=NAME("/XML"))


def an_attachment_replaced(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    spec = writer.root["/AF"][rng.randrange(2)]
    held = spec["/EF"].raw_get("/F")
    writer.objects[(held.generation, held.idnum)] = _stream(TEXT.encode(), Type=NAME("/EmbeddedFile"))


def an_attachment_more(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    file = writer.add_object(_stream(TEXT.encode(), Type=NAME("/EmbeddedFile")))
    spec = writer.add_object(
        _dictionary(Type=NAME("/Filespec"), F=TEXT_OF("u.txt"), UF=TEXT_OF("u.txt"), EF=_dictionary(F=file))
    )
    names = writer.root["/Names"]["/EmbeddedFiles"]["/Names"]
    names.extend([TEXT_OF("u.txt"), spec])
    writer.update_root()


def an_object_that_nothing_refers_to(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    writer.add_object(rng.choice((TEXT_OF(TEXT), _dictionary(U=TEXT_OF(TEXT)), _stream(TEXT.encode()))))


def a_field_of_text(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    box = generic.ArrayObject(map(generic.NumberObject, (50, 50, 500, 700)))
    form = writer.root["/AcroForm"]
    field = writer.add_object(_dictionary(
        FT=NAME("/Tx"), T=TEXT_OF("u"), V=TEXT_OF(TEXT), Type=NAME("/Annot"), Subtype=NAME("/Widget"), Rect=box,
    ))  # fmt: skip
    form["/Fields"].append(field)
    writer.update_container(form)


def an_empty_field_of_a_signature(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    box = rng.choice((None, (50, 50, 500, 700)))
    append_signature_field(writer, SigFieldSpec("More", box=box, readable_field_name=TEXT))


def _store(writer: IncrementalPdfFileWriter, **more: Any) -> None:
    old = writer.root["/DSS"] if "/DSS" in writer.root else _dictionary()
    new = generic.DictionaryObject({key: old.raw_get(key) for key in old})
    for key, value in more.items():
        before = [*old[f"/{key}"]] if f"/{key}" in old and isinstance(value, generic.ArrayObject) else []
        new[NAME(f"/{key}")] = (
            generic.ArrayObject([*before, *value]) if isinstance(value, generic.ArrayObject) else value
        )
    writer.root[NAME("/DSS")] = writer.add_object(new)
    writer.update_root()


def _stranger(rng: random.Random) -> bytes:
    name = f"U = 0.{rng.randrange(1, 10)} µm"
    return rng.choice((root(name), issued(name, curve_key()))).certificate.public_bytes(Encoding.DER)


def a_stored_certificate_of_no_chain(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    _store(writer, Certs=generic.ArrayObject([writer.add_object(_stream(_stranger(rng)))]))


def a_stored_list_of_nobody(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    name = rng.choice(("Test Root", "Test Issuer", TEXT))
    _store(writer, CRLs=generic.ArrayObject([writer.add_object(_stream(revocations(root(name))))]))


def a_stored_text(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    kind = rng.choice(("Certs", "CRLs", "OCSPs"))
    _store(writer, **{kind: generic.ArrayObject([writer.add_object(_stream(TEXT.encode()))])})


def a_stream_in_the_store_with_a_text(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    signed = writer.prev.embedded_signatures[0].signer_cert.dump()
    _store(writer, Certs=generic.ArrayObject([writer.add_object(_stream(signed, U=TEXT_OF(TEXT)))]))


def more_behind_a_stored_certificate(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    signed = writer.prev.embedded_signatures[0].signer_cert.dump()
    _store(writer, Certs=generic.ArrayObject([writer.add_object(_stream(signed + TEXT.encode()))]))


def a_text_in_the_store(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    inner = (
        _dictionary(TU=TEXT_OF(TEXT))
        if rng.random() < 0.5
        else _dictionary(TS=writer.add_object(_stream(TEXT.encode())))
    )
    what = rng.choice(({"U": TEXT_OF(TEXT)}, {"VRI": generic.DictionaryObject({NAME("/" + "A" * 40): inner})}))
    _store(writer, **what)


def a_page_above_the_tree(writer: IncrementalPdfFileWriter, rng: random.Random) -> None:
    pages = writer.root["/Pages"]
    pages[NAME("/Rotate")] = generic.NumberObject(180)
    writer.update_container(pages)


CHANGES: tuple[Change, ...] = (
    drawn_over, content_replaced, content_redefined, a_font_redefined, pages_exchanged, *map(_note, (
        "Text", "FreeText", "Stamp", "Square", "Highlight", "Redact", "Widget", "Link", "FileAttachment", "Popup")),
    *CATALOGUE, title_changed, metadata_changed, an_attachment_replaced, an_attachment_more, an_object_that_nothing_refers_to,
    a_field_of_text, an_empty_field_of_a_signature, a_stored_certificate_of_no_chain, a_stored_list_of_nobody, a_stored_text,
    a_stream_in_the_store_with_a_text, more_behind_a_stored_certificate, a_text_in_the_store, a_page_above_the_tree,
)  # fmt: skip
"""Of a revision behind a signature."""


def _then_stamped(change: Change) -> Attack:
    """The change and then a time stamp of the document by anybody, of whom the reader may think that it vouches."""

    def attack(world: World, rng: random.Random) -> bytes:
        changed = _revision(_base(world, rng), change, rng)
        return changed if rng.random() < 0.5 else _stamp(world, changed, rng.choice(("stamps", "nobody")))

    return attack


def _stamp(world: World, data: bytes, server: str, box: Any = None, **said: str) -> bytes:
    """A time stamp of the document by a server, seen or unseen, with what its dictionary says."""
    first = DocumentTimestamp.__init__

    def more(self: Any, *arguments: Any, **keys: Any) -> None:
        first(self, *arguments, **keys)
        for key, value in said.items():
            self[NAME(f"/{key}")] = TEXT_OF(value)

    DocumentTimestamp.__init__ = more  # type: ignore[method-assign]
    try:
        writer = appending(data)
        if box is not None:
            append_signature_field(writer, SigFieldSpec("TimeStampSeen", box=box, readable_field_name=TEXT))
        stamper = PdfTimeStamper(Server(f"{world.url}/{server}"), field_name="TimeStampSeen" if box else "TimeStamp9")
        return ran(stamper.async_timestamp_pdf(writer, "sha256")).getvalue()  # type: ignore[no-any-return]
    finally:
        DocumentTimestamp.__init__ = first  # type: ignore[method-assign]


def a_stamp_of_nobody(world: World, rng: random.Random) -> bytes:
    return _stamp(world, _base(world, rng), "nobody")


def a_stamp_that_says_something(world: World, rng: random.Random) -> bytes:
    key = rng.choice(("Reason", "Location", "ContactInfo", "Name", "U"))
    return _stamp(world, _base(world, rng), "stamps", **{key: TEXT})


def a_stamp_that_is_seen(world: World, rng: random.Random) -> bytes:
    return _stamp(world, _base(world, rng), rng.choice(("stamps", "nobody")), (50, 50, 500, 700))


def signed_by_nobody_behind(world: World, rng: random.Random) -> bytes:
    """A further signature of somebody unknown, with a picture over the page."""
    other = issued("A. Huber", curve_key(), root())
    changed = _base(world, rng)
    if rng.random() < 0.5:
        changed = _revision(changed, rng.choice(CHANGES), rng)
    return sign_pdf(changed, other.signer, seal=None, at=SIGNED)


def _later(world: World, rng: random.Random) -> tuple[bytes, int]:
    """A PDF with revisions behind its signature, and where these begin."""
    data = world.signed("pdf", rng.choice(("B-LT", "B-LTA")))
    signed = PdfFileReader(io.BytesIO(data)).embedded_signatures[0]
    return data, int(signed.byte_range[2]) + int(signed.byte_range[3])


def _moved(data: bytes, at: int, more: bytes, stamped: bool = False) -> bytes:
    """Bytes put in, and every place behind them in tables and at the ends moved by as many."""

    def table(match: re.Match[bytes]) -> bytes:
        place = int(match[1])
        return b"%010d" % (place + len(more) if place >= at else place) + match[2]

    def place(match: re.Match[bytes]) -> bytes:
        old = int(match[2])
        return match[1] + b"%d" % (old + len(more) if old >= at else old)

    changed = data[:at] + more + data[at:]
    head, tail = changed[: at + len(more)], changed[at + len(more) :]
    tail = re.sub(rb"(\d{10})( 00000 n)", table, tail)
    return head + re.sub(rb"(startxref\s+|/Prev )(\d+)", place, tail)


HIDDEN = (
    f"\n{TEXT}\n".encode(), f"\n% {TEXT}\n".encode(), b"\n999 0 obj\n(U = 0.1 um)\nendobj\n", b"\n<</U (0.1 um)>>\n",
    b"\n12 0 obj\n<</Type/Page>>\nendobj\n", b"\nxref\n0 0\ntrailer\n<</U (0.1)>>\n", b"\nstartxref\n0\n", b"\n%%EOF\n",
    b"(U)", b"\n999 0 obj\n<</Length 9>>stream\nU = 0.1um\nendstream\nendobj\n",
)  # fmt: skip


def bytes_between_objects(world: World, rng: random.Random) -> bytes:
    """Where no object and no table stands; of a stamped document the stamp is made anew by whoever likes."""
    data, begin = _later(world, rng)
    places = [begin, *(match.end() for match in re.finditer(rb"endobj\s", data) if match.start() > begin),
              *(match.start() for match in re.finditer(rb"startxref", data) if match.start() > begin)]  # fmt: skip
    return _moved(data, rng.choice(places), rng.choice(HIDDEN))


def bytes_within_an_object(world: World, rng: random.Random) -> bytes:
    data, begin = _later(world, rng)
    places = [match.end() for match in re.finditer(rb"obj\s|<<\s|>>\s|endstream\s", data) if match.start() > begin]
    return _moved(
        data, rng.choice(places), rng.choice((f"% {TEXT}\n".encode(), b"(U = 0.1)\n", b"/U (0.1)\n", b"%U\r"))
    )


def bytes_between_objects_and_stamped(world: World, rng: random.Random) -> bytes:
    """Hidden in the revision of the evidence, and then stamped, so that a time stamp covers it."""
    data = world.signed("pdf", "B-LT")
    begin = PdfFileReader(io.BytesIO(data)).embedded_signatures[0]
    first = int(begin.byte_range[2]) + int(begin.byte_range[3])
    places = [first, *(match.end() for match in re.finditer(rb"endobj\s", data) if match.start() > first)]
    return _stamp(world, _moved(data, rng.choice(places), rng.choice(HIDDEN[:2])), rng.choice(("stamps", "nobody")))


def an_entry_taken_out_of_the_table(world: World, rng: random.Random) -> bytes:
    """An object that the table no longer has: free, at another place, or of another number."""
    data, begin = _later(world, rng)
    entries = [match for match in re.finditer(rb"(\d{10}) 00000 n", data) if match.start() > begin]
    entry = rng.choice(entries)
    new = rng.choice(
        (b"0000000000 65535 f", b"0000000017 00000 n", b"%010d 00000 n" % (int(entry[1]) + 1), b"9999999999 00000 n")
    )
    return data[: entry.start()] + new + data[entry.end() :]


def a_table_of_fewer(world: World, rng: random.Random) -> bytes:
    data, begin = _later(world, rng)
    parts = re.finditer(rb"\n([1-9]\d*) (\d+)\n(?=\d{10})", data)
    part = rng.choice([one for one in parts if one.start() > begin])
    first, count = int(part[1]), int(part[2])
    if count > 1:
        cut = data[: part.start()] + b"\n%d %d\n" % (first, count - 1) + data[part.end() :]
        return cut[: part.end()] + cut[part.end() + 20 :]
    return data[: part.start()] + data[part.end() - 1 + 20 :]


def a_trailer_that_says_more(world: World, rng: random.Random) -> bytes:
    data, begin = _later(world, rng)
    at = data.index(b"trailer\n<<", begin) + 10
    more = rng.choice((b"\n/U (0.1 um)", b"\n% U = 0.1\n", b"\n/Encrypt 3 0 R", b"\n/XRefStm 17", b"\n/Root 1 0 R"))
    return _moved(data, at, more)


def _contents(data: bytes) -> tuple[int, int]:
    signed = PdfFileReader(io.BytesIO(data)).embedded_signatures[0]
    return int(signed.byte_range[1]), int(signed.byte_range[2])


def a_range_that_covers_less(world: World, rng: random.Random) -> bytes:
    """Wrapping: the range of the signature moved, shortened, or with a gap (Mladenov et al. 2019)."""
    data = _base(world, rng)
    match = next(re.finditer(rb"/ByteRange \[\s*(\d+) (\d+) (\d+) (\d+)\s*\]", data))
    first, before, second, after = map(int, match.groups())
    new = rng.choice((
        (first, before - 10, second, after), (first, before, second + 10, after - 10), (first, before, second, after - 30),
        (10, before - 10, second, after), (first, before, second, 0), (0, 0, 0, 0), (first, before, second, after + 10**6),
        (0, before, 0, before),
    ))  # fmt: skip
    text = b"/ByteRange [" + b" ".join(b"%d" % one for one in new) + b" ]"
    return data[: match.start()] + text.ljust(len(match[0]))[: len(match[0])] + data[match.end() :]


def more_in_the_gap(world: World, rng: random.Random) -> bytes:
    """In the digits of the signature, which it cannot cover: behind its end, or instead of it."""
    data = _base(world, rng)
    begin, end = _contents(data)
    held = data[begin:end]
    size = len(held.rstrip(b">").rstrip(b"0"))
    text = TEXT.encode().hex().encode()
    new = rng.choice((
        held[: size + 4] + text + held[size + 4 + len(text) :], held[: -len(text) - 1] + text + b">",
        b"<" + b"0" * (len(held) - 2) + b">",
        held[:100] + b">" + b"/U (0.1)" + b" " * (len(held) - 109) , b"<>" + b" " * (len(held) - 2), b" " * len(held),
        held[:-9] + b">% U 0.1",
    ))  # fmt: skip
    return data[:begin] + new.ljust(len(held))[: len(held)] + data[end:]


def more_in_the_signature(world: World, rng: random.Random) -> bytes:
    """Certificates, attributes and lists in the CMS, which nothing signs (RFC 5652, 5)."""
    data = world.signed("pdf", rng.choice(("B-B", "B-T")))
    begin, end = _contents(data)
    info = cms.ContentInfo.load(bytes.fromhex(data[begin + 1 : end - 1].decode()))
    signed = info["content"]
    kind = rng.choice(("certificate", "attribute", "list", "signer"))
    if kind == "certificate":
        from asn1crypto import x509

        signed["certificates"].append(cms.CertificateChoices({"certificate": x509.Certificate.load(_stranger(rng))}))
    elif kind == "attribute":
        more = cms.CMSAttribute({"type": "1.2.3.4", "values": [core.UTF8String(TEXT)]})
        signed["signer_infos"][0]["unsigned_attrs"] = [*signed["signer_infos"][0]["unsigned_attrs"], more]
    elif kind == "list":
        from asn1crypto import crl

        held = crl.CertificateList.load(revocations(root(TEXT)))
        signed["crls"] = [cms.RevocationInfoChoice({"crl": held})]
    else:
        signed["signer_infos"].append(signed["signer_infos"][0].copy())
    new = b"<" + info.dump(force=True).hex().encode()
    if len(new) > end - begin - 1:
        return more_in_the_gap(world, rng)
    return data[:begin] + new.ljust(end - begin - 1, b"0") + b">" + data[end:]


def the_signature_again(world: World, rng: random.Random) -> bytes:
    """Universal forgery and stripping: the signature's dictionary emptied, doubled or its form taken away."""
    data = _base(world, rng)
    old, new = rng.choice((
        (b"/ByteRange", b"/ByteRangX"), (b"/Contents <30", b"/Contentx <30"),
        (b"/Filter /Adobe.PPKLite", b"/Filter /Adobe.PPKLitx"),
        (b"/ETSI.CAdES.detached", b"/adbe.pkcs7.detached"), (b"/ETSI.CAdES.detached", b"/adbe.pkcs7.sha1xxxx"),
        (b"/Type /Sig", b"/Type /Sib"),
        (b"/FT /Sig", b"/FT /Btn"),
    ))  # fmt: skip
    return data.replace(old, new, 1)


def one_byte(world: World, rng: random.Random) -> bytes:
    data = bytearray(_base(world, rng))
    begin, end = _contents(bytes(data))
    place = rng.choice(
        [rng.randrange(len(data)), rng.randrange(len(data)), rng.randrange(begin, min(end, begin + 3000))]
    )
    while bytes([data[place]]).isspace() or (chr(data[place]) in "0123456789abcdefABCDEF" and begin < place < end):
        place = rng.randrange(
            len(data)
        )  # letters of hexadecimal digits may be small or capital; white space is as other white space
    data[place] ^= 1 << rng.randrange(7)
    return bytes(data)


def behind_the_end(world: World, rng: random.Random) -> bytes:
    data = _base(world, rng)
    return data + rng.choice((*HIDDEN, b"%PDF-1.7\n", data, world.pdf, b"PK\x03\x04", b"\0" * 9 + b"U"))


def before_the_beginning(world: World, rng: random.Random) -> bytes:
    return rng.choice((b"U = 0.1\n", b"%PDF-1.7\n", b"\n", b"<html>")) + _base(world, rng)


def an_update_without_a_table(world: World, rng: random.Random) -> bytes:
    """Incremental saving: an object that is defined again, with a table, with none, or with that of before."""
    data = _base(world, rng)
    page = int(re.findall(rb"(\d+) 0 obj\s*<<[^<>]*/Type\s*/Page\b", data)[0])
    last = re.findall(rb"startxref\s+(\d+)", data)[-1]
    new = b"\n%d 0 obj\n<</Type/Page>>\nendobj\n" % page
    tail = rng.choice((
        b"", b"trailer\n<<>>\n", b"startxref\n%s\n%%%%EOF\n" % last,
        b"xref\ntrailer\n<</Prev %s>>\nstartxref\n%s\n%%%%EOF\n" % (last, last),
    ))  # fmt: skip
    return data + new + tail


PDF_ATTACKS: dict[str, Attack] = {f"revision_{one.__name__}": _then_stamped(one) for one in CHANGES} | {
    one.__name__: one for one in (
        a_stamp_of_nobody, a_stamp_that_says_something, a_stamp_that_is_seen, signed_by_nobody_behind, bytes_between_objects,
        bytes_within_an_object, bytes_between_objects_and_stamped, an_entry_taken_out_of_the_table, a_table_of_fewer,
        a_trailer_that_says_more, a_range_that_covers_less, more_in_the_gap, more_in_the_signature, the_signature_again,
        one_byte, behind_the_end, before_the_beginning, an_update_without_a_table,
    )
}  # fmt: skip
