"""Draws the pictures of docs/gallery.md: of each kind the artefact in its machine, of a part its points; and a first page.

    python -m benchmarks.examples.gallery [KIND ...]

Besides, for the README and the first page of the documentation: of the ballbar all pages of its certificate as one picture,
and figures of Python.

The artefact stands where a plan would put it first; a kind that is not planned is shown by its main figure. Needs pdftoppm.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

import cmm_uq

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "images" / "gallery"
DOTS_PER_INCH = 60
COLOURS = 24
CERTIFICATE, HEIGHT, GAP = ROOT / "docs" / "images" / "certificate.png", 720, 8  # all pages of one, px
LARGEST_BYTES = 60_000
EXAMPLES = {
    "ballbar": "iota-1102-20C",
    "bryan": "bryan-simulated",
    "step_gauge": "step-gauge-simulated",
    "gauge_blocks": "gauge-blocks-simulated",
    "plate": "plate-simulated",
    "plate_two_dates": "plate-two-dates-simulated",
    "triangle": "triangle-simulated",
    "sphere": "sphere-simulated",
    "ring": "ring-simulated",
    "plane": "plane-simulated",
    "digitizer": "digitizer-simulated",
    "scanned_planes": "scanned-planes-simulated",
    "axis_runs": "axis-runs-simulated",
    "multilateration": "multilateration-simulated",
    "tracked_points": "robot-simulated",
    "table_spheres": "table-spheres-simulated",
    "seat": "arm-seat-simulated",
    "shift": "shift-simulated",
    "shift_plate": "shift-plate-simulated",
    "error_map": "iota-1102-maps",
    "part": "part-plate-simulated",
}
FIGURES = {"ballbar": "ranking", "step_gauge": "trumpet"}
PLANNED = {"ballbar": "plan-ballbar", "step_gauge": "plan-step-gauge"}  # jobs that have no recording yet
LENGTHS = {"bryan": "\n[plan]\nlength_mm = 300.0\n", "gauge_blocks": "\n[plan]\nlengths_mm = [100.0, 300.0, 500.0]\n"}
NOT_PLANNED = ("plate_two_dates", "scanned_planes", "tracked_points", "seat", "shift_plate", "error_map", "part")
MAIN_FIGURE = {"part": 1}  # of the page, where it is not the first


def first_page(kind: str, folder: Path) -> None:
    """Write what the example's job gives, and draw the first page of its certificate."""
    if kind == "error_map":
        cmm_uq.diagnose(ROOT / "examples" / EXAMPLES[kind]).write(folder)
        return
    if kind == "part":
        cmm_uq.part(ROOT / "examples" / EXAMPLES[kind]).write(folder)
    else:
        cmm_uq.report(ROOT / "examples" / EXAMPLES[kind]).write(folder)
    (pdf,) = (*folder.glob("certificate*.pdf"), *folder.glob("part*.pdf"))
    first_page_of(pdf, PICTURES / f"{kind}.png")
    if kind == "ballbar":
        every_page_of(pdf, CERTIFICATE)


def first_page_of(pdf: Path, target: Path) -> None:
    """As a small picture in few colours."""
    picture = ["-r", str(DOTS_PER_INCH), "-f", "1", "-l", "1", "-png", "-singlefile"]
    subprocess.run(["pdftoppm", *picture, str(pdf), str(target.with_suffix(""))], check=True)
    Image.open(target).quantize(COLOURS).save(target, optimize=True)


def every_page_of(pdf: Path, target: Path) -> None:
    """A whole certificate as one picture: its first page large, the others beside it, in few colours."""
    with tempfile.TemporaryDirectory() as name:
        for size, root in ((HEIGHT, "large"), (HEIGHT // 2 - GAP // 2, "small")):
            subprocess.run(["pdftoppm", "-scale-to", str(size), "-png", str(pdf), str(Path(name) / root)], check=True)
        first = Image.open(sorted(Path(name).glob("large*"))[0])
        others = [Image.open(path) for path in sorted(Path(name).glob("small*"))[1:]]
        width, height = others[0].size
        columns = -(-len(others) // 2)
        sheet = Image.new("RGB", (first.width + columns * (width + GAP) + 2, HEIGHT + 2), "white")
        places = [(0, 0, first)] + [
            (first.width + GAP + (i % columns) * (width + GAP), (i // columns) * (height + GAP), page)
            for i, page in enumerate(others)
        ]
        for left, top, page in places:
            sheet.paste(page, (left + 1, top + 1))
            ImageDraw.Draw(sheet).rectangle(
                (left, top, left + page.width + 1, top + page.height + 1), outline="#c3ccd0"
            )
        sheet.quantize(COLOURS).save(target, optimize=True)


def figure(kind: str, name: str) -> None:
    target = CERTIFICATE.with_name(f"{name}.png")
    cmm_uq.report(ROOT / "examples" / EXAMPLES[kind]).plot(name).savefig(target, dpi=110)
    Image.open(target).convert("RGB").quantize(2 * COLOURS).save(target, optimize=True)


def placings(kind: str, folder: Path) -> None:
    """The first row of a plan's pictures, or the main figure of what was written for a kind that is not planned."""
    (page,) = folder.glob("*.html")
    if kind not in NOT_PLANNED:
        job = folder / "plan-of"
        shutil.copytree(ROOT / "examples" / PLANNED.get(kind, EXAMPLES[kind]), job, ignore=lambda _, names: [
            name for name in names if name.endswith(".csv")
        ])  # fmt: skip
        text = (job / "job.toml").read_text(encoding="utf-8")
        (job / "job.toml").write_text(
            text.replace('origin = "simulated"\n', "") + LENGTHS.get(kind, ""), encoding="utf-8"
        )
        page = cmm_uq.plan(job, power=False).write(folder / "plan")["plan.html"]
    drawn = re.findall(r"<svg.*?</svg>", page.read_text(encoding="utf-8"), re.DOTALL)[MAIN_FIGURE.get(kind, 0)]
    paper = re.sub(
        r"(<svg.*?>)", r'\1<rect width="100%" height="100%" fill="#fff"/>', drawn, count=1
    )  # for dark screens
    (PICTURES / f"{kind}.svg").write_text(paper + "\n", encoding="utf-8")


def main(kinds: list[str]) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    for kind in kinds or EXAMPLES:
        with tempfile.TemporaryDirectory() as name:
            first_page(kind, Path(name))
            placings(kind, Path(name))
        if kind in FIGURES:
            figure(kind, FIGURES[kind])
        sizes = {path.name: path.stat().st_size for path in sorted(PICTURES.glob(f"{kind}.*"))}
        assert max(sizes.values()) <= LARGEST_BYTES, sizes
        print(kind, sizes)


if __name__ == "__main__":
    main(sys.argv[1:])
