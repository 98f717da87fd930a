"""The Celery application: one way of working on every broker."""

from typing import Any

from celery import Celery
from kombu import Queue as KombuQueue
from kombu.transport import TRANSPORT_ALIASES

from app.queue import turns
from app.queue.jobs import AUDIT_CHUNK, DELIVER, EXPLAIN, FORGOTTEN_AFTER_S, READ_UPLOAD, SWEEP, queue_names
from app.queue.steady import Every
from app.settings import TASK_LIMIT_S, Settings

FOLDER = "folder://"
DELIVERY_HARD_LIMIT_S = 120
READING_HARD_LIMIT_S = 4 * 3600
VISIBILITY_TIMEOUT_S = 900
"""Shorter than reading may take: who is given the message once more finds the upload claimed, and leaves."""
SOCKET_TIMEOUT_S = 30.0
CONNECT_TIMEOUT_S = 5.0
SWEEP_EXPIRES_S = 3600.0
"""By the clocks of two machines, which may differ: an hour's sweeps that nobody took are soon done."""

TRANSPORT_ALIASES["folder"] = "app.queue.folder:Transport"
TRANSPORT_ALIASES["redis"] = TRANSPORT_ALIASES["rediss"] = "app.queue.acknowledging:Transport"


def celery_application(settings: Settings, *, works: bool = False, answers_in_s: float = SOCKET_TIMEOUT_S) -> Celery:
    """An application for the broker of the settings. `works`: with its tasks, from the package `workers`.
    `answers_in_s`: a broker that says nothing for longer is away."""
    application = Celery("loopaudit", set_as_current=False, include=["workers.tasks"] if works else [])
    application.settings = settings
    queues = queue_names(settings)
    application.conf.update(
        broker_url=f"{FOLDER}localhost" if _in_folder(settings) else settings.resolved_broker_url,
        broker_transport_options=_transport_options(settings, answers_in_s),
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_channel_error_retry=not _in_folder(settings),
        broker_connection_timeout=min(CONNECT_TIMEOUT_S, answers_in_s),
        accept_content=["json"],
        task_serializer="json",
        task_ignore_result=True,
        task_queues=[KombuQueue(name, routing_key=name) for name in queues.values()],
        task_default_queue=queues[SWEEP],
        task_routes={job: {"queue": queue} for job, queue in queues.items()},
        task_annotations={
            AUDIT_CHUNK: {"time_limit": TASK_LIMIT_S},
            EXPLAIN: {"time_limit": TASK_LIMIT_S},
            DELIVER: {"time_limit": DELIVERY_HARD_LIMIT_S},
            READ_UPLOAD: {"time_limit": READING_HARD_LIMIT_S},
        },
        # A task that was cut off is not lost with its message: the database has its work, and the sweeper looks.
        task_acks_late=True,
        task_publish_retry=True,
        task_publish_retry_policy={"max_retries": 2, "interval_start": 0.1, "interval_step": 0.2, "interval_max": 0.5},
        worker_prefetch_multiplier=1,  # with late acknowledgement: the message that is worked on, and no other
        worker_consumer="app.queue.consuming:Consumer",
        worker_enable_remote_control=False,
        worker_send_task_events=False,
        worker_soft_shutdown_timeout=30.0,
        worker_max_tasks_per_child=settings.worker_tasks,
        worker_max_memory_per_child=settings.worker_memory_mb * 1024,
        worker_hijack_root_logger=False,
        worker_redirect_stdouts=False,
        worker_pool_start_method="fork",  # the children share the compiled kernels of their parent
        beat_scheduler="app.queue.steady:Scheduler",
        beat_max_loop_interval=5,
        beat_schedule={"sweep": _every(settings.sweep_s)},
    )
    return application


def _every(seconds: float) -> dict[str, Any]:
    options = {"expires": SWEEP_EXPIRES_S, "expiration": FORGOTTEN_AFTER_S}
    return {"task": SWEEP, "schedule": Every(seconds), "options": options}


def _in_folder(settings: Settings) -> bool:
    return settings.resolved_broker_url.startswith(FOLDER)


def _transport_options(settings: Settings, answers_in_s: float) -> dict[str, Any]:
    if _in_folder(settings):
        return {"folder": settings.resolved_broker_url.removeprefix(FOLDER), "polling_interval": 0.2}
    if not settings.resolved_broker_url.startswith("redis"):
        return {}
    return {
        "visibility_timeout": VISIBILITY_TIMEOUT_S,
        "socket_timeout": answers_in_s,
        "socket_connect_timeout": min(CONNECT_TIMEOUT_S, answers_in_s),
        "socket_keepalive": True,
        "health_check_interval": 25,
        "queue_order_strategy": f"{turns.__name__}:{turns.OrderOfQueues.__name__}",
    }
