"""What an export says of its measurement around the table, with its words; where two readings are left, without a value."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.jobs.importing.cells.stated import AIR, ARTEFACT, offers
from cmm_uq.jobs.importing.format import ImportKeys

HERE = Path(__file__).parent
TABLE = "\nPosition;Nominal [mm];Actual [mm]\n1;100;100.001\n1;200;200.002\n"


def said(text: str | bytes, name: str = "export.txt") -> dict[str, str]:
    content = text.encode() if isinstance(text, str) else text
    return {one.key: one.value for one in offers(content, name, ImportKeys())}


@pytest.mark.parametrize(
    ("head", "day"),
    [
        ("Datum: 15.12.2023", "2023-12-15"), ("Dátum:;2023.12.12.;Mérte: Szűcs G.", "2023-12-12"),
        ("検査年月日,2024/06/11,,,,製造番号,40091205", "2024-06-11"), ("校准员：王磊,,日期：,2024年4月22日", "2024-04-22"),
        ("측정자,김민수,,측정일,2024-08-19", "2024-08-19"), ("Дата: 17.04.2024", "2024-04-17"),
        ("Datum kalibratie: 7 februari 2024", "2024-02-07"), ("DATE : March 19 2024", "2024-03-19"),
        ("Date,8/29/2023 1:18:05 PM", "2023-08-29"), ("Date,19/06/2025,Job,UKV-4471", "2025-06-19"),
        ("Data: 05/08/2024", "2024-08-05"),  # no language but English has the month ahead of the day
        ("Date: 03/06/2025", ""), ("Date: 10-03-23", ""), ("Cal. due 8/14/2025", None),
        ("Certificato LAT 098 del 12/11/2024", None),
        ("Datum: 01.02.2024\nDatum: 02.02.2024", ""),
    ],
)  # fmt: skip
def test_a_date_is_offered_where_it_can_be_read_in_one_way(head: str, day: str | None) -> None:
    assert said(head + TABLE).get("job.date") == day


@pytest.mark.parametrize(
    ("head", "air", "artefact"),
    [
        ("temperatur_C = 20.4", "20.4", None), ("Temperature: 20.3 °C", "20.3", None),
        ("Temp (F):,68.3", "20.17", None), ("温度：,(20.0±0.4)℃", "20", None), ("Sıcaklık\t20,1 °C", "20.1", None),
        ("Temp. ambiente 20,3 C    Temp. campione 20,2 C", "20.3", "20.2"), ("Materialtemperatur: 20,14 °C", None, "20.14"),
        ("Temperature at start (C):,19.8,,Temperature at end (C):,20.1", "", None), ("Temperatur 19,8 °C … 20,3 °C", "", None),
        ("Reference temperature: 20 °C", None, None), ("Bezugstemperatur 20 °C", None, None),
        ("Teplota stroje 21,3 °C", None, None), ("# temp sphere 20.4", None, "20.4"), ("temp. płyty 20,3 °C", None, "20.3"),
        ("Temperature: 250 °C", None, None), ("Template no. 21", None, None),
        ("温度補正あり。測定値は20℃換算値。", None, None),
    ],
)  # fmt: skip
def test_a_temperature_is_offered_of_air_or_artefact(head: str, air: str | None, artefact: str | None) -> None:
    found = said(head + TABLE)
    assert (found.get(AIR), found.get(ARTEFACT)) == (air, artefact)


def test_machine_serial_number_and_limit_are_offered_and_those_of_the_artefact_are_not_the_machine_s() -> None:
    head = (
        "Машина: LK ALTERA 15.10.8   зав. № L21905\nЭталон: мера, зав. № 014\nMPE ±(1,8 + L/350) мкм\nU = 0,2 + L/900\n"
    )
    found = said(head + TABLE)
    assert found == {"machine.name": "LK ALTERA 15.10.8", "machine.serial": "L21905", "conformity.mpe": "1,8 + L/350"}
    assert "machine.serial" not in said("Object: Plate S/N 93-07      Machine: PMM-C 12.10.7\n" + TABLE)


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("development_exports/D22_ballplate_vertical.dmo", {"job.date": "2025-10-06", "machine.name": "COORD3 ARES 10.7.5"}),
        ("further_exports/S21_BALL_BEAM_800.DMO", {"job.date": "2022-03-15"}),
        ("further_exports/S15_KMG-UEB-07.dfq", {"job.date": "2021-06-03"}),
        ("form_exports/Z09_sfera.html", {AIR: "20.1", "job.date": "2024-03-06", "machine.name": "DEA Mistral 07.10.05",
                                         "machine.serial": "0832"}),
        ("development_exports/D11_wzorzec_schodkowy.xlsx", {"job.date": "2025-06-12", ARTEFACT: "20.1",
                                                            "conformity.mpe": "1,6 + L/333"}),
        ("development_exports/D24_Z_before_comp.rtl", {"job.date": "2025-05-08", AIR: "21.34", ARTEFACT: "21.02",
                                                       "machine.name": "HAAS VF-2SS", "machine.serial": "1139921"}),
        ("development_exports/D18_Lochplatte_chr.txt", {}),
    ],
)  # fmt: skip
def test_files_of_every_sort_say_it_in_their_own_way(file: str, expected: dict[str, str]) -> None:
    assert said((HERE / file).read_bytes(), Path(file).name) == expected


def test_a_hostile_head_takes_no_long_time_and_says_nothing() -> None:
    assert said("Date: " + "1." * 150 + "\n" + ("temp " * 70 + "\n") * 400 + TABLE) == {}


def test_the_serial_number_of_an_instrument_is_not_the_machine_s() -> None:
    found = said("Maschine;GROB G550;Achse;Y\nMessmittel;Laserinterferometer XL-80;SN;36H917\n" + TABLE)
    assert (found["machine.name"], found.get("machine.serial")) == ("GROB G550", None)
    found = said("Maschine;GROB G550;Masch.-Nr.;10-4471\nMessmittel;Laserinterferometer XL-80;SN;36H917\n" + TABLE)
    assert found["machine.serial"] == "10-4471"
