"""Points of earlier sessions whose streams had not answered when the session ended: joined from what is on the disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from cmm_uq.jobs.acquire import DeclaredSource
from cmm_uq.laboratory.live.blocks import READINGS, readings_of
from cmm_uq.laboratory.live.folder import STREAMS, Journals
from cmm_uq.laboratory.live.instruments.reading import Reading
from cmm_uq.laboratory.live.joining import Joined, Stream
from cmm_uq.laboratory.live.journal import Moment, lines_in
from cmm_uq.laboratory.live.recorder import COORDINATES
from cmm_uq.laboratory.live.story import Point


def settle_earlier(journals: Journals, sources: Iterable[DeclaredSource], max_gap_s: float, now: Moment) -> int:
    """Join what earlier sessions left open; how many points that were.

    Parameters
    ----------
    journals : of the session that begins.
    sources : as the job declares them.
    """
    story, declared = journals.story, {source.name: source for source in sources}
    left = [point for point in story.points.values() if not point.settled and point.session != story.session.number]
    for number in dict.fromkeys(point.session for point in left):
        own = [point for point in left if point.session == number]
        for point, streams in _streams(journals.folder / STREAMS.format(number), own, declared, max_gap_s):
            answers = {
                stream.column: stream.at(point.moment.monotonic_ns, None)
                for stream in streams.values()
                if stream.column not in (*point.columns, *COORDINATES)
            }
            values = {name: [one.value, one.u] for name, one in answers.items() if isinstance(one, Joined)}
            missing = {name: str.__str__(one) for name, one in answers.items() if one and not isinstance(one, Joined)}
            journals.say("joined", {"of": point.record, "values": values, "missing": missing}, now)
    return len(left)


def _streams(
    path: Path, points: list[Point], declared: dict[str, DeclaredSource], max_gap_s: float
) -> Iterable[tuple[Point, dict[tuple[str, str], Stream]]]:
    """Each point with the streams about its moment."""
    for point in points:
        streams: dict[tuple[str, str], Stream] = {}
        for source in declared.values():
            for quantity, column in source.values.items():
                streams[source.name, quantity] = _stream(column, source, source.name, max_gap_s)
        for reading in _about(path, point.moment.monotonic_ns, round(3e9 * max_gap_s)):
            given = declared.get(reading.source)
            for quantity, value in reading.values.items():
                column = given.values.get(quantity, quantity) if given else quantity
                key = (reading.source, quantity)
                streams.setdefault(key, _stream(column, given, reading.source, max_gap_s))
                streams[key].add(reading.monotonic_ns, value)
        yield point, streams


def _about(path: Path, moment_ns: int, near_ns: int) -> Iterator[Reading]:
    """Sound readings about a moment, from a journal of streams; damaged lines are passed over."""
    for line in lines_in(path) if path.exists() else ():
        record = line.record
        if record is None or record.kind != READINGS or record.data["monotonic_ns"][-1] < moment_ns - near_ns:
            continue
        if record.data["monotonic_ns"][0] > moment_ns + near_ns:
            return
        yield from (one for one in readings_of(record.data) if one.status is None and one.point is None)


def _stream(column: str, declared: DeclaredSource | None, source: str, max_gap_s: float) -> Stream:
    latency = declared.latency_ms * 1e-3 if declared else 0.0
    return Stream(column, source, latency_s=latency, max_gap_s=max_gap_s)
