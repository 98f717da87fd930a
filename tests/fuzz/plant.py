"""A small plant that has something behind every route: loops with hostile names, verdicts, an explanation, keys."""

from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from fastapi import FastAPI

from app.main import begin, create_app
from app.services.access import keys
from app.services.access.identity import Role
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.backend import Backend
from app.services.explaining.explanations import Wanted, ask
from app.services.explaining.simulations import GivenSimulation
from app.services.explaining.working import explain_next
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.swinging import wide

HOSTILE = "=A 1/<script>alert('x')</script>\"&?#%2F"
TAGS = ("FIC101", "LIC7", "塔顶/T 1", HOSTILE)
UNLIMITED = 1_000_000_000


@dataclass(frozen=True)
class Plant:
    settings: Settings
    backend: Backend
    keys: dict[str, str]
    tags: tuple[str, ...] = TAGS


def build(folder: Path, database_url: str = "") -> Plant:
    """`database_url`: of an empty PostgreSQL database; otherwise SQLite in the folder."""
    settings = Settings(data_dir=folder, database_url=database_url, require_keys=True, max_upload_bytes=4_000_000)
    migrate(settings)
    warm_up()
    backend = Backend.open(settings)
    with receive(backend, filename="plant.csv") as receiving:
        receiving.write(wide(*TAGS, unreadable="Bad Input"))
        receipt = receiving.commit()
    read_upload(backend, int(receipt.upload.id), "fuzz")
    audit_chunk(backend, int(start_audit(backend, LoopFilter()).id), "fuzz")
    ask(backend, TAGS[0], Wanted(None, None, None, GivenSimulation(None, None, None, None)), asked_by="fuzz")
    while explain_next(backend, "fuzz"):
        pass
    made = {role.value: made_key(backend, role) for role in Role}
    return Plant(settings, backend, made)


def app_of(plant: Plant) -> FastAPI:
    """The app as it is once its server has started."""
    app = create_app(plant.settings)
    begin(app, plant.backend)
    return app


def made_key(backend: Backend, role: Role) -> str:
    day = timedelta(days=1)
    return keys.create_key(backend, role.value, role, lifetime=day, requests_per_minute=UNLIMITED).text
