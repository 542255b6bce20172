"""What an SVG draws, read back from it."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np

from cmm_uq.base.points import Floats

SVG = "{http://www.w3.org/2000/svg}"


class Drawing:
    """Paths with their styles, and texts, of a picture."""

    def __init__(self, svg: str) -> None:
        self.root = ET.fromstring(svg)
        self.paths = [(_style(path), path.get("d", "")) for path in self.root.iter(f"{SVG}path")]
        self.texts = ["".join(text.itertext()) for text in self.root.iter(f"{SVG}text")]
        self.marks = [(float(use.get("x", "")), float(use.get("y", ""))) for use in self.root.iter(f"{SVG}use")]

    def drawn(self, **style: str) -> list[str]:
        """Data of the paths whose style holds all of these (underscore for hyphen)."""
        wanted = {name.replace("_", "-"): value for name, value in style.items()}
        return [data for found, data in self.paths if wanted.items() <= found.items()]


def _style(path: ET.Element) -> dict[str, str]:
    parts = (part.split(":") for part in path.get("style", "").split(";") if ":" in part)
    return {name.strip(): value.strip() for name, value in parts}


def strokes(data: str) -> Floats:
    """(n, 2, 2) first and last point of every stroke of a path, pt."""
    return np.array([[outline[0], outline[-1]] for outline in outlines(data)])


def outlines(data: str) -> list[Floats]:
    """Points of every subpath, each (n, 2), pt."""
    pieces = [piece for piece in data.split("M") if piece.strip()]
    return [np.array([float(n) for n in re.findall(r"-?\d+(?:\.\d+)?", piece)]).reshape(-1, 2) for piece in pieces]


def area(data: str) -> float:
    """Area inside a path's outlines, holes taken away, pt²."""
    total = 0.0
    for points in outlines(data):
        x, y = points.T
        total += 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    return abs(total)
