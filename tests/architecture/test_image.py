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


def test_the_distribution_of_the_image_is_named_and_has_that_client():
    names = {base.rpartition("-")[2] for base in BASES}
    assert len(names) == 1  # what is built in the one stage runs in the other
    assert f"postgresql-client-{CLIENT_OF[names.pop()]} " in DOCKERFILE
