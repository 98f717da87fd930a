"""Threads of the libraries behind the engine: they read these once, when they are imported."""

import os

OF_LINEAR_ALGEBRA = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
READING_THREADS = {"POLARS_MAX_THREADS": "2"}  # a plant's file comes alone, while no audit runs
OF_READING = tuple(READING_THREADS)


def limit_to_one(names: tuple[str, ...]) -> None:
    """One thread, unless somebody has said otherwise: of matrices as small as the engine's a second one only waits."""
    for name in names:
        os.environ.setdefault(name, "1")


def use_one_thread() -> None:
    """One thread a worker process, because the processes are what scales, and two to take a text apart with; to be
    called before numpy is imported."""
    limit_to_one(OF_LINEAR_ALGEBRA)
    for name, count in READING_THREADS.items():
        os.environ.setdefault(name, count)
