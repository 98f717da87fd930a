"""Imported once, by the server that workers, schedules and commands of the tests are forked from (`tests.forked`)."""

from app.threads import use_one_thread

use_one_thread()

import app.cli.main  # noqa: E402, F401 - numba reads at its import how many threads it has
import workers.tasks  # noqa: E402, F401 - as above
from workers.process import load_or_compile  # noqa: E402 - as above

load_or_compile()
