"""Files that a machine's program drops into a folder, on their way into a recording: kept as they are, and imported."""

from __future__ import annotations

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.messages import Verbatim
from cmm_uq.jobs.importing.imported import Imported, imported
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording import read_recording
from cmm_uq.jobs.recording_file import is_own
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.dropped import Dropped, Watched
from cmm_uq.laboratory.live.folder import FOLDER
from cmm_uq.laboratory.live.instruments.source import Clock
from cmm_uq.laboratory.live.journal import Moment, made_folder, written_whole


class Taking:
    """Takes files of a folder: keeps their bytes beside the journal, and reads their points as any import does."""

    def __init__(self, job: Job, watched: Watched, conductor: Conductor, clock: Clock) -> None:
        self._job, self._watched, self._conductor, self._clock = job, watched, conductor, clock

    def __call__(self, file: Dropped) -> None:
        """A file that stands still."""
        try:
            rows = _rows(file, self._job)
        except CmmUqError as error:
            self._conductor.tell(Verbatim(str(error)))
            return
        try:
            kept = self._kept(file)
        except OutputError as error:
            self._conductor.tell(Verbatim(str(error)))
            self._watched.again(file.path)
            return
        age = self._clock.utc_ns() - file.utc_ns
        moment = Moment(file.utc_ns, self._clock.monotonic_ns() - age)
        self._conductor.file(file.path.name, file.content, moment, rows, kept)

    def _kept(self, file: Dropped) -> str:
        folder = self._job.folder / FOLDER / "files"
        made_folder(folder)
        number = 1 + sum(1 for _ in folder.iterdir())
        path = folder / f"{number:04d}-{file.path.name}"
        written_whole(path, file.content)
        return path.name


def _rows(file: Dropped, job: Job) -> list[dict[str, float]]:
    """Points of a file; measurement, point and repeat only where the file itself numbers them."""
    where, machine = str(file.path), job.points.machine
    keys = job.facts.recording
    if not keys.asked and is_own(file.content):
        points = read_recording(file.content, where, machine)
        columns = {"measurement": points.measurement, "point": points.point, "repeat": points.repeat,
                   **dict(zip(("x_mm", "y_mm", "z_mm"), points.xyz.T, strict=True)), **points.columns}  # fmt: skip
    else:
        found = _imported(file.content, where, keys)
        columns = dict(found.columns)
        if "measurement" not in found.recognised.columns:
            columns = {
                name: values for name, values in columns.items() if name not in ("measurement", "point", "repeat")
            }
    columns.pop("time_s", None)  # by another clock
    names = list(columns)
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns.values(), strict=True)]


def _imported(content: bytes, where: str, keys: ImportKeys) -> Imported:
    """As any import; where nothing says which points belong together, they come in the order of the plan."""
    try:
        return imported(content, where, keys)
    except CmmUqError:
        if keys.points_per_measurement is not None:
            raise
        return imported(content, where, keys.model_copy(update={"points_per_measurement": "all"}))
