"""Threads of the libraries behind the engine: they read these once, when they are imported."""

import os

OF_LINEAR_ALGEBRA = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
OF_READING = ("POLARS_MAX_THREADS",)


def limit_to_one(names: tuple[str, ...]) -> None:
    """One thread, unless somebody has said otherwise: of matrices as small as the engine's a second one only waits."""
    for name in names:
        os.environ.setdefault(name, "1")
