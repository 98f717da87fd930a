"""Celery's tasks: each loads, calls one service, and stops. Started by `loopaudit worker`."""
