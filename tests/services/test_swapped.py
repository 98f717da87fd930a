"""A set point that lies with OP tells of exchanged tags; one of a loop out of use tells nothing."""

from dataclasses import replace

import numpy as np
import pytest

from app.ingest import LoopSamples
from app.ingest.set_points import FEWEST, SetPoints
from app.services.backend import Backend
from app.services.telling.exchanged_tags import exchanged_tags
from tests.services.sent_uploads import read, send

N = 200
NOISE = np.random.default_rng(3).normal(size=(2, N))
RIGHT = LoopSamples("FIC1", np.arange(N, dtype=np.int64), pv=100.0 + NOISE[0], op=40.0 + NOISE[1], sp=np.full(N, 100.0))
SWAPPED = replace(RIGHT, pv=RIGHT.op, op=RIGHT.pv)


def told(*stretches: LoopSamples) -> list[str]:
    seen = SetPoints()
    for stretch in stretches:
        seen.look(stretch)
    return list(exchanged_tags(seen.with_op()))


def test_exchanged_tags_are_told() -> None:
    (note,) = told(SWAPPED, replace(RIGHT, loop="FIC2"))
    assert note == "SP lies with OP, far from PV, in FIC1: are the tags of PV and OP exchanged, or is SP in %?"


@pytest.mark.parametrize(
    "stretch",
    [
        RIGHT,
        replace(SWAPPED, sp=None),
        replace(SWAPPED, automatic=np.zeros(N)),
        replace(SWAPPED, op=np.full(N, 100.0)),
        replace(SWAPPED, op=NOISE[0], sp=np.zeros(N)),
        replace(SWAPPED, pv=100.0 + 5.0 * NOISE[1]),
        replace(SWAPPED, pv=np.full(N, np.nan)),
        replace(SWAPPED, **{name: getattr(SWAPPED, name)[: FEWEST - 1] for name in ("time_ns", "pv", "op", "sp")}),
    ],
)
def test_nothing_is_told_where_nothing_shows_it(stretch: LoopSamples) -> None:
    assert told(stretch) == []


def test_half_a_record_is_not_enough() -> None:
    assert told(SWAPPED, RIGHT) == []


def test_an_upload_has_the_note(backend: Backend) -> None:
    rows = (f"{1_750_000_000 + k},{40 + NOISE[1, k]:.3f},{100 + NOISE[0, k]:.3f},100" for k in range(N))
    data = "\n".join(["time,FIC1.PV,FIC1.OP,FIC1.SP", *rows, ""]).encode()
    assert "exchanged" in read(backend, send(backend, data)).notes[0]
