"""Settings that cannot work are refused at the start, in words."""

import re
from datetime import time
from pathlib import Path

import pytest
from pydantic import ValidationError

from app.settings import Settings, misspelt


@pytest.mark.parametrize("address", ["garbage", "http://redis:6379", "redis.example:6379/0"])
def test_a_broker_that_celery_would_take_for_something_else_is_refused(address: str) -> None:
    with pytest.raises(ValidationError, match="must begin with redis://"):
        Settings(broker_url=address)


def test_a_broker_that_is_refused_is_not_told_with_its_password() -> None:
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url="redi://:hunter2@host/0")
    told = [error["msg"] for error in raised.value.errors(include_input=False)]
    assert "'redi'" in told[0]
    assert "hunter2" not in told[0]


@pytest.mark.parametrize("address", ["", "redis://127.0.0.1:6379/3", "rediss://host/0"])
def test_known_brokers_are_taken(address: str) -> None:
    assert Settings(broker_url=address).broker_url == address


@pytest.mark.parametrize("name", ["localtime", "Nowhere/City", "", "UTC+8", "../UTC"])
def test_a_zone_is_one_that_browsers_know_too(name):
    with pytest.raises(ValueError, match="is no time zone"):
        Settings(time_zone=name)


@pytest.mark.parametrize("told", ["2:00", "02:00", "02:00:00", " 2:00"])
def test_the_hour_of_the_night_is_taken_as_people_write_it(told: str) -> None:
    assert Settings(nightly_at=told).nightly_at == time(2)


@pytest.mark.parametrize("told", ["2", "7200", "25:00", "02:60", "2am", "", "02:00+01:00"])
def test_another_hour_is_refused_with_an_example(told: str) -> None:
    with pytest.raises(ValidationError, match="HH:MM is needed, such as 02:00"):
        Settings(nightly_at=told)


@pytest.mark.parametrize("name", ["", "  "])
def test_a_plant_has_a_name(name: str) -> None:
    with pytest.raises(ValidationError, match="a name is needed"):
        Settings(plant=name)


@pytest.mark.parametrize(
    ("variable", "meant"),
    [
        ("LOOPAUDIT_REQUIRE_KEY", "did you mean LOOPAUDIT_REQUIRE_KEYS?"),
        ("LOOPAUDIT_NIGHTLYAT", "did you mean LOOPAUDIT_NIGHTLY_AT?"),
        ("loopaudit_allowed_host", "did you mean LOOPAUDIT_ALLOWED_HOSTS?"),
        ("LOOPAUDIT_PORT", "README.md lists them"),
    ],
)
def test_a_variable_that_is_no_setting_is_told_with_what_may_be_meant(variable: str, meant: str) -> None:
    (told,) = misspelt({variable: "hunter2"})
    assert told.startswith(f"{variable} is no setting; {meant}")
    assert "hunter2" not in told


def test_settings_and_what_others_read_are_no_misspelt_ones() -> None:
    known = {f"LOOPAUDIT_{name.upper()}": "1" for name in Settings.model_fields}
    elsewhere = ("URL", "KEY", "RECORDINGS", "TEST_POSTGRES_URL", "TEST_REQUIRE_SERVERS")
    of_kubernetes = ("SERVICE_HOST", "SERVICE_PORT", "SERVICE_PORT_HTTP", "PORT_8000_TCP", "PORT_8000_TCP_ADDR", "PORT")
    others = {f"LOOPAUDIT_{name}": "tcp://10.0.0.1:8000" for name in (*elsewhere, *of_kubernetes)}
    assert misspelt({**known, **others, "loopaudit_plant": "north", "PATH": "/bin"}) == []


def test_every_variable_that_the_project_itself_names_is_known() -> None:
    root = Path(__file__).resolve().parents[2]
    files = [*root.glob("docs/**/*.md"), root / "README.md", root / "docker-compose.yml", root / "Makefile"]
    files += [file for part in ("app", "tests/e2e", "tests/chaos") for file in (root / part).rglob("*.py")]
    named = {name for file in files for name in re.findall(r"\bLOOPAUDIT_[A-Z]\w*[A-Z]\b", file.read_text())}
    assert len(named) > 50
    assert misspelt(dict.fromkeys(named, "")) == []
