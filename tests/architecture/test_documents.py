"""What README and pages of docs name can be found, and every setting stands in its table."""

import re
from pathlib import Path

import pytest

from app.cli.main import cli
from app.main import create_app
from app.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SETTINGS = (ROOT / "docs" / "SETTINGS.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(LOOPAUDIT_\w+)` \| (?:`(.*?)`)? *\| (.+?) \|$", SETTINGS, re.MULTILINE)
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
OF_THE_CLIENT = {"LOOPAUDIT_URL", "LOOPAUDIT_KEY"}


def test_every_setting_stands_in_the_table_with_its_meaning():
    listed = {name: meaning for name, _, meaning in ROWS}
    settings = {f"LOOPAUDIT_{name.upper()}": field.description for name, field in Settings.model_fields.items()}
    assert {name: meaning for name, meaning in listed.items() if name not in OF_THE_CLIENT} == settings


@pytest.mark.parametrize("name", [name for name in Settings.model_fields if not name.endswith("_port")])
def test_what_a_value_is_refused_for_stands_in_its_meaning(name):
    field = Settings.model_fields[name]
    ends = [getattr(limit, end) for limit in field.metadata for end in ("ge", "le") if hasattr(limit, end)]
    told = [int(number.replace(",", "")) for number in re.findall(r"\d[\d,]*", field.description)]
    asked = [int(end) for end in ends if end not in (0, 1)]
    weeks = 43_200  # minutes, for which nobody asks
    assert not {end for end in asked if end != weeks} - set(told)


@pytest.mark.parametrize(("variable", "default"), [(name, default) for name, default, _ in ROWS if default])
def test_the_defaults_in_the_table_are_the_defaults(monkeypatch, variable, default):
    if variable in OF_THE_CLIENT:
        return
    field = variable.removeprefix("LOOPAUDIT_").lower()
    monkeypatch.delenv(variable, raising=False)
    own = getattr(Settings(), field)
    monkeypatch.setenv(variable, default)
    assert getattr(Settings(), field) == own


def _anchors(page: Path) -> set[str]:
    """What a link may name in a page: its headings in small letters, without signs, hyphens for blanks."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_to_headings_in_them(page):
    for path, anchor in re.findall(r"\]\((?!http)([^)#\s]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8")):
        target = page.parent / path if path else page
        assert target.exists(), path
        assert not anchor or anchor in _anchors(target), f"{path}#{anchor}"


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
