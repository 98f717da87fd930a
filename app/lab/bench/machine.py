"""The machine and the versions that figures belong to."""

import os
import platform
import sqlite3
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from app.engine import ENGINE_VERSION

PARTS = ("numpy", "numba", "scipy", "polars", "statsmodels", "sippy-unipi", "sqlalchemy", "psycopg", "celery", "redis")


def describe() -> dict[str, Any]:
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": _line("/proc/cpuinfo", "model name") or platform.processor() or "not told",
        "cores": len(os.sched_getaffinity(0)),
        "memory_gb": round(int((_line("/proc/meminfo", "MemTotal") or "0 kB").split()[0]) / 1e6, 1),
        "system": f"{platform.system()} {platform.release().partition('-')[0]}",
        "python": platform.python_version(),
        "sqlite": sqlite3.sqlite_version,
        "engine": ENGINE_VERSION,
        "versions": {part: found for part in PARTS if (found := _version(part))},
        "load_before": round(os.getloadavg()[0], 2),
    }


def _line(path: str, name: str) -> str | None:
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), None)


def _version(part: str) -> str | None:
    try:
        return version(part)
    except PackageNotFoundError:
        return None
