"""A take in memory written to a file again: every byte, mark and change of settings where it stood."""

from collections.abc import Iterator, Mapping
from heapq import merge
from pathlib import Path

from devices.driver import RawChunk, Reading
from devices.errors import FileError
from devices.progress import Progress, no_progress
from devices.protocols.protocol import DeviceProtocol
from replay_logs.atomic_file import written_beside
from replay_logs.recorder import TakeRecorder
from replay_logs.span import Span
from replay_logs.take import Mark, SettingsChange, Take


def write_take(take: Take, path: Path | str, progress: Progress = no_progress) -> None:
    """Writes the take; reading it gives the same devices, bytes, times, marks, changes and metadata.

    When and with which version it was recorded stay. The samples for other programs are decoded anew, those of a
    trimmed take in its span only. Raises FileError where there is a file already or it cannot be written; then nothing
    is left.
    """
    path = Path(path)
    if path.exists():
        raise FileError(f"{path}: there is a file already; takes are not overwritten")
    with written_beside(path) as part, TakeRecorder(part, take.metadata) as recorder:
        _write(take, recorder, progress)


def _write(take: Take, recorder: TakeRecorder, progress: Progress) -> None:
    span = Span.of(take)
    protocols: dict[str, DeviceProtocol] = {}
    for device in take.devices:
        recorder.add_device(device)
        protocols[device.name] = device.make_protocol()
    total = sum(map(len, take.chunks.values()))
    for number, (name, entry) in enumerate(in_order(take)):
        if isinstance(entry, Mark):
            recorder.mark(entry.time_ns, entry.text)
        elif isinstance(entry, SettingsChange):
            recorder.settings(entry.time_ns, entry.values)
        else:
            recorder.write(name, _reading(entry, protocols[name], span))
        progress(min(number + 1, total), total)


def _reading(chunk: RawChunk, protocol: DeviceProtocol, span: Span | None) -> Reading:
    if not chunk.data:
        protocol.reset()
        return Reading((chunk,))
    samples = protocol.feed(chunk.data, chunk.host_time_ns)
    return Reading((chunk,), tuple(s for s in samples if span is None or s.host_time_ns in span))


Entry = RawChunk | Mark | SettingsChange


def in_order(take: Take) -> Iterator[tuple[str, Entry]]:
    """All that a take holds as it happened, chunks with their device's name: by host time, each change of settings
    between the chunks that it stood between."""
    done = dict.fromkeys(take.chunks, 0)
    marks = list(take.marks)
    for change in (*take.changes, None):
        until = {name: len(chunks) for name, chunks in take.chunks.items()}
        if change is not None:
            until |= {name: max(done[name], change.chunks_before.get(name, 0)) for name in until}
        yield from _between(take.chunks, done, until, marks)
        done = until
        if change is not None:
            yield "", change
    yield from (("", mark) for mark in marks)


def _between(
    chunks: Mapping[str, tuple[RawChunk, ...]], done: Mapping[str, int], until: Mapping[str, int], marks: list[Mark]
) -> Iterator[tuple[str, Entry]]:
    """The chunks of all devices between two places, and the marks that were made before each of them."""
    own = [[(name, chunk) for chunk in held[done[name] : until[name]]] for name, held in chunks.items()]
    for name, chunk in merge(*own, key=lambda entry: entry[1].host_time_ns):
        while marks and marks[0].time_ns <= chunk.host_time_ns:
            yield "", marks.pop(0)
        yield name, chunk
