"""What an export says of its measurement on the desk, what its lines are called, and what a test asks for besides."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from cmm_uq.app.desk.exports import read
from cmm_uq.app.desk.job_pages import read_page
from cmm_uq.app.desk.place import Draft
from cmm_uq.app.desk.questions import check_answers, create, fields, fields_for
from cmm_uq.artefacts import kind_named, names

HEAD = "Maschine: PRISMO 9   S/N 1178\nDatum: 15.12.2023\nTemperatur: 20,4 °C\nMPE: 1,9 + L/300 µm\n"
ROWS = [f"{line};{what};{at};{at}.0{k}1" for line, what in ((1, "X-Achse"), (2, "Diagonale A"), (3, "Diagonale B"))
        for k, at in enumerate((50, 150, 400))]  # fmt: skip
EXPORT = f"{HEAD}Linie;Bemerkung;Nennmaß [mm];Istmaß [mm]\n" + "\n".join(ROWS) + "\n"
PLACES = {"1": "along X from 10,500,-300", "2": "from 0,0,-600 to 700,1000,0", "3": "from 700,0,-600 to 0,1000,0"}


@pytest.fixture
def export(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("e.csv").write_text(EXPORT, encoding="utf-8")
    return "e.csv"


def test_date_machine_limit_and_temperature_begin_the_fields_with_their_words(export: str) -> None:
    found = {one["key"]: one for one in fields_for("gauge_blocks", export, {"lines": PLACES})}
    values = {key: one["value"] for key, one in found.items() if one["value"]}
    assert values == {
        "job.date": "2023-12-15", "machine.name": "PRISMO 9", "machine.serial": "1178",
        "conformity.mpe": "1,9 + L/300", "recording.constant.temp_air_c": "20.4",
    }  # fmt: skip
    assert found["recording.constant.temp_air_c"]["said"] == "20.4, by line 3: Temperatur: 20,4 °C"
    create("gauge_blocks", export, {"lines": PLACES}, {**values, "conformity.standard": "ISO 10360-2:2009",
                                                       "artefact.U_um": "0.2"}, "mine")  # fmt: skip
    job = tomllib.loads(Path("mine", "job.toml").read_text(encoding="utf-8"))
    assert job["recording"]["constant"] == {"temp_air_c": 20.4}


def test_a_temperature_of_the_artefact_is_shown_and_not_filled_in(export: str) -> None:
    Path(export).write_text(EXPORT.replace("Temperatur:", "Temperatur Endmaß:"), encoding="utf-8")
    found = {one["key"]: one for one in fields_for("gauge_blocks", export, {})}["recording.constant.temp_artefact_c"]
    assert (found["value"], found["said"]) == ("", "20.4, by line 3: Temperatur Endmaß: 20,4 °C")


def test_lines_are_asked_for_with_the_words_beside_them(export: str) -> None:
    asked = read(export, {})["lines"]
    assert asked == [
        ("1", "", "along X from 100,200,300", "X-Achse"),
        ("2", "", "from 100,200,300 to 500,600,700", "Diagonale A"),
        ("3", "", "from 100,200,300 to 500,600,700", "Diagonale B"),
    ]


def test_lines_at_the_very_same_place_are_told_and_lines_that_the_file_places_are_folded(export: str) -> None:
    keys = {"lines": {**PLACES, "3": PLACES["2"]}}
    assert read(export, {"lines": PLACES})["doubtful"] == []
    (told,) = read(export, keys)["doubtful"]
    assert told.startswith("Lines at the very same place: 2, 3 (from 0,0,-600 to 700,1000,0)")
    found = check_answers("gauge_blocks", export, keys, {"job.date": "2023-12-15", "machine.name": "M"})
    assert any("lines at the very same place: 2, 3" in text for text in found["warnings"])
    draft = Draft("d", export)
    given = dict(
        read_page(draft, {**read(export, {}), "lines": [("1", "along X from 0,0,0", "", ""), ("2", "", "", "")]}).values
    )
    assert [one[0] for one in given["asked"]] == ["2"]
    assert [one[0] for one in given["placed"]] == ["1"]


@pytest.mark.parametrize("kind", names())
def test_every_kind_that_a_standard_decides_has_a_list_of_them_and_fields_for_its_conditions(kind: str) -> None:
    found = {one["key"]: one for one in fields(kind)}
    tested = (kind_named(kind) or pytest.fail(kind)).tested
    assert ("conformity.standard" in found) == bool(tested)
    if tested:
        assert len(found["conformity.standard"]["options"]) > 1
        assert "rated_conditions.temperature_c" in found
        assert {"rated_conditions.declared.by", "rated_conditions.declared.reason"} <= {*found}
    if "conformity.mpe" in found:
        assert {"test_uncertainty.u_cte_per_k", "test_uncertainty.u_alignment_um"} <= {*found}


def test_check_says_what_a_test_will_lack_and_that_nothing_is_decided_without_a_standard(export: str) -> None:
    values = {"job.date": "2023-12-15", "machine.name": "M", "artefact.U_um": "0.2"}

    def warned(given: dict[str, str]) -> list[str]:
        found: list[str] = check_answers("gauge_blocks", export, {"lines": PLACES}, given)["warnings"]
        return found

    assert any("nothing will be decided" in text for text in warned(values))
    limits = {"conformity.standard": "ISO 10360-2:2009", "conformity.mpe": "900 + L/300"}
    (lacks,) = (text for text in warned(values | limits) if "lacks" in text)
    for what in (
        "space diagonal −X −Y +Z",
        "3 repetitions",
        "u_cte_per_k, u_temperature_k",
        "the temperatures for which",
    ):
        assert what in lacks
    more = {"rated_conditions.temperature_c": "18 to 22", "recording.constant.temp_air_c": "20.4",
            **{f"test_uncertainty.{key}": "0.1" for key in ("u_temperature_k", "u_alignment_um", "u_fixturing_um")},
            "test_uncertainty.u_cte_per_k": "1e-6"}  # fmt: skip
    (lacks,) = (text for text in warned(values | limits | more) if "lacks" in text)
    assert "rated" not in lacks
    assert "u_cte_per_k" not in lacks
