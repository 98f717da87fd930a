"""What the README says can be found, and what can be set stands in it."""

import re
from pathlib import Path

import pytest

from app.cli.main import cli
from app.main import create_app
from app.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(LOOPAUDIT_\w+)` \| (?:`(.*?)`)? *\| (.+?) \|$", README, re.MULTILINE)
OF_THE_CLIENT = {"LOOPAUDIT_URL", "LOOPAUDIT_KEY"}


def test_every_setting_stands_in_the_table_with_its_meaning():
    listed = {name: meaning for name, _, meaning in ROWS}
    settings = {f"LOOPAUDIT_{name.upper()}": field.description for name, field in Settings.model_fields.items()}
    assert {name: meaning for name, meaning in listed.items() if name not in OF_THE_CLIENT} == settings


@pytest.mark.parametrize(("variable", "default"), [(name, default) for name, default, _ in ROWS if default])
def test_the_defaults_in_the_table_are_the_defaults(monkeypatch, variable, default):
    if variable in OF_THE_CLIENT:
        return
    field = variable.removeprefix("LOOPAUDIT_").lower()
    monkeypatch.delenv(variable, raising=False)
    own = getattr(Settings(), field)
    monkeypatch.setenv(variable, default)
    assert getattr(Settings(), field) == own


@pytest.mark.parametrize("link", re.findall(r"\]\((?!http)([^)#]+)\)", README))
def test_links_lead_to_files(link):
    assert (ROOT / link).exists()


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:app|tests|workers|migrations)/[\w/.]*)`", README))))
def test_places_named_for_changes_are_there(path):
    assert (ROOT / path).exists()


def test_commands_of_the_readme_exist():
    commands = {command.name for command in cli.registered_commands} | {group.name for group in cli.registered_groups}
    assert set(re.findall(r"`loopaudit (\w+)", README)) <= commands
    assert commands <= set(re.findall(r"loopaudit (\w+)", README))


def test_routes_of_the_readme_exist():
    paths = set(create_app(Settings()).openapi()["paths"])
    assert set(re.findall(r"(/v1/\w+(?:/\{\w+\})?)`", README)) <= {
        path.replace("upload_id", "id").replace("audit_id", "id") for path in paths
    }
