"""The laboratory's logo: a picture that is the same on every machine, runs nothing and asks for nothing outside its file."""

from __future__ import annotations

import base64
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Literal, NoReturn

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LOGO_BYTES, LOGO_ELEMENTS, LOGO_PIXELS
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.importing.cells.encodings import local, root_of
from cmm_uq.jobs.tables.identification import Laboratory

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_SVG = "{http://www.w3.org/2000/svg}"
# elements that draw, and what they draw with; letters are none: fonts differ from machine to machine
_DRAWING = frozenset({
    "svg", "g", "defs", "title", "desc", "metadata", "style", "path", "rect", "circle", "ellipse", "line", "polyline",
    "polygon", "image", "linearGradient", "radialGradient", "stop", "clipPath", "mask",
})  # fmt: skip
# of namespaces of drawing programs: their notes draw nothing
_EDITORS = ("inkscape", "sodipodi", "rdf-syntax", "purl.org/dc", "creativecommons.org", "ns.adobe.com")
_OUTWARD = re.compile(
    r"@import|@font-face|javascript:|expression\s*\(|url\s*\(\s*['\"]?\s*(?!['\"]?\s*#)|\\", re.IGNORECASE
)
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_EMBEDDED = "data:image/png;base64,"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of a PNG, by its type of colour


_Refuse = Callable[[str], NoReturn]
_FIX = "Export it as plain SVG with its texts as paths, or as PNG"


@dataclass(frozen=True)
class Logo:
    """A checked picture, with its format by its content."""

    format: Literal["svg", "png"]
    content: bytes

    @property
    def uri(self) -> str:
        """As a page carries it inside."""
        kind = {"svg": "svg+xml", "png": "png"}[self.format]
        return f"data:image/{kind};base64,{base64.b64encode(self.content).decode('ascii')}"


def logo_of(laboratory: Laboratory, inputs: Mapping[str, bytes]) -> Logo | None:
    """The logo among the inputs of a job, if it names one."""
    return checked_logo(inputs[laboratory.logo], laboratory.logo) if laboratory.logo in inputs else None


def checked_logo(content: bytes, where: str) -> Logo:
    """A picture, whatever its file is called."""
    if len(content) > LOGO_BYTES.most:
        raise CmmUqError(f"is larger than {LOGO_BYTES.most} bytes, a logo's most", where=where, fix=_FIX)
    if content.startswith(_SIGNATURE):
        _check_png(content, where)
        return Logo("png", content)
    if not content.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        raise CmmUqError("is neither SVG nor PNG", where=where, fix=_FIX)
    _check_svg(content, where)
    return Logo("svg", content)


def _check_png(content: bytes, where: str) -> None:
    """Whole to its last chunk, with as many pixels as its head says."""

    def refuse(why: str) -> NoReturn:
        raise CmmUqError(f"is no sound PNG: {why}", where=where, fix="Save it again as PNG")

    chunks = dict[bytes, bytes]()
    for name, data in _chunks(content, refuse):
        if name in (b"acTL", b"fcTL", b"fdAT"):
            refuse("it moves")
        chunks[name] = chunks.get(name, b"") + data
    if next(iter(chunks), b"") != b"IHDR" or len(chunks[b"IHDR"]) != 13 or b"IDAT" not in chunks:
        refuse("it has no head or no pixels")
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    if not (0 < width <= LOGO_PIXELS.most and 0 < height <= LOGO_PIXELS.most):
        refuse(f"it has {width} × {height} pixels, and {LOGO_PIXELS.most} are the most a side")
    if colour not in _CHANNELS or depth not in (1, 2, 4, 8, 16):
        refuse("its colours are of no known type")
    expected = height * (1 + (width * depth * _CHANNELS[colour] + 7) // 8)
    unpacked = zlib.decompressobj()
    try:
        found = len(unpacked.decompress(chunks[b"IDAT"], 2 * expected + 65536))
    except zlib.error:
        refuse("its pixels are damaged")
    if not unpacked.eof or (found != expected and not interlaced):
        refuse("it has not the pixels that its head says")


def _chunks(content: bytes, refuse: _Refuse) -> Iterator[tuple[bytes, bytes]]:
    at = len(_SIGNATURE)
    while at + 12 <= len(content):
        size = int.from_bytes(content[at : at + 4], "big")
        name, data = content[at + 4 : at + 8], content[at + 8 : at + 8 + size]
        if int.from_bytes(content[at + 8 + size : at + 12 + size], "big") != zlib.crc32(name + data):
            refuse("it was cut off or changed")
        yield name, data
        at += 12 + size
        if name == b"IEND":
            break
    else:
        refuse("it was cut off")
    if at != len(content):
        refuse("something follows its end")


def _check_svg(content: bytes, where: str) -> None:
    """Shapes and gradients alone, of a size."""

    def refuse(why: str) -> NoReturn:
        raise CmmUqError(f"is no logo: {why}", where=where, fix=_FIX)

    if re.search(rb"<\?(?!xml\s)", content):
        refuse("it has an instruction to a program")
    root = root_of(content, where)
    if root.tag != f"{_SVG}svg":
        refuse("its root is no svg")
    _proportion(root, refuse)
    elements = list(root.iter())
    if len(elements) > LOGO_ELEMENTS.most:
        refuse(f"it has {len(elements)} elements, and {LOGO_ELEMENTS.most} are the most")
    for element in elements:
        _check_element(element, refuse, where)


def _check_element(element: Element, refuse: _Refuse, where: str) -> None:
    name, space = local(element), str(element.tag).rpartition("}")[0]
    if f"{space}}}" != _SVG and not any(editor in space for editor in _EDITORS):
        refuse(f"it has a <{name}> that is no SVG")
    if f"{space}}}" == _SVG and name not in _DRAWING:
        lettering = name in ("text", "tspan", "font")
        why = "whose font other machines may not have" if lettering else "which a logo does not need"
        refuse(f"it has a <{name}>, {why}")
    if name == "style" and _OUTWARD.search(element.text or ""):
        refuse("its style refers to something outside the file")
    for key, value in element.attrib.items():
        plain = key.rpartition("}")[2].lower()
        if plain.startswith("on"):
            refuse(f"it has a script ({plain})")
        if plain in ("href", "src") and not value.startswith("#"):
            if name != "image" or not value.startswith(_EMBEDDED):
                refuse(f"it refers to {value[:40]!r}, outside the file")
            _check_png(_decoded(value.removeprefix(_EMBEDDED), refuse), where)
        elif _OUTWARD.search(value):
            refuse(f"its {plain} refers to something outside the file")


def _decoded(text: str, refuse: _Refuse) -> bytes:
    try:
        return base64.b64decode("".join(text.split()), validate=True)
    except ValueError:
        refuse("a picture inside it is damaged")


def _proportion(root: Element, refuse: _Refuse) -> None:
    """Width over height must be known, and that of something that can stand beside an address."""
    sizes = [float(each) for each in re.findall(r"-?\d*\.?\d+(?:[eE][-+]?\d+)?", root.get("viewBox", ""))][2:4]
    if not sizes:
        given = [re.match(r"\d*\.?\d+", root.get(key, "")) for key in ("width", "height")]
        sizes = [float(each[0]) for each in given if each]
    if len(sizes) != 2 or min(sizes) <= 0 or not 0.05 <= sizes[0] / sizes[1] <= 20:
        refuse("it has no width and height, or is a strip")
