"""What laboratories call the columns of a recording, in English, German, French, Italian and Spanish.

A heading is a word for a column of a recording, or a letter of an axis among words that leave it a coordinate; any word that
is not known here makes it another column, which is left out and named as such.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from cmm_uq.jobs.importing.keys import WrittenUnit, unit_named
from cmm_uq.jobs.importing.recording import OPTIONAL, REQUIRED

NAME = "name"  # of the point or feature, by which it may be numbered; no column of a recording


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_PHRASES: Mapping[str, str] = {
    NAME: "name|feature|feature name|featurename|featureid|label|element|elementname|merkmal|bezeichnung|id|identifier|nr|no"
          "|number|nummer|numero|nome|nombre|nom|point name|punktname|point id|n|elemento|nombre del elemento|nom du point",
    "measurement": "measurement|measurement number|messung|messungsnummer|mess|mesure|misura|misurazione|medicion|position"
                   "|posicion|posizione|lage|aufstellung|stellung|setup|set up|placing|placement|bar position|stabstellung",
    "point": "point|pt|pkt|punkt|punto|kugel|ball|sphere|boule|bille|sfera|esfera|bola|face|flache|faccia|cara|hole|bohrung"
             "|trou|foro|agujero|point number|punktnummer",
    "repeat": "repeat|repetition|rep|run|wiederholung|wdh|durchlauf|lauf|ripetizione|repeticion|prova|essai",
    "reference_mm": "reference|reference length|reference value|certified|certified length|certified value|calibrated"
                    "|calibrated length|calibrated value|referenz|referenzlange|kalibrierwert|kalibrierte lange"
                    "|zertifizierte lange|longueur de reference|longueur certifiee|longueur etalonnee|valeur certifiee"
                    "|riferimento|lunghezza di riferimento|lunghezza certificata|valore certificato|referencia"
                    "|longitud de referencia|longitud certificada|valor certificado",
    "reference_u_um": "standard uncertainty|standardunsicherheit|standardmessunsicherheit|incertitude type|incertezza tipo"
                      "|incertidumbre tipica",
    "reference_U_um": "expanded uncertainty|uncertainty|measurement uncertainty|messunsicherheit|erweiterte messunsicherheit"
                      "|incertitude|incertitude elargie|incertezza|incertezza estesa|incertidumbre|incertidumbre expandida",
    "time_s": "time|elapsed|elapsed time|zeit|temps|tempo|tiempo",
    "temp_artefact_c": "temperature artefact|artefact temperature|part temperature|werkstucktemperatur|artefakttemperatur"
                       "|temperature de la piece|temperature piece|temperatura pezzo|temperatura del pezzo|temperatura pieza"
                       "|temperatura de la pieza",
    "temp_air_c": "air temperature|temperature air|ambient temperature|lufttemperatur|raumtemperatur|temperature de l air"
                  "|temperature ambiante|temperatura aria|temperatura dell aria|temperatura ambiente|temperatura del aire",
    "pressure_hpa": "pressure|air pressure|druck|luftdruck|pression|pressione|presion",
    "humidity_pct": "humidity|feuchte|luftfeuchte|humidite|umidita|humedad",
    "radius_mm": "radius|rayon|raggio|radio",
    "nx": "i|nx", "ny": "j|ny", "nz": "k|nz",
}  # fmt: skip
_COLUMNS = {phrase: column for column, phrases in _PHRASES.items() for phrase in phrases.split("|")}

_COORDINATE = _set(
    "coordinate coordinates coord koordinate koord coordonnee coordinata coordenada value wert valeur valore valor axis achse "
    "axe asse eje actual measured ist istwert gemessen messwert mesure mesuree misurato misurata medido medida position pos "
    "center centre mitte mittelpunkt centro point punkt punto ball kugel sphere boule bille sfera esfera p pt act ax "
    "kugelmitte"
)
"""Words beside the letter of an axis that leave it a coordinate."""

_NOMINAL = _set(
    "nominal nom soll sollwert theo theoretical theorique nominale teorico teorica target cad nennwert cible obiettivo"
)
_DEVIATION = _set("dev deviation abweichung abw ecart scostamento desviacion diff delta error err fehler tol")
_CERTIFIED = _set(
    "reference ref certified calibrated referenz kalibriert kalibrierwert zertifiziert certifie etalonne riferimento "
    "certificato referencia certificado"
)
_APPROACH = _set("approach anfahrrichtung antastrichtung anfahren approche approccio aproximacion direction richtung")
_TEMPERATURE = _set("temp temperature temperatur temperatura t scale massstab regle riga regla achse axis axe asse eje")
_NORMAL = _set("normal normale normala vector vektor vecteur vettore n")
_TIP = _set("tip taster stylus tastkopf palpeur tastatore palpador offset")
_SMALL = _set("no nr n number nummer numero num")
_LONGEST = 120  # characters of a heading; longer text is none

COVERAGE = re.compile(r"[\[(,;]?\s*\bk\s*=\s*(\d+(?:[.,]\d+)?)\s*[\])]?", re.IGNORECASE)
"""Coverage factor in a heading, as ``U (µm), k = 2``."""

# what certificates print above a column, beside its unit or its coverage factor
_SYMBOLS: Mapping[str, str] = {"U": "reference_U_um", "U95": "reference_U_um", "u": "reference_u_um"}
_FIGURES = frozenset("0123456789+-−.,")
_OWN = frozenset((*REQUIRED, *OPTIONAL))
_IN_BRACKETS = re.compile(r"\s*[\[(<{]\s*([^\])>}]*?)\s*[\])>}]\s*$")
_AFTER_SIGN = re.compile(r"\s*(?:/|\bin\b|,|:)\s*([^\s/,:]+)\s*$", re.IGNORECASE)
_AT_THE_END = re.compile(r"[\s_]+([^\s_]+)\s*$")
_WORDS = re.compile(r"[^\W\d_]+|\d+")


@dataclass(frozen=True)
class Heading:
    """A column's heading, understood; ``index``: number of the point in a row; ``odd_unit``: brackets that name none."""

    column: str | None = None
    index: int | None = None
    unit: WrittenUnit | None = None
    odd_unit: str = ""


@lru_cache(maxsize=4096)
def understood(heading: str) -> Heading:
    if heading in _OWN:
        return Heading(heading)
    if heading[:1] in _FIGURES or len(heading) > _LONGEST:
        return Heading()
    without = COVERAGE.sub(" ", heading)
    text, unit, odd = _without_unit(without)
    if text.strip() in _SYMBOLS and (unit is not None or without != heading):
        return Heading(_SYMBOLS[text.strip()], None, unit, odd)
    words = _words(text)
    indices = [int(word) for word in words if word.isdigit()]
    named = tuple(word for word in words if not word.isdigit())
    index = indices[0] if len(indices) == 1 else None
    if len(indices) > 1 or not named:
        return Heading(NAME, unit=unit) if text.strip() in ("#", "n°", "N°") else Heading(None, None, unit, odd)
    return Heading(_column(named), index, unit, odd)


def _without_unit(heading: str) -> tuple[str, WrittenUnit | None, str]:
    if match := _IN_BRACKETS.search(heading):
        unit = unit_named(match[1])
        return heading[: match.start()], unit, "" if unit else match[1]
    for pattern in (_AFTER_SIGN, _AT_THE_END):
        match = pattern.search(heading)
        if match and match.start() > 0 and (unit := unit_named(match[1])):
            return heading[: match.start()], unit, ""
    return heading, None, ""


def _words(text: str) -> list[str]:
    plain = unicodedata.normalize("NFKD", text.casefold())
    return _WORDS.findall("".join(c for c in plain if not unicodedata.combining(c)))


def _column(words: tuple[str, ...]) -> str | None:
    axes = [word for word in words if word in ("x", "y", "z")]
    if len(axes) == 1:
        others = {word for word in words if word != axes[0]}
        fitting = (column for known, column in _AXIS_COLUMNS if others <= known)
        return None if others & (_NOMINAL | _DEVIATION) else next(fitting, "").format(axis=axes[0]) or None
    return _COLUMNS.get(" ".join(words)) or _COLUMNS.get(" ".join(word for word in words if word not in _SMALL))


_AXIS_COLUMNS = (
    (_COORDINATE, "{axis}_mm"), (_COORDINATE | _CERTIFIED, "reference_{axis}_mm"),
    (_COORDINATE | _APPROACH, "approach_{axis}"),
    (_NORMAL, "n{axis}"), (_TEMPERATURE, "temp_{axis}_c"), (_TIP | _COORDINATE, "tip_{axis}_mm"),
)  # fmt: skip


def is_nominal(heading: str) -> bool:
    """Whether a heading names a nominal value."""
    return bool(set(_words(_without_unit(heading)[0])) & _NOMINAL)
