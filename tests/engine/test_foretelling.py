"""What further terms are worth, beside least squares done at length."""

import numpy as np
import pytest

from app.engine.causality.foretelling import Table


@pytest.fixture
def rows() -> np.ndarray:
    rng = np.random.default_rng(3)
    known = np.vstack((np.ones(900), rng.standard_normal((3, 900))))
    return np.vstack((known, [0.5, 1.0, -2.0, 0.0] @ known + 0.3 * rng.standard_normal(900)))


def left(table: np.ndarray) -> np.ndarray:
    return table[-1] - np.linalg.lstsq(table[:-1].T, table[-1], rcond=None)[0] @ table[:-1]


def test_what_is_missed_and_what_more_is_worth(rows: np.ndarray) -> None:
    rng = np.random.default_rng(4)
    more = np.vstack((rows[-1] + rng.standard_normal(900), rng.standard_normal(900)))
    table = Table.in_parts(rows, 3)
    before, after = left(rows), left(np.vstack((rows[:-1], more, rows[-1])))
    assert table.missed == pytest.approx([np.sum(before[k : k + 300] ** 2) for k in (0, 300, 600)], rel=1e-6)
    worth, of_noise = table.worths(np.stack((more, rng.standard_normal((2, 900)))))
    assert worth.sum() == pytest.approx(450.0 * np.log(np.sum(before**2) / np.sum(after**2)), rel=1e-6)
    assert worth.min() > 0.0
    assert abs(of_noise.sum()) < 10.0
    assert table.beside(more).missed.sum() == pytest.approx(np.sum(after**2), rel=1e-6)
    assert abs(table.beside(more).worths(more[None, :1]).sum()) < 1e-3


def test_a_line_foretells_all(rows: np.ndarray) -> None:
    assert not Table.in_parts(rows, 3).foretells_all
    rows[-1] = rows[1]
    assert Table.in_parts(rows, 3).foretells_all
