"""The rooms of the house: who may import whom."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for room in ("app", "workers", "migrations") for path in (ROOT / room).rglob("*.py"))
LONGEST_MODULE = 500


def test_import_linter_accepts_the_way_of_the_data():
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("room", ["api", "web", "cli"])
def test_what_people_touch_knows_neither_sql_nor_celery(room):
    strangers = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "app" / room).rglob("*.py")
        for name in imported(path)
        if name.split(".")[0] in {"sqlalchemy", "celery", "kombu", "alembic"} or name.startswith("app.storage")
    }
    assert not strangers


def test_services_know_of_sql_no_more_than_a_connection_and_what_it_raises():
    """Statements, types of columns and the words of one database stay in `app.storage`."""
    strangers = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "app" / "services").rglob("*.py")
        for name in taken_of(path, "sqlalchemy")
        if name != "sqlalchemy.Connection" and not name.startswith("sqlalchemy.exc.")
    }
    assert not strangers
    spoken = [
        path for path in (ROOT / "app" / "services").rglob("*.py") if "exec_driver_sql" in path.read_text("utf-8")
    ]
    assert not spoken


def taken_of(path: Path, package: str) -> set[str]:
    """The names that a module takes from a package, those of whole modules too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return {name for name in names if name.split(".")[0] == package}


def test_engine_is_pure():
    allowed = {"numpy", "scipy", "numba", "app"}
    strangers = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "app" / "engine").rglob("*.py")
        for name in imported(path)
        if name.split(".")[0] not in allowed | set(sys.stdlib_module_names)
    }
    assert not strangers


def test_a_module_has_one_job_and_under_500_lines():
    long = {
        f"{path.relative_to(ROOT)}: {lines}"
        for path in SOURCES
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) >= LONGEST_MODULE
    }
    assert SOURCES
    assert not long


def test_no_module_is_called_after_what_it_is_not():
    empty_names = {"utils", "util", "helpers", "helper", "manager", "misc", "common"}
    assert not [path for path in SOURCES if path.stem in empty_names]
