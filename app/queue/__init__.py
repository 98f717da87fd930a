"""Names of jobs, and the only door to Celery. A message is a doorbell: what is to do stands in the database."""

from app.queue.jobs import AUDIT_CHUNK, DELIVER, EXPLAIN, READ_UPLOAD, SWEEP
from app.queue.publishing import Queue

__all__ = ["AUDIT_CHUNK", "DELIVER", "EXPLAIN", "READ_UPLOAD", "SWEEP", "Queue"]
