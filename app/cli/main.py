"""The `loopaudit` command. Each command's module imports what it needs when it runs, so that --help is quick."""

import errno
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from inspect import cleandoc
from typing import Any

import typer
from typer.core import TyperGroup

from app.cli import (
    audit,
    bench,
    demo,
    digest,
    explain,
    inspect,
    interrupts,
    keys,
    loops,
    migrate,
    nightly,
    report,
    serve,
    simulate,
    trail,
    upkeep,
    upload,
    worker,
)
from app.cli.messages import ExitCode, refuse
from app.errors import LoopauditError, RequestError, in_our_words

EPILOG = (
    "Results go to stdout, messages to stderr. "
    "Exit codes: 0 done, 1 some inputs failed, 2 wrong usage, nothing usable, too long a wait or no room for the "
    "results, 130 interrupted."
)
INTERRUPTED = 128 + signal.SIGINT
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)


class StdoutClosedError(Exception):
    """Who reads the results has enough of them, as `head` has."""


def stdout_is_closed() -> bool:
    """Whether who read it is gone."""
    asked = select.poll()
    asked.register(sys.stdout.fileno(), 0)
    return bool(asked.poll(0))


@contextmanager
def told_of_closed_stdout() -> Iterator[None]:
    """Another pipe that is closed, as that of --out, takes results with it."""
    try:
        yield
    except BrokenPipeError as error:
        if stdout_is_closed():
            raise StdoutClosedError from error
        raise RequestError("output", "the results could not be written: their reader is gone") from error
    except SystemExit as error:  # what rich makes of it, once it has put another stdout in its place
        if isinstance(error.__context__, BrokenPipeError):
            raise StdoutClosedError from error
        raise


@contextmanager
def plainly_refused() -> Iterator[None]:
    """What is wrong with an option, without the words of the library that found it."""
    try:
        yield
    except typer.BadParameter as error:
        error.message = in_our_words(error.message)
        raise


class Commands(TyperGroup):
    """Commands of which a closed pipe is no failure: without this it is made exit code 1 before we see it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args:
            return super().parse_args(ctx, args)
        with redirect_stdout(sys.stderr):  # no command is wrong usage, and help then is no result
            return super().parse_args(ctx, args)

    def make_context(self, *args: Any, **kwargs: Any) -> Any:  # which prints --help
        with told_of_closed_stdout(), plainly_refused():
            return super().make_context(*args, **kwargs)

    def invoke(self, *args: Any, **kwargs: Any) -> Any:
        with told_of_closed_stdout(), plainly_refused():
            return super().invoke(*args, **kwargs)


cli = typer.Typer(
    cls=Commands,
    name="loopaudit",
    help="Audits every control loop of a plant and says which verdicts on valve stiction can be trusted.",
    epilog=EPILOG,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)

START, WORK, RUN = "Start here", "Without a service", "With a service"

cli.command("demo", rich_help_panel=START)(demo.demo)
cli.command("audit", rich_help_panel=WORK)(audit.audit)
cli.command("explain", rich_help_panel=WORK)(explain.explain)
cli.command("inspect", rich_help_panel=WORK)(inspect.inspect)
cli.command("simulate", rich_help_panel=WORK)(simulate.simulate)
cli.command("serve", rich_help_panel=RUN)(serve.serve)
cli.command("bench", rich_help_panel=RUN)(bench.bench)
cli.command("worker", rich_help_panel=RUN)(worker.worker)
cli.command("beat", rich_help_panel=RUN)(worker.beat)
cli.command("upload", rich_help_panel=RUN)(upload.upload)
cli.command("loops", rich_help_panel=RUN)(loops.loops)
cli.command("nightly", rich_help_panel=RUN)(nightly.nightly)
cli.command("digest", rich_help_panel=RUN)(digest.digest)
cli.command("report", rich_help_panel=RUN)(report.report)
cli.command("migrate", rich_help_panel=RUN)(migrate.migrate)
cli.command("doctor", rich_help_panel=RUN)(upkeep.doctor)
cli.command("backup", rich_help_panel=RUN)(upkeep.backup)
cli.command("restore", rich_help_panel=RUN)(upkeep.restore)
cli.add_typer(keys.cli, name="keys", cls=Commands, rich_help_panel=RUN)
cli.command("trail", rich_help_panel=RUN)(trail.trail)


def unwrapped(text: str) -> str:
    """Each paragraph in one line, its indent kept: terminals are narrower or wider than this source."""
    paragraphs = (paragraph.split("\n") for paragraph in cleandoc(text).split("\n\n"))
    return "\n\n".join(" ".join((first, *map(str.strip, rest))) for first, *rest in paragraphs)


for registered in cli.registered_commands:
    registered.help = unwrapped(registered.callback.__doc__ or "") if registered.callback else None


def show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        sys.stdout.write(f"loopaudit {version('loopaudit')}\n")
        raise typer.Exit


@cli.callback()
def options(
    version: bool = typer.Option(
        False, "--version", callback=show_version, is_eager=True, help="Say the version and stop."
    ),
) -> None:
    """Audits every control loop of a plant and says which verdicts on valve stiction can be trusted."""


def flushed() -> None:
    """Runs the command; what it wrote is on its way, or known not to be, before the process ends."""
    with interrupts.remembered():
        try:
            cli()
        finally:
            sys.stdout.flush()


def leave_stdout() -> None:
    """What is still to be written there would fail once more when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main() -> None:
    """A user's error, or no room for the results, becomes one line on stderr and exit code 2, a fault of ours a
    traceback.
    """
    try:
        flushed()
    except LoopauditError as error:
        refuse(error.message, error.code)
        sys.exit(ExitCode.NOTHING_USABLE)
    except (BrokenPipeError, StdoutClosedError):
        leave_stdout()
        sys.exit(ExitCode.DONE)
    except OSError as error:
        if error.filename is not None:
            refuse(f"{error.filename} cannot be used: {error.strerror}", "file")
        elif error.errno in NO_ROOM:
            leave_stdout()
            refuse(f"the results could not be written: {error.strerror}", "output")
        else:
            raise
        sys.exit(ExitCode.NOTHING_USABLE)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except SystemError:  # how Python words an exception that compiled code left behind
        if not interrupts.came():
            raise
        sys.exit(INTERRUPTED)
