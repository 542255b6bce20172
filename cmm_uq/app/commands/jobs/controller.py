"""Tables by which a controller corrects the positions of its axes, of runs that position them.

All forms take the deviation itself, actual less target, and the controller subtracts it. LinuxCNC's ``COMP_FILE_TYPE = 0`` has
actual positions by direction of travel. A positive value of SINUMERIK moves the axis in the negative direction (Function
Manual K3, measuring system error compensation). In the TwinCAT CNC's example of ``kw.ssfk`` a setpoint of 19866.7 µm with an
actual position of 19856.5 has −102 (0.1 µm). Of rotary axes degrees stand for millimetres. A template is given both signs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.model import recorded_model, refuse_unmeasured
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.identification import SIMULATED
from cmm_uq.maths.geometry.positioning import DOWN, UP, MissingReadingError, PositioningRuns

PROVENANCE = "controller.json"
_MILLIMETRE, _DEGREE, _FINEST = (
    1e-3,
    1 / 3600,
    1e4,
)  # of a µm, and of a second; steps of the TwinCAT CNC in a mm or a degree


@dataclass(frozen=True, eq=False)
class AxisTable:
    """Deviations of one axis, actual less target, µm or ″, zero at the target nearest to a reading of zero."""

    axis: str
    targets: Floats  # (t,) readings, mm or °
    forward: Floats  # (t,) reached in the positive direction
    reverse: Floats  # (t,) reached in the negative direction, the same where all came from one side

    @property
    def angular(self) -> bool:
        return self.axis not in AXES

    @property
    def unit(self) -> float:
        """Millimetres in a µm, or degrees in a second."""
        return _DEGREE if self.angular else _MILLIMETRE

    @classmethod
    def of(cls, axis: str, runs: PositioningRuns, origin_mm: Floats) -> AxisTable:
        targets = runs.targets + (0.0 if runs.angular else origin_mm[AXES.index(axis)])
        forward, reverse = runs.mean[UP], runs.mean[DOWN if runs.both else UP]
        zero = 0.5 * (forward + reverse)[int(np.argmin(np.abs(targets)))]
        return cls(axis, targets, forward - zero, reverse - zero)


def linuxcnc(tables: list[AxisTable]) -> dict[str, str]:
    """A file an axis: nominal, actual in the positive, actual in the negative direction, mm or °."""
    return {
        f"{one.axis}.comp": "".join(
            f"{at:.6f} {at + one.unit * up:.6f} {at + one.unit * down:.6f}\n"
            for at, up, down in zip(one.targets, one.forward, one.reverse, strict=True)
        )
        for one in tables
    }


def sinumerik(tables: list[AxisTable]) -> dict[str, str]:
    """Mean of both directions at equal steps, mm or °."""
    lines = ["%_N_AX_EEC_INI", "CHANDATA(1)"]
    for one in tables:
        name, steps = f"{one.axis.upper()}1", np.diff(one.targets)
        count = int(np.ceil(np.ptp(one.targets) / steps.min() - 1e-6)) + 1
        places = np.linspace(one.targets[0], one.targets[-1], count)
        values = one.unit * np.interp(places, one.targets, 0.5 * (one.forward + one.reverse))
        lines += [f"$AA_ENC_COMP[0,{i},{name}]={value:.6f}" for i, value in enumerate(values)]
        lines.append(f"$AA_ENC_COMP_STEP[0,{name}]={places[1] - places[0]:.6f}")
        lines += [f"$AA_ENC_COMP_MIN[0,{name}]={places[0]:.6f}", f"$AA_ENC_COMP_MAX[0,{name}]={places[-1]:.6f}"]
        lines.append(f"$AA_ENC_COMP_IS_MODULO[0,{name}]=0")
    return {"AX_EEC.INI": "\n".join([*lines, "M17", ""])}


def twincat(tables: list[AxisTable]) -> dict[str, str]:
    """A list an axis, both directions, 0.1 µm or 0.0001°."""
    files = {}
    for one in tables:
        lines = [
            f"kopf.log_achs_name {one.axis.upper()}",
            "kw.ssfk.interval 0",
            "kw.ssfk.unit 1",
            "kw.ssfk.bilateral 1",
        ]
        start = round(one.targets[0] * _FINEST)
        lines += [f"kw.ssfk.kw_startpos {start}", f"kw.ssfk.kw_nr_max {len(one.targets)}"]
        columns = (("setpoint", one.targets), ("pos", one.unit * one.forward), ("neg", one.unit * one.reverse))
        for name, values in columns:
            lines += [f"kw.ssfk.table[{i}].{name} {round(_FINEST * value)}" for i, value in enumerate(values)]
        files[f"achskw_{one.axis}.lis"] = "\n".join([*lines, ""])
    return files


FORMS: Mapping[str, Callable[[list[AxisTable]], dict[str, str]]] = {
    "linuxcnc": linuxcnc,
    "sinumerik": sinumerik,
    "twincat": twincat,
}


def filled(template: Path, tables: list[AxisTable]) -> dict[str, str]:
    """A template of the user's own: ``axes``, each with name, targets, deviations and corrections (their negative)."""
    from jinja2 import StrictUndefined, TemplateError
    from jinja2.sandbox import SandboxedEnvironment

    text = content_of(template, JOB_BYTES, f"Name one of {', '.join(FORMS)}, or a file").decode("utf-8-sig", "replace")
    axes = [
        {
            "name": one.axis,
            "targets_deg" if one.angular else "targets_mm": one.targets.tolist(),
            **{f"{way}_deviation_{of}": values.tolist() for way, values in ways(one)},
            **{f"{way}_correction_{of}": (-values).tolist() for way, values in ways(one)},
        }
        for one, of in ((one, "arcsec" if one.angular else "um") for one in tables)
    ]
    try:
        made = SandboxedEnvironment(undefined=StrictUndefined, keep_trailing_newline=True).from_string(text)
        return {f"axes{template.suffix or '.txt'}": made.render(axes=axes)}
    except (TemplateError, TypeError, ValueError, OverflowError) as error:
        raise CmmUqError(f"the template cannot be filled: {error}", where=str(template), fix="Mend it") from error


def ways(table: AxisTable) -> tuple[tuple[str, Floats], tuple[str, Floats]]:
    return ("forward", table.forward), ("reverse", table.reverse)


def held_out_um(runs: PositioningRuns) -> dict[str, float]:
    """Root mean square of each repeat's deviations as read, corrected by the others', and by these with the sign reversed."""
    left = {"uncorrected": 0.0, "corrected": 0.0, "sign_reversed": 0.0}
    for j in range(runs.repeats):
        others = np.delete(runs.x, j, axis=2).mean(axis=2)
        own, known = runs.x[:, :, j] - runs.x[:, :, j].mean(), others - others.mean()
        for name, sign in zip(left, (0.0, -1.0, 1.0), strict=True):
            left[name] += float(np.mean((own + sign * known) ** 2)) / runs.repeats
    return {name: float(f"{np.sqrt(value):.4g}") for name, value in left.items()}


def write_tables(job: Path, out: Path, form: str, *, force: bool = False) -> tuple[dict[str, Path], list[str]]:
    """Write the tables of every axis that a run positions, and what they are worth in sentences.

    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_job(job)
    refuse_unmeasured(read)
    owner = Owner("compensate", read.facts.job.id, read.origin)
    with staged(out, owner, inputs=read.paths, force=force, expected=(PROVENANCE,)) as place:
        runs = runs_of_axes(read)
        tables = [AxisTable.of(axis, one, read.points.machine.origin_mm) for axis, one in runs.items()]
        angular = any(table.angular for table in tables)
        files = FORMS[form](tables) if form in FORMS else filled(Path(form), tables)
        worth = {axis: held_out_um(one) for axis, one in runs.items() if one.repeats > 1}
        told = {
            "software": PROGRAM,
            "recording": read.origin,
            "inputs_sha256": sha256(read.inputs),
            "form": form,
            "sign": "deviation = actual less target; the controller subtracts it",
            "held_out_rms_arcsec" if angular else "held_out_rms_um": worth,
        }
        files[PROVENANCE] = json.dumps(told, indent=2, ensure_ascii=False) + "\n"
        written = place.write({name: text.encode() for name, text in files.items()})
    said = [
        f"{axis.upper()}: repeats held out are off by {each['uncorrected']:.3g} {'″' if angular else 'µm'} rms, corrected by "
        f"{each['corrected']:.3g}, with the sign reversed by {each['sign_reversed']:.3g}"
        for axis, each in worth.items()
    ]
    said = said or ["One run of each axis is too few to hold one out: what the tables are worth was not tried"]
    if read.origin == SIMULATED:
        said.append("The recording was simulated: these tables are of no machine")
    return written, said


def runs_of_axes(job: Job) -> dict[str, PositioningRuns]:
    """The run along each axis of the machine, or of each rotary axis."""
    model, _ = recorded_model(job)
    try:
        every = model.artefact.positionings()
    except MissingReadingError as error:
        fix = "Record every target in every repeat of each direction, or leave the run out"
        raise CmmUqError(str(error), where=job.recording_path, fix=fix) from None
    found: dict[str, PositioningRuns] = {}
    for number, one in every.items():
        if not np.any(model.used[model.artefact.measurement == number]):  # set aside
            continue
        if one.axis in found:
            what = f"measurement {number} is a second run along {one.axis.upper()}: a table is of one"
            raise CmmUqError(what, where=job.recording_path, fix="Set the others aside: [recording] set_aside")
        if one.axis:
            found[one.axis] = one
    if not found:
        raise kind_of(job).refused("made tables for a controller of")
    return found
