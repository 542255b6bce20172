"""A certificate with every kind of block, and text that nobody wants to print."""

from __future__ import annotations

import datetime as dt

import numpy as np

from cmm_uq.certificate.document import (
    Column,
    DecisionBlock,
    Document,
    Facts,
    Paragraph,
    Plot,
    Section,
    Signature,
    Table,
)
from cmm_uq.certificate.plots.corner import corner_plot
from cmm_uq.certificate.plots.residuals import length_plot, volume_plot

HOSTILE = (
    '<script>alert(\'x\')</script> "q" & {{ 7*7 }} {% raw %} #panic("x") $x^2$ *b* _i_ @ref <label> \\u{41} `c` // d '
    "</style> שלום مرحبا éüłő"
)
"""Markup of HTML, Jinja, CSS and Typst, quotes, and two scripts that run from right to left."""

UNBREAKABLE = "W" * 180

NUMBER = "IOTA-1102-20C"


def plots() -> tuple[Plot, Plot, Plot]:
    """The three pictures of a ballbar certificate, of twenty made-up lengths."""
    random = np.random.default_rng(7)
    middle = random.uniform([200, 150, -350], [700, 400, -150], size=(20, 3))
    direction = random.standard_normal((20, 3))
    half = 202.0 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    before, after = random.normal(0, 75, 20), random.normal(0, 12, 20)
    lengths = length_plot(
        np.arange(1, 21), before, after, expanded_before_um=8.0, expanded_after_um=8.0,
        reference="certified length 404.2357 mm", reference_expanded_um=3.0, flagged=np.arange(20) == 4,
        caption="Deviation from the certified length.", alternative="Twenty deviations in two panels.",
    )  # fmt: skip
    volume = volume_plot(
        middle - half, after, end_mm=middle + half, travel_mm=[[0, 900], [0, 550], [-500, 0]],
        caption="Residuals in the volume.", alternative="Three projections of twenty bars.",
    )  # fmt: skip
    names = (
        [f"Scale {axis}" for axis in "XYZ"] + [f"Squareness {pair}" for pair in ("XY", "YZ", "ZX")] + ["Length", "σ"]
    )
    corner = corner_plot(
        random.standard_normal((4000, 8)), names, units=["ppm"] * 3 + ["″"] * 3 + ["mm", "µm"],
        caption="Posterior.", alternative="Eight densities and their pairs.",
    )  # fmt: skip
    return lengths, volume, corner


def ballbar_certificate() -> Document:
    """A ballbar certificate of four pages or so with every kind of block."""
    lengths, volume, corner = plots()
    conformity = Section(
        "Conformity",
        (
            DecisionBlock("ASME B89.4.1-1997", "Range of the lengths", "339.9 µm, U = 8.4 µm", "60.0 µm",
                     "ISO 14253-1, guard band 8.4 µm", "fail", "The range lies beyond the limit."),
            DecisionBlock("ISO 10360-2:2009", "Largest error", "4.4 µm, U = 6.1 µm", "4.6 µm", "simple acceptance", "pass",
                     "The error lies within the limit."),
            DecisionBlock("VDI/VDE 2617", "Largest error", "4.4 µm, U = 6.1 µm", "4.6 µm", "ISO 14253-1", "undecided",
                     "The difference is smaller than the uncertainty."),
            DecisionBlock("ISO 10360-2:2009", "Largest error", "1.1 µm, U = 0.4 µm", "4.6 µm", "ISO 14253-1", "incomplete",
                     "The lengths measured conform.", ("space diagonal +X −Y +Z", "81 of 105 lengths")),
        ),
    )  # fmt: skip
    effects = Table(
        "Estimated effects",
        (Column("Effect", numeric=False), Column("Estimate"), Column("U (k = 2)"), Column("Unit", numeric=False)),
        (
            ("Scale X", "78.1", "27.4", "ppm"),
            ("Squareness XY", "−174.8", "14.1", "″"),
            ("Noise σ", "12.5", "3.5", "µm"),
        ),
        ("U is the expanded uncertainty, coverage probability 95 %.",),
    )
    measured = Table(
        "Measured lengths",
        (Column("Position"), Column("Length", "mm"), Column("Deviation", "µm"), Column("Remark", numeric=False)),
        tuple((str(k), f"{404.1 + k / 170:.4f}", f"{k * 7.3 - 60:.1f}".replace("-", "−"), "flagged" if k == 5 else "")
              for k in range(1, 41)),
    )  # fmt: skip
    results = (effects, lengths, volume, measured, corner, Paragraph("Sampling has converged.", "note"),
               Paragraph("12.7 µm stay unexplained.", "warning"), Paragraph("Temperatures rose by 0.2 °C."))  # fmt: skip
    traceability = (Facts((("Artefact", "Ballbar 404.2357 mm at 20 °C"), ("Expansion", "12.0 × 10⁻⁶ K⁻¹"))),)
    return Document(
        title="Calibration certificate",
        number=NUMBER,
        subject="DEA Iota 1102, calibrated on 1 June 2004",
        issuer=("Laboratory for Dimensional Metrology", "401 Sunset Avenue", "Windsor, Ontario"),
        particulars=(
            Facts((("Customer", "Müller & Söhne GmbH\nIndustriestraße 12"), ("Order", "2004-118"))),
            Facts((("Item", "DEA Iota 1102"), ("Travel", "X 0 … 900 mm"))),
            Facts((("Method", "Ballbar in 20 positions"), ("Temperature", "20.0 °C ± 0.5 °C"))),
        ),
        warnings=("The bar's own calibration has no date.", "Screening flagged position 5; it was kept."),
        sections=(conformity, Section("Results", results), Section("Traceability", traceability)),
        statements=("The results relate only to the items calibrated.", "Not to be reproduced except in full."),
        signatures=(Signature("Dr. H. Harris", "Head of laboratory"), Signature("J. Doe")),
        attachments=("job.toml", "ballbar.csv", "results.json"),
        produced_by="cmm-uq 0.1.0, seed 0",
        date=dt.date(2004, 6, 3),
    )


def document_of(text: str) -> Document:
    """A document that says one text wherever text can stand."""
    column = Column(text, text)
    blocks = (
        Paragraph(text), Paragraph(text, "warning"), Paragraph(text, "note"), Facts(((text, text),)),
        Table(text, (column, Column("n")), ((text, "2.0"), ("a", "1.0")), (text,)),
        DecisionBlock(text, text, text, text, text, "incomplete", text, (text, text)),
    )  # fmt: skip
    return Document(
        title=text, number=text, subject=text, issuer=(text, text), particulars=(Facts(((text, text),)),),
        warnings=(text,), sections=(Section(text, blocks),), statements=(text,), signatures=(Signature(text, text),),
        attachments=(text,), produced_by=text, end=text,
    )  # fmt: skip
