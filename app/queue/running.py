"""Runs a worker or the schedule in this process, until it is told to stop (SIGTERM, SIGINT)."""

import os
import sys
import uuid
from contextlib import suppress

from app import logs
from app.queue.jobs import queue_names
from app.settings import Settings
from app.threads import use_one_thread

# Not used, and each would talk to all other workers over the broker.
QUIET = ("--without-gossip", "--without-mingle", "--without-heartbeat")


def run_worker(settings: Settings, concurrency: int = 1, log_level: str = "WARNING") -> None:
    """Reads uploads and audits loops, in `concurrency` processes of one thread each. Blocks; SIGTERM ends it softly."""
    use_one_thread()
    from app.queue.application import celery_application

    logs.configure(settings)
    name = f"loopaudit-{os.getpid()}-{uuid.uuid4().hex[:6]}@%h"
    pool = ("--pool", "prefork", "--concurrency", str(concurrency))
    queues = ("--queues", ",".join(queue_names(settings).values()))
    application = celery_application(settings, works=True)
    application.set_current()
    if logs.is_json(settings):
        _say_the_end_in_json()
    application.start(["--quiet", "worker", "--hostname", name, *pool, *queues, *QUIET, "--loglevel", log_level])


def run_beat(settings: Settings, log_level: str = "WARNING") -> None:
    """Asks for a sweep every few seconds, which also starts the nightly audit when it is due. Two do no harm."""
    from app.queue.application import celery_application

    logs.configure(settings)
    application = celery_application(settings)
    application.set_current()
    application.start(["--quiet", "beat", "--pidfile", "", "--loglevel", log_level])


def _say_the_end_in_json() -> None:
    """Celery writes what it does of a signal to stdout, in words of its own, past every log."""
    from celery.apps import worker

    def say(text: str, _: object = None) -> None:
        with suppress(OSError):  # past the buffer, which may just be written: this is in the midst of anything
            os.write(sys.stderr.fileno(), f"{logs.in_json(text)}\n".encode())

    worker.safe_say = say
