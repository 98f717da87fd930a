"""The image holds what the installation of docker-compose.yml needs; no container engine is asked for that."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
DOCKERFILE = (ROOT / "Dockerfile").read_text("utf-8")
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text("utf-8"))
BASES = re.findall(r"^FROM (\S+)", DOCKERFILE, re.MULTILINE)
CLIENT_OF = {"trixie": "17", "bookworm": "15"}  # what each Debian has


def test_the_client_programs_are_of_the_version_of_the_server():
    server = re.fullmatch(r"postgres:(\d+)(-\w+)?", COMPOSE["services"]["postgres"]["image"])
    client = re.findall(r"postgresql-client-(\d+)", DOCKERFILE.rpartition("\nFROM ")[2])
    assert server
    assert client == [server[1]]


def test_what_a_plant_sets_reaches_every_process_and_nothing_goes_before_it():
    for name in ("migrate", "api", "worker", "beat"):
        service = COMPOSE["services"][name]
        assert service["env_file"] == [{"path": "loopaudit.env", "required": False}]
        where = {"LOOPAUDIT_DATABASE_URL", "LOOPAUDIT_BROKER_URL", "LOOPAUDIT_DATA_DIR"}
        assert service["environment"].keys() == where


def test_one_variable_sets_the_password_of_the_server_and_of_who_asks_it():
    told = COMPOSE["services"]["postgres"]["environment"]["POSTGRES_PASSWORD"]
    assert told == "${POSTGRES_PASSWORD:-loopaudit}"
    assert f"://loopaudit:{told}@" in COMPOSE["services"]["api"]["environment"]["LOOPAUDIT_DATABASE_URL"]


def test_the_distribution_of_the_image_is_named_and_has_that_client():
    names = {base.rpartition("-")[2] for base in BASES}
    assert len(names) == 1  # what is built in the one stage runs in the other
    assert f"postgresql-client-{CLIENT_OF[names.pop()]} " in DOCKERFILE
