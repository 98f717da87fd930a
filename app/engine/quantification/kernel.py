"""One-step prediction of PV behind every valve of a grid, compiled: one regression a valve."""

import numpy as np
from numba import njit

from app.engine.armax.gram import fill_lagged_gram, fill_own_gram, residuals_abreast
from app.engine.recording import FloatArray
from app.engine.valve import he_step, kano_start, kano_step

_COLLINEAR = 1e-9


@njit(cache=True, nogil=True)
def stem(op: FloatArray, kano: bool, S: float, J: float, v: FloatArray) -> None:
    """v (N,) of Kano's or He's valve in the unit of OP, at rest at the first sample."""
    state = np.zeros(6)
    if kano:
        kano_start(op[0], state, S, J)
        for t in range(len(op)):
            v[t] = kano_step(op[t], state, S, J)
        return
    state[0], state[1] = op[0], op[0]
    for t in range(len(op)):
        v[t] = he_step(op[t], state, S, J)


@njit(cache=True, nogil=True)
def thinned(v: FloatArray, stride: int) -> FloatArray:
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
    jumps: FloatArray,
    kano: np.ndarray,
    lags_pv: int,
    lags_v: int,
) -> FloatArray:
    """Sum of squared one-step errors (len(S), len(jumps)) of PV on its own and the stem's last samples.

    pv: (n,) about its mean, every `stride`-th sample. op: (n stride,). S: (.,) unit of OP. jumps: (.,) J / S of the
    valve forms, Kano's where kano (.,) is True, He's elsewhere. The stem acts from the sample after on (thinned: from
    the mean of the samples since the one before on), so that the controller's way from PV to OP is no explanation.
    """
    first_lag = 1 if stride == 1 else 0
    first = max(lags_pv, lags_v + first_lag)
    size = lags_pv + lags_v + 1
    own, across = np.empty((lags_pv + 1, lags_pv + 1)), np.empty((lags_pv + 1, lags_v))
    gram, grams = np.zeros((size, size)), np.empty((size, size, len(jumps)))
    out, v = np.empty((len(S), len(jumps))), np.empty(len(op))
    fill_own_gram(own, 0, pv, (0, lags_pv + 1), first)
    for a in range(len(S)):
        for b in range(len(jumps)):
            stem(op, kano[b], S[a], S[a] * jumps[b], v)
            w = thinned(v, stride) if stride > 1 else v
            w = w - w.mean()
            fill_lagged_gram(across, 0, 0, pv, w, (0, lags_pv + 1, first_lag, lags_v), first)
            fill_own_gram(gram, lags_pv, w, (first_lag, lags_v), first)
            gram[:lags_pv, :lags_pv] = own[1:, 1:]
            gram[:lags_pv, lags_pv : size - 1] = across[1:]
            gram[:lags_pv, size - 1] = own[0, 1:]
            gram[lags_pv : size - 1, size - 1] = across[0]
            gram[size - 1, size - 1] = own[0, 0]
            grams[:, :, b] = gram
        residuals_abreast(grams, _COLLINEAR, out[a])
    return out
