"""The comparison covers every feature, every cell says something, and what it claims of this project is there."""

import re
from pathlib import Path

import pytest
from typer.main import get_command

from app.cli.main import cli
from app.main import create_app
from app.services.audit_json.models import ReliabilityRow
from app.settings import Settings

DOCS = Path(__file__).resolve().parents[2] / "docs"
TEXT = (DOCS / "COMPARISON.md").read_text(encoding="utf-8")
TABLE = [line.strip("|").split("|") for line in TEXT.splitlines() if line.startswith("| ")]
ROWS = [row for row in TABLE if row[0].strip() != "feature"]
OURS, OTHERS = [row for row in ROWS if len(row) == 3], [row for row in ROWS if len(row) > 3]
FEATURES = (
    "plant table",
    "health number",
    "service factor",
    "saturation",
    "travel and reversals",
    "oscillation",
    "stiction and its size",
    "parameters",
    "reliability or abstention",
    "rival causes",
    "Harris",
    "error statistics",
    "process model",
    "plant-wide groups",
    "economic priority",
    "treemap",
    "data quality",
    "compression detector",
    "connectors",
    "bulk import",
    "alerts",
    "reports",
    "history and before/after",
    "roles",
    "documented API",
    "simulation against recording",
    "missing physics",
    "published accuracy",
)


@pytest.mark.parametrize("feature", FEATURES)
def test_every_feature_has_its_row(feature):
    for table in (OURS, OTHERS):
        assert any(feature in row[0] for row in table)


def test_every_cell_is_one_of_the_answers():
    assert {len(row) for row in OTHERS} == {10}
    assert {row[0] for row in OURS} == {row[0] for row in OTHERS}
    for row in OTHERS:
        assert all(re.match(r"(yes|no|part|\?)", cell.strip()) for cell in row[1:]), row[0]
    assert {row[1].strip() for row in OURS} == {"yes", "no", "part"}


def test_every_note_that_is_referred_to_is_there():
    letters = {
        letter for row in OTHERS for cell in row[1:] for inner in re.findall(r"\(([a-z, ]+)\)", cell)
        for letter in inner.split(", ")
    }  # fmt: skip
    assert letters == set(re.findall(r"\(([a-z])\) ", TEXT.split("## Sources: what the others say")[1]))
    numbers = {number for row in OURS for number in re.findall(r"\((\d+)\)", row[2])}
    assert numbers == set(re.findall(r"^(\d+)\. ", TEXT, re.MULTILINE))


def test_what_is_claimed_of_this_project_is_there():
    paths = {re.sub(r"\{\w+(:path)?\}", "{}", path) for path in create_app(Settings()).openapi()["paths"]}
    named = re.findall(r"`(?:GET|POST) (/v1/[\w/{}]+)`", TEXT)
    assert named
    assert {re.sub(r"\{\w+\}", "{}", path) for path in named} <= paths
    fields = re.findall(r"`(hammerstein_\w+|health\w*|stiction_band\w+)`", TEXT)
    assert fields
    assert set(fields) <= set(ReliabilityRow.model_fields)
    settings = {f"LOOPAUDIT_{name.upper()}" for name in Settings.model_fields}
    assert set(re.findall(r"`(LOOPAUDIT_\w+)`", TEXT)) <= settings
    assert set(re.findall(r"`loopaudit ([a-z]+)", TEXT)) <= set(get_command(cli).commands)
    for link in re.findall(r"\]\(([\w.]+)\)", TEXT):
        assert (DOCS / link).is_file()
