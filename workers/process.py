"""A worker process: kernels compiled before it forks, one connection to the database after it forked."""

import gc
import logging
import mmap
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib import import_module
from typing import Any

from celery import current_app, signals

from app import kernel_cache, logs
from app.engine.mismatch import compile_kernels
from app.services.auditing import warming
from app.services.auditing.nightly import next_hour, told
from app.services.backend import Backend
from app.services.intake import reading
from app.services.upkeep.tables import newer_than_we

ROOM_TO_WORK_MB = 150
LOOKS_EVERY_S = 1.0
ENDING = mmap.mmap(-1, 1)
"""Of all processes of a worker, which inherit it: not 0 once one of them had it end."""

log = logging.getLogger("loopaudit.worker")


@cache
def backend() -> Backend:
    """The backend of this process, opened at its first task."""
    return Backend.open(current_app.settings, worker=True)


@signals.setup_logging.connect
def log_structured(**_: object) -> None:
    logs.configure(current_app.settings)


@signals.worker_init.connect
def warm_up(sender: Any, **_: object) -> None:
    """In the parent, once: its children inherit what is compiled and loaded."""
    try:
        load_or_compile()
    except Exception:  # after a power cut a file may be there and empty: numba would fail on it each time
        log.exception("the kernels cannot be loaded: they are compiled anew")
        kernel_cache.empty()
        load_or_compile()
    gc.collect()
    gc.freeze()  # what is loaded stays: looking through it for garbage took a twentieth of reading a file
    # A child begins as large as its parent. A limit below that would replace it after every task.
    own_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    sender.max_memory_per_child = 1024 * max(current_app.settings.worker_memory_mb, own_mb + ROOM_TO_WORK_MB)


@signals.worker_ready.connect
def say_ready(**_: object) -> None:
    """Once it takes work and heeds SIGTERM: before, that would end it hard."""
    log.warning("ready")
    # Told here, because the process that takes a sweep decides, by settings of its own.
    log.info("next nightly audit at %s", told(next_hour(current_app.settings, datetime.now(UTC))))


def load_or_compile() -> None:
    """The kernels from the cache of this source; first, where they are not there, into it, by two processes."""
    if _all_were_compiled():
        return
    log.warning("compiling the kernels; at the first start of a version this takes a minute or two")
    _compile_aside()
    with kernel_cache.one_at_a_time():
        _load()


def _all_were_compiled() -> bool:
    """Loads the kernels, as far as they are in the cache; whether all of them are."""
    with suppress(kernel_cache.NotCompiled), kernel_cache.loading_only():
        _load()
        return True
    return False


def _load() -> None:
    warming.audits()
    reading.warm_up()
    compile_kernels()
    import_module("scipy.optimize")  # at its first use a loop's time limit could cut it off half-way, for good


def _compile_aside() -> None:
    """Fills the cache of compiled kernels from processes that then end: compiling takes memory that is never given
    back, and every worker process would carry it. Two of them compile about half each."""
    with kernel_cache.one_at_a_time():
        for half in (_aside(warming.identifications, compile_kernels), _aside(warming.verdicts, reading.warm_up)):
            os.waitpid(half, 0)


def _aside(*work: Callable[[], None]) -> int:
    """A process of its own that does the work and ends."""
    parent, aside = os.getpid(), os.fork()
    if aside:
        return aside
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    try:
        for part in work:
            part()
    except BaseException:
        log.exception("compiling aside failed: each worker process compiles for itself")
        os._exit(1)
    os._exit(0)


def _end_with(parent: int) -> None:
    """Ends this process once its parent was killed: nobody waits for what it compiles any more."""
    while os.getppid() == parent:
        time.sleep(LOOKS_EVERY_S)
    os._exit(1)


@signals.worker_process_init.connect
def yield_to_others(**_: object) -> None:
    """An audit has all night; who asks the API waits for the answer."""
    os.nice(max(0, current_app.settings.worker_nice - os.nice(0)))


def is_outdated() -> bool:
    """Whether a newer version made the tables since this worker was started. It then takes nothing more, and all its
    processes end, so that who starts it again is told: of two versions each would audit its part of a run by its own
    method."""
    refusal = newer_than_we(backend().database)
    if refusal is None:
        return False
    if not ENDING[0]:  # told twice, it would not wait for what the others hold
        ENDING[0] = 1
        log.error("this worker ends: %s", refusal.message, extra={"code": refusal.code})
        os.kill(os.getppid(), signal.SIGTERM)
    return True


@signals.worker_process_shutdown.connect
def let_go(**_: object) -> None:
    if backend.cache_info().currsize:
        backend().close()
