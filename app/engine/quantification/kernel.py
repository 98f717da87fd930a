"""One-step prediction of PV behind every valve of a grid, compiled: one regression a valve, many valves abreast."""

import numpy as np
from numba import njit

from app.engine.armax.gram import NOW, fill_lagged_gram, fill_own_gram, residuals_abreast
from app.engine.recording import FloatArray
from app.engine.valve import he_stems, kano_stems

_COLLINEAR = 1e-9
_ABREAST = 32


@njit(cache=True, nogil=True)
def means_before(v: FloatArray, stride: int) -> FloatArray:
    """Mean of v over the `stride` samples before each `stride`-th one: what has acted on PV by then."""
    out = np.empty(len(v) // stride)
    out[0] = v[0]
    for i in range(1, len(out)):
        out[i] = np.mean(v[(i - 1) * stride : i * stride])
    return out


@njit(cache=True, nogil=True)
def residuals(
    pv: FloatArray,
    op: FloatArray,
    stride: int,
    S: FloatArray,
    J: FloatArray,
    kano: bool,
    lags_pv: int,
    lags_v: int,
) -> FloatArray:
    """Sum of squared one-step errors (M,) of PV on its own and the stem's last samples, one for each valve.

    pv: (n,) about its mean, every `stride`-th sample. op: (n stride,). S, J: (M,) unit of OP, of Kano's valves or of
    He's. The stem acts from the sample after on (thinned: from the mean of the samples since the one before on), so
    that the controller's way from PV to OP is no explanation. A stem that OP never moves explains nothing.
    """
    first_lag = 1 if stride == 1 else 0
    first = max(lags_pv, lags_v + first_lag)
    own, grams = np.zeros((lags_pv + 1, lags_pv + 1)), np.zeros((lags_pv + lags_v + 1, lags_pv + lags_v + 1, 1))
    out = np.empty(len(S))
    fill_own_gram(own, NOW, pv, (NOW, lags_pv + 1), first)
    _fill_pv(grams, own, lags_pv)
    residuals_abreast(grams, _COLLINEAR, out[:1])
    out[:] = out[0]
    moving = np.flatnonzero(np.max(np.abs(op - op[0])) > 0.5 * (S + J))
    out[moving] = _of_moving(pv, op, stride, S[moving], J[moving], kano, own, lags_v, first)
    return out


@njit(cache=True, nogil=True)
def _of_moving(
    pv: FloatArray,
    op: FloatArray,
    stride: int,
    S: FloatArray,
    J: FloatArray,
    kano: bool,
    own: FloatArray,
    lags_v: int,
    first: int,
) -> FloatArray:
    """`residuals` of valves that OP moves. own: Gram matrix of PV and its lags over the samples from `first` on."""
    first_lag, lags_pv = 1 if stride == 1 else 0, own.shape[0] - 1
    goal, abreast = lags_pv + lags_v, min(_ABREAST, len(S))
    across, stem = np.empty((lags_pv + 1, lags_v)), np.zeros((lags_v, lags_v))
    grams, v = np.zeros((goal + 1, goal + 1, abreast)), np.empty((abreast, len(op)))
    out = np.empty(len(S))
    for place in range(0, len(S), _ABREAST):
        begin = min(place, len(S) - abreast)  # the last ones may overlap those before: the same errors again
        valves = slice(begin, begin + abreast)
        means = kano_stems(op, S[valves], J[valves], v) if kano else he_stems(op, S[valves], J[valves], v)
        _fill_pv(grams, own, lags_pv)
        for m in range(abreast):
            if stride > 1:
                w = means_before(v[m], stride)
                w -= w.mean()
            else:
                w = v[m] - means[m]
            fill_lagged_gram(across, NOW, NOW, pv, w, (NOW, lags_pv + 1, first_lag, lags_v), first)
            fill_own_gram(stem, NOW, w, (first_lag, lags_v), first)
            _fill_stem(grams, m, across, stem)
        residuals_abreast(grams, _COLLINEAR, out[valves])
    return out


@njit(cache=True, nogil=True)
def _fill_pv(grams: FloatArray, own: FloatArray, lags_pv: int) -> None:
    """The lags of PV and PV itself, which no valve changes, into the upper triangles grams (size, size, M)."""
    goal = grams.shape[0] - 1
    for i in range(lags_pv):
        grams[i, goal] = own[0, i + 1]
        for j in range(i, lags_pv):
            grams[i, j] = own[i + 1, j + 1]
    grams[goal, goal] = own[0, 0]


@njit(cache=True, nogil=True)
def _fill_stem(grams: FloatArray, m: int, across: FloatArray, stem: FloatArray) -> None:
    """The lags of the m-th stem against those of PV and against each other, likewise."""
    lags_v, goal = stem.shape[0], grams.shape[0] - 1
    lags_pv = goal - lags_v
    for j in range(lags_v):
        grams[lags_pv + j, goal, m] = across[0, j]
        for i in range(lags_pv):
            grams[i, lags_pv + j, m] = across[i + 1, j]
        for i in range(j + 1):
            grams[lags_pv + i, lags_pv + j, m] = stem[i, j]
