"""A document as data: printable, numbered, and of whole rows."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, strategies as st

from cmm_uq.certificate.document import Column, Document, Table
from tests.certificate.samples import document_of


def test_every_document_is_json(certificate: Document) -> None:
    assert json.loads(json.dumps(certificate.as_data()))["date"] == "2004-06-03"


@given(text=st.text(st.characters()))
def test_no_control_character_surrogate_or_private_character_reaches_a_view(text: str) -> None:
    shown = document_of(text).as_data()["title"]
    shown.encode("utf-8")
    assert all(character == "\n" or character.isprintable() or ord(character) > 0x9F for character in shown)
    assert not any("\ue000" <= character <= "\uf8ff" for character in shown)


def test_marks_that_turn_figures_round_are_left_out() -> None:
    assert document_of("\u202e1.25\u202c").as_data()["title"] == "1.25"


def test_text_without_such_characters_is_kept_as_it_is() -> None:
    text = "Müller & Söhne <GmbH>\n中文 שלום µ ″ ± − ×"
    assert document_of(text).as_data()["title"] == text


def test_tables_and_figures_are_counted_through_the_document(certificate: Document) -> None:
    blocks = [block for section in certificate.as_data()["sections"] for block in section["blocks"]]
    assert [block["label"] for block in blocks if "label" in block] == [
        "Table 1", "Figure 1", "Figure 2", "Table 2", "Figure 3"
    ]  # fmt: skip


def test_a_row_has_as_many_cells_as_the_table_has_columns() -> None:
    with pytest.raises(ValueError, match="2 cells under 1 headings"):
        Table("Lengths", (Column("Length", "mm"),), (("404.2", "1.0"),))


def test_what_is_longer_than_any_figure_is_set_as_text() -> None:
    document = document_of("a sentence that is much longer than any figure")
    table = next(b for b in document.as_data()["sections"][0]["blocks"] if b["kind"] == "table")
    assert [column["numeric"] for column in table["columns"]] == [False, True]
    assert table["columns"][0]["need"] == 46
