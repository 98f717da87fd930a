"""Lines that hold nothing but blanks: they are no rows, and thousands of them are not read."""

from collections.abc import Iterator

import numpy as np

from app.ingest.files.opening import Lines, count_lines

LONG_RUN = 1 << 14
"""Bytes of blank lines from which on they are not read: as rows of nulls, millions of them took gigabytes."""
_STEP = LONG_RUN // 2  # such a run has a whole step, wherever it begins
_PROBE = 16  # bytes of a step that are looked at before all of it


def parts_between(lines: Lines) -> Iterator[Lines]:
    """The lines between long runs of blank ones, with their numbers."""
    data, taken, first = lines.data, 0, lines.first
    for begin, end in _long_runs(data):
        if begin > taken:
            part = data[taken:begin]
            yield Lines(part, first, count_lines(part))
        first += count_lines(data[taken:end])
        taken = end
    if not taken:
        yield lines
    elif taken < len(data):
        yield Lines(data[taken:], first, lines.first + lines.count - first)


def _long_runs(data: bytes) -> Iterator[tuple[int, int]]:
    """From where to where blank lines stand, in their order."""
    at, after = 0, 0
    while at + _STEP <= len(data):
        if not (data[at : at + _PROBE].isspace() and data[at : at + _STEP].isspace()):
            at += _STEP
            continue
        begin, end = _from(data, at, after), _to(data, at + _STEP)
        if end - begin >= LONG_RUN:
            yield begin, end
        after = at = max(end, at + _STEP)


def _from(data: bytes, at: int, after: int) -> int:
    """Where the first line begins that is blank up to `at`."""
    start = max(after, at - _STEP)
    filled = start + len(data[start:at].rstrip())
    return data.find(b"\n", filled) + 1 if filled else 0


def _to(data: bytes, at: int) -> int:
    """Where the first line begins that is not blank, from `at` on."""
    while data[at : at + _STEP].isspace():
        at += _STEP
    step = data[at : at + _STEP]
    return data.rfind(b"\n", 0, at + len(step) - len(step.lstrip())) + 1


def with_empty_lines(data: bytes) -> tuple[bytes, int]:
    """The same with nothing in whole lines that hold nothing but blanks, which may else be taken for a tag, and how
    many these are."""
    text = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(text == ord("\n"))
    begins = np.concatenate(([0], ends[:-1] + 1))[: len(ends)]
    may_be = text[begins] <= ord(" ")
    begins, ends = begins[may_be], ends[may_be]
    longer = begins < ends
    bounds = zip(begins[longer].tolist(), ends[longer].tolist(), strict=True)
    blank = [(begin, end) for begin, end in bounds if data[begin:end].isspace()]
    count = int(np.count_nonzero(~longer)) + len(blank)
    if not blank:
        return data, count
    froms, tos = zip((0, 0), *blank, strict=True)
    return b"".join(data[end:begin] for end, begin in zip(tos, (*froms[1:], len(data)), strict=True)), count
