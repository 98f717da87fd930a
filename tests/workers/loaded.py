"""Imported once, by the server that the tests' workers and schedules are forked from: engine and kernels were three of
four seconds of each start. That a worker starts by itself is asked in e2e, chaos and cli.
"""

from app.settings import use_one_thread

use_one_thread()

from workers.process import load_or_compile  # noqa: E402 - numba reads at its import how many threads it has

load_or_compile()
