"""No document of any example has a word that cannot be translated: each is a message, or the user's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from cmm_uq.analysis.conformity.plans import READY
from cmm_uq.analysis.conformity.standards import BUILT_IN
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import translated as said_in
from cmm_uq.base.messages import Message, Number, Text, Verbatim, say
from cmm_uq.base.units import Unit, unit
from cmm_uq.certificate.document import Column, Document, Paragraph, Plot, Section, Table
from cmm_uq.certificate.origin import NAME, marked
from cmm_uq.certificate.pages.budget import budget_document
from cmm_uq.jobs.job import JobFacts
from cmm_uq.jobs.tables.artefact import Traceability
from cmm_uq.jobs.tables.identification import Laboratory, ReplacedCertificate as Replaced
from cmm_uq.jobs.tables.machine import MachineFacts
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.kinematics import PARAMETRIC_ERRORS
from cmm_uq.maths.uncertainty.budgets.tables import TABLES
from cmm_uq.maths.uncertainty.models.model_file import ModelFile, read_model_file
from cmm_uq.maths.uncertainty.models.ready import READY as MODELS
from tests.artefacts.simulated import diagnosed, document, planned
from tests.catalogues import TRANSLATED
from tests.certificate.saying import figures, leaves, strangers, untranslated
from tests.conftest import MACHINE_JOBS, ROOT
from tests.maths.uncertainty.test_ready_budget import BALLBAR, LENGTH, PROBING, SIMULATED, SPHERE, USE, ready

EXAMPLES = [path.name for path in MACHINE_JOBS]
KEYS = [
    f"[{table}] {key}"
    for table, keys in (("job", JobFacts), ("laboratory", Laboratory), ("machine", MachineFacts),
                        ("artefact.certificate", Traceability), ("job.replaces", Replaced))
    for key in keys.model_fields
]  # fmt: skip
"""Of job.toml, as warnings name them."""
SAMPLER = "emcee affine-invariant ensemble sampler exact draws"


def known_to(folder: Path) -> str:
    """The user's own words, and names that are the same in every language: of effects, parameters, standards, the program."""
    own = [path.name + "\n" + path.read_text(encoding="utf-8") for path in folder.iterdir() if path.is_file()]
    effects = [
        " ".join((name, *(p.name for p in effect.reported), *effect.columns)) for name, effect in every().items()
    ]
    decided = [one.name for standard in BUILT_IN.values() for one in standard.characteristics]
    symbols = [*(error.vdi for error in PARAMETRIC_ERRORS), "XY YZ ZX Fmax Fmin"]
    return "\n".join([*own, *effects, *READY, *decided, *symbols, *KEYS, NAME, SAMPLER])


def documents(name: str) -> list[Document]:
    """All that the commands make of an example."""
    found = []
    for make, recorded in ((document, True), (diagnosed, True), (planned, False)):
        try:
            found.append(marked(make(name), read_job(ROOT / "examples" / name, recorded=recorded)))
        except CmmUqError:  # what this kind does not offer, or needs a recording
            continue
    return found


def units(document: Document) -> Iterator[str]:
    """What stands where tables have units: under a heading, and in the cells of a column of units."""
    for table in (block for section in document.sections for block in section.blocks if isinstance(block, Table)):
        for place, column in enumerate(table.columns):
            yield column.unit
            yield from (row[place] for row in table.rows if column.heading == "Unit")


@pytest.mark.long(but="triangle")
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_text_of_every_document_is_a_message_or_the_user_s(name: str) -> None:
    made, known = documents(name), known_to(ROOT / "examples" / name)
    assert made
    assert {document.title: strangers(document, known) for document in made} == {
        document.title: [] for document in made
    }
    assert [text for document in made for text in units(document) if not isinstance(text, Unit) and text] == []
    assert all(sum(isinstance(text, Message) for text in leaves(document)) > 5 for document in made)


@pytest.mark.long(but="triangle")
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_document_is_translated_whole_with_the_same_figures(name: str) -> None:
    """Where English counts in words, Japanese may write a digit, and no language leaves a figure out."""
    for made in documents(name):
        assert [untranslated(made, code) for code in TRANSLATED] == [set()] * len(TRANSLATED)
        for text in (text for text in leaves(made) if isinstance(text, Text)):
            said = {code: figures(said_in(text, code)) for code in TRANSLATED}
            assert said["de"] == said["fr"] == figures(text), text
            assert not figures(text) - said["ja"], text
            assert set(said["ja"] - figures(text)) <= set("123456789"), text


def test_the_page_of_a_model_file_is_translatable_too(tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(MODEL, encoding="utf-8")
    model = read_model_file(file)
    document = budget_document(model, model.evaluate(), file.name)
    assert strangers(document, MODEL + file.name + model.sha256 + NAME) == []


@pytest.mark.parametrize("name", sorted(TABLES))
def test_the_page_of_every_ready_budget_is_translatable(tmp_path: Path, name: str) -> None:
    text = next(text for text in (USE, SIMULATED, LENGTH, PROBING, BALLBAR, SPHERE) if f'"{name}"' in text)
    assert foreign_words(tmp_path, text) == []


@pytest.mark.parametrize("name", sorted(MODELS))
def test_the_page_of_every_ready_model_is_translatable_with_units_of_the_table(tmp_path: Path, name: str) -> None:
    wanted = [one for one, needed in MODELS[name].inputs.items() if needed]
    inputs = {one: (100.0 if one.endswith("_mm") else 20.0 if one.endswith("_c") else 1e-5, 1e-6) for one in wanted}
    assert foreign_words(tmp_path, ready(name, inputs)) == []


def foreign_words(folder: Path, text: str) -> list[str]:
    """Words of the page of a file that cannot be translated, and units that are not of the table."""
    file = folder / "file.toml"
    file.write_text(text, encoding="utf-8")
    model = read_model_file(file)
    evaluation = model.evaluate()
    document = budget_document(model, evaluation, file.name)
    inputs = model.labels.units if isinstance(model, ModelFile) else ("xy", "yz", "zx")
    known = " ".join([text, file.stem, file.name, model.sha256, NAME, *evaluation.stated, *inputs])
    # a name too long for a picture is cut there; it stands whole in the table beside it
    odd = [one for one in strangers(document, known) if not one.endswith("…")]
    return odd + [one for one in units(document) if not isinstance(one, Unit) and one]


MODEL = """
[model]
title = "Length of a bar"
outputs = { y = "x1**2 + x2**2 * x3" }
[inputs.x1]
distribution = "normal"
value = 0.05
u = 0.005
unit = "mm"
source = "certificate 123"
[inputs.x2]
distribution = "rectangular"
low = 0.0
high = 0.1
[inputs.x3]
distribution = "t"
samples = [1.0, 1.1, 0.9, 1.05]
[correlation]
"x1,x2" = 0.5
"""

PLAIN = Document(
    title=say("Plan"), number=Verbatim("7"), subject=say("of {machine}", machine=Verbatim("Iota")), issuer=(), particulars=(),
    warnings=(), sections=(), statements=(), signatures=(), attachments=(), produced_by=say("by nobody"),
)  # fmt: skip
WORD = "length"


@pytest.mark.parametrize("block", [
    Paragraph(f"one {WORD} more"),  # type: ignore[arg-type]
    Paragraph(say("see {what}", what=f"one {WORD} more")),  # type: ignore[arg-type]
    Paragraph(Verbatim(f"one {WORD} more")),
    Paragraph(Number(f"one {WORD} more")),
    Table(say("Lengths"), (Column(say("Name")),), ((f"one {WORD} more",),)),  # type: ignore[arg-type]
    Table(say("Lengths"), (Column(f"one {WORD} more"),), ()),  # type: ignore[arg-type]
    Plot(say("Lengths"), say("A line."), f"<svg><text x='1'>one {WORD} more</text></svg>"),
])  # fmt: skip
def test_an_f_string_anywhere_in_a_document_would_be_found(block: Paragraph | Table | Plot) -> None:
    assert strangers(PLAIN, "Iota") == []
    assert strangers(replace(PLAIN, sections=(Section(say("Results"), (block,)),)), "Iota") == (
        ["see one length more"]
        if isinstance(block, Paragraph) and block.text.startswith("see")
        else ["one length more"]
    )


def test_what_the_user_wrote_stands_as_it_is() -> None:
    page = replace(PLAIN, subject=Verbatim("one length more"))
    assert strangers(page, "customer = 'one length more'") == []


def test_the_words_in_a_picture_are_messages() -> None:
    drawing = "<svg><text>Error / µm</text><text>−0.5</text></svg>"
    plot = Plot(say("Curve"), say("A curve."), drawing, (say("Error / {unit}", unit=unit("µm")),))
    assert strangers(replace(PLAIN, sections=(Section(say("Results"), (plot,)),)), "Iota") == []
