"""Whether an explanation leaves something of PV that answers OP: a test of lack of fit by the score of further terms.

What is left is whitened by its noise model and regressed on terms of OP and of the free run, whitened alike; the
explanation's own numbers, and an autoregression of what is left, follow freely. Right physics leaves innovations that
nothing causal predicts. The terms are chosen one by one, and each pays for being chosen.
Sources: Engle 1984, doi 10.1016/S1573-4412(84)02005-5 (tests by Lagrange multipliers); Billings, Voon 1986,
doi 10.1080/00207178608933593 (validity of non-linear models); Schwarz 1978, doi 10.1214/aos/1176344136 (the price).
"""

from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, orthonormal
from app.engine.mismatch.fit.noise import settling_samples, whiten
from app.engine.mismatch.fit.scan import Ground, ground
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.physics.terms import SHAPES, Drives
from app.engine.recording import FloatArray

_ORDER = 8
_MOST_TERMS = 8
_NEW_SHARE = 1e-3  # of a term's size: less is what the explanation's own numbers do


@dataclass(frozen=True)
class Pays:
    """A term that pays beside what was found: its name, and its gain in log-likelihood (nat) beyond its price."""

    name: str
    gain: float


def lack_of_fit(found: Fit) -> tuple[Pays, ...]:
    """The terms that pay beside an explanation, in the order in which they were chosen; none where it is adequate."""
    under = ground(found, found.noise)
    rows, columns = _freed_from(under, _lagged(_innovations(under)))
    return _chosen(rows, columns, under.count)


def _innovations(under: Ground) -> FloatArray:
    """(N,) the rows of samples, compared or not; the others are the priors'."""
    samples = under.fit.record.samples
    return under.rows[: samples - settling_samples(samples)]


def _lagged(e: FloatArray) -> FloatArray:
    """(_ORDER, N) the innovations (N,) so many samples before."""
    return np.stack([np.concatenate((np.zeros(k), e[:-k])) for k in range(1, _ORDER + 1)])


def _freed_from(under: Ground, past: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The whitened residual (N,) and terms (M, N) without what the explanation's numbers and past innovations do."""
    padded = np.zeros((len(under.rows), _ORDER))
    padded[: past.shape[1]] = past.T
    basis = orthonormal(np.concatenate((under.basis, padded), axis=1))
    columns = _whitened_terms(under)
    size = np.sqrt(np.sum(columns**2, axis=1))
    rows, left = under.rows - basis @ (basis.T @ under.rows), columns - (columns @ basis) @ basis.T
    new = np.sqrt(np.sum(left**2, axis=1)) > _NEW_SHARE * size
    return rows, np.where(new[:, None], left, 0.0)


def _whitened_terms(under: Ground) -> FloatArray:
    """Every term of the free run, whitened and over the noise's deviation; zero in the priors' rows. (M, rows)"""
    found = under.fit
    drives = Drives(Context(found.record, found.plant), found.simulated)
    columns = np.zeros((len(SHAPES), len(under.rows)))
    samples, skip = len(_innovations(under)), settling_samples(found.record.samples)
    for column, shape in zip(columns, SHAPES.values(), strict=True):
        term = shape.make(drives)
        column[:samples] = whiten(term - np.mean(term), found.record.usable, found.noise)[skip:]
    return columns


def _chosen(rows: FloatArray, columns: FloatArray, count: int) -> tuple[Pays, ...]:
    """Forward selection: the term that takes most of the rows (N,) while it pays, the others (M, N) less what it does.
    count: how many samples are compared.

    A term's price: half the logarithm of the samples for its size, and the logarithm of how many were offered.
    """
    names, columns, taken = list(SHAPES), columns.copy(), []
    price = 0.5 * float(np.log(count)) + float(np.log(len(names)))
    whole = np.sum(columns**2, axis=1) + 1e-300
    left = float(rows @ rows)
    for _ in range(_MOST_TERMS):
        energy = np.sum(columns**2, axis=1)
        along = np.where(energy > _NEW_SHARE * whole, (columns @ rows) ** 2 / np.maximum(energy, 1e-300), 0.0)
        best = int(np.argmax(along))
        gain = 0.5 * count * float(np.log(left / max(left - along[best], 1e-300))) - price
        if gain <= 0.0:
            break
        taken.append(Pays(names[best], gain))
        direction = columns[best] / np.sqrt(energy[best])
        rows = rows - direction * (direction @ rows)
        columns = columns - np.outer(columns @ direction, direction)
        left -= float(along[best])
    return tuple(taken)
