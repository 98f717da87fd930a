"""`loopaudit bench`: this installation's speed beside that of its peers, and the page that shows it."""

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.cli.messages import ExitCode, say
from app.cli.outputs import refuse_outputs, written
from app.threads import OF_LINEAR_ALGEBRA


class Section(StrEnum):
    search = "search"
    audit = "audit"
    files = "files"
    ingest = "ingest"
    plant = "plant"
    api = "api"


def bench(
    sections: Annotated[list[Section] | None, typer.Argument(help="Only these; without any, all.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Small sizes: only good for seeing that it runs.")] = False,
    out: Annotated[Path, typer.Option("--out", help="The figures; sections that are not run keep theirs.")] = Path(
        "bench.json"
    ),
    page: Annotated[Path | None, typer.Option("--page", help="Write this page from the figures.")] = None,
    postgres: Annotated[
        str, typer.Option("--postgres", help="A server on which databases may be made and dropped.")
    ] = "postgresql+psycopg://127.0.0.1/postgres",
    redis: Annotated[str, typer.Option("--redis", help="An empty Redis database.")] = "redis://127.0.0.1:6379/9",
    recordings: Annotated[
        Path | None,
        typer.Option("--recordings", help="A folder of recordings to audit (CHEM1.csv is the paper's FC145)."),
    ] = None,
) -> None:
    """Measure the order search, the audit, reading exports, a plant's night and the API, beside their peers.

    Takes about twenty minutes on a machine that should do nothing else meanwhile, 20 GB of disk and 6 GB of
    memory. Needs PostgreSQL and Redis for ingest, plant and api, and the packages of requirements-bench.lock for the
    comparison with SIPPY; what is missing is skipped and named.

    [bold]Examples[/bold]

      loopaudit bench --quick

      loopaudit bench search audit --out bench.json --page PERFORMANCE.md
    """
    os.environ.update(dict.fromkeys(OF_LINEAR_ALGEBRA, "1"))
    from app.lab.bench import running
    from app.lab.bench.page import performance_page, summary

    refuse_outputs([out, page])
    wanted = running.Wanted([s.value for s in sections or list(Section)], quick, postgres, redis, recordings)

    def keep(text: str) -> None:
        with written(out) as stream:
            stream.write(text)

    figures = running.run(wanted, running.read(out), keep, lambda text: say(f"loopaudit bench: {text}"))
    if page is not None:
        with written(page, [out]) as stream:
            stream.write(performance_page(figures))
    typer.echo(summary(figures))
    raise typer.Exit(ExitCode.DONE)
