"""A worker process: kernels compiled before it forks, one connection to the data base after it forked."""

import logging
from functools import cache

from celery import current_app, signals

from app.services import chunks
from app.services.backend import Backend


@cache
def backend() -> Backend:
    """The backend of this process, opened at its first task."""
    return Backend.open(current_app.settings, worker=True)


@signals.setup_logging.connect
def log_plainly(loglevel: int | None = None, **_: object) -> None:
    logging.basicConfig(level=loglevel, format="%(asctime)s %(levelname)s %(name)s: %(message)s")


@signals.worker_init.connect
def warm_up(**_: object) -> None:
    """In the parent, once: its children inherit what is compiled and loaded."""
    chunks.warm_up()


@signals.worker_process_shutdown.connect
def let_go(**_: object) -> None:
    if backend.cache_info().currsize:
        backend().close()
