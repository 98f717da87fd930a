"""Values that become a power of ten as large at once, noise and all: a unit changed, and nothing else says so."""

from collections.abc import Callable

import numpy as np
import pytest

from .conftest import Read

N = 400
STAMPS = np.datetime_as_string(np.datetime64("2024-03-01T00:00:00") + np.arange(N)).tolist()
NOISE = np.random.default_rng(5).normal(size=N)
LATE = np.arange(N) >= 250
LEVEL = 50 + 5 * np.sin(np.arange(N) / 15) + NOISE


def notes(read: Read, pv: np.ndarray) -> list[str]:
    rows = (f"{stamp},{value:.6g},{40 + k % 3}" for k, (stamp, value) in enumerate(zip(STAMPS, pv, strict=True)))
    content = read("Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows) + "\n")
    assert content.rejects.total == 0
    return [note for note in content.summary.notes if note.startswith("check the units")]


@pytest.mark.parametrize(("factor", "told"), [(1000, "1,000"), (0.001, "1/1,000"), (0.01, "1/100")])
def test_a_jump_of_scale_is_told(read: Read, factor: float, told: str) -> None:
    for sign in (1, -1):
        (note,) = notes(read, sign * np.where(LATE, LEVEL * factor, LEVEL))
        assert note.endswith(f": FIC1.PV ({told} times from 2024-03-01 00:04:10 UTC on)")


@pytest.mark.parametrize(
    "pv",
    [
        lambda: LEVEL,
        lambda: np.where(LATE, LEVEL, 0.05 + 0.2 * np.abs(NOISE)),
        lambda: np.where(LATE, 45.0, 0.3) + 0.05 * NOISE**2,
        lambda: np.where(LATE, LEVEL, 0.0),
        lambda: LEVEL * 10.0 ** (4 * np.arange(N) / N),
        lambda: NOISE,
        lambda: np.where(LATE, 100.0, 1.0),
        lambda: np.where(np.arange(N) % 7 == 0, 1000 * LEVEL, LEVEL),
    ],
)
def test_what_processes_do_is_none(read: Read, pv: Callable[[], np.ndarray]) -> None:
    assert notes(read, pv()) == []
