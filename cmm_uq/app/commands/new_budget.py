"""A new measurement model: a length at 20 °C, with every key of a model and of an input explained."""

from __future__ import annotations

import json

from cmm_uq.app.commands.schemas import shipped
from cmm_uq.jobs.toml_text import commented

FILE, SCHEMA, README = "budget.toml", ".cmm-uq/budget.schema.json", "README.md"

_MODEL = {
    "outputs": {"length": "indicated - gauge * cte * (temperature - 20)"}, "title": "Length at 20 °C",
    "units": {"length": "mm"},
}  # fmt: skip
_INPUTS = {
    "indicated": {"distribution": "normal", "value": 100.0021, "u": 0.0004, "unit": "mm", "source": "repeats"},
    "gauge": {"distribution": "constant", "value": 100.0, "unit": "mm", "source": "drawing"},
    "cte": {"distribution": "rectangular", "value": 11.5e-6, "half_width": 1e-6, "unit": "1/K", "source": "data sheet"},
    "temperature": {
        "distribution": "rectangular", "value": 20.4, "half_width": 0.2, "unit": "°C", "source": "thermometer",
    },
}  # fmt: skip


def budget_files() -> dict[str, bytes]:
    """Contents of every file of a new budget, by name; its figures are an example."""
    schema = json.loads(shipped("budget"))
    keys = schema["properties"]
    one = keys["inputs"]["additionalProperties"]
    inputs = [
        commented({"properties": {f"inputs.{name}": {**one, "description": "An input of the model."}}},
                  {f"inputs.{name}": given}, comment=i == 0)
        for i, (name, given) in enumerate(_INPUTS.items())
    ]  # fmt: skip
    model = commented({"properties": {"model": keys["model"]}}, {"model": _MODEL})
    head = (
        f"#:schema ./{SCHEMA}\n# An example: put in your own model and figures. What stands behind # is the default, "
        "or what may be said besides.\n"
    )
    correlation = f'# [correlation]  # {keys["correlation"]["description"]}\n# "indicated,temperature" = 0.0\n'
    readme = (
        "# A measurement model and its uncertainty\n\n"
        f"`cmm-uq budget {FILE}` in this folder evaluates it by the law of propagation and by Monte Carlo.\n\n"
        f"- `{FILE}`: outputs as expressions, and what is known of each input. The figures are an example.\n"
        f"- Editors that know TOML schemas explain every key (`{SCHEMA}`).\n"
    )
    text = "\n".join([head, model, *inputs, correlation])
    return {FILE: text.encode(), README: readme.encode(), SCHEMA: shipped("budget").encode()}
