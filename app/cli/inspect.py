"""`loopaudit inspect`: what a file holds, before anything is sent."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.audit import FORMS, recording_files
from app.cli.mapping import MappingOption, mapping_bytes
from app.cli.messages import ExitCode, console_for, say
from app.cli.stamps import DateOrder, DateOrderOption, TimeZoneOption, read_in
from app.counting import counted
from app.errors import DataError, LoopauditError
from app.services.moments import moment_of
from app.services.telling.exchanged_tags import exchanged_tags

if TYPE_CHECKING:
    from rich.table import Table

    from app.ingest import IngestOptions, InspectReport, LoopReport, TagMapping

SHOWN_LOOPS = 200
MOSTLY = 0.5


def inspect(
    paths: Annotated[list[Path], typer.Argument(help=f"Exports or recordings, or folders of them: {FORMS}.")],
    time_zone: TimeZoneOption = "UTC",
    date_order: DateOrderOption = DateOrder.auto,
    mapping: MappingOption = None,
) -> None:
    """Say what files hold, before anything is sent: layout, loops, times, and what would be refused and why.

    What is missing is counted over the rows from a loop's first to its last, with those that a hole leaves out.

    Exit code 1: some files cannot be audited; 2: none of them can.

    [bold]Examples[/bold]

      loopaudit inspect export.csv

      loopaudit inspect night.csv.gz --time-zone Europe/Berlin

      loopaudit inspect export.csv --mapping tags.csv

      loopaudit inspect exports/
    """
    from app.ingest import TagMapping

    files = recording_files(paths)
    tags = mapping_bytes(mapping)
    mapped = None if tags is None else TagMapping.from_bytes(tags)
    options = read_in(time_zone, date_order)
    usable = 0
    for file in files:
        try:
            usable += shown(file, mapped, options)
        except LoopauditError as error:
            if len(files) == 1:
                raise
            say(f"{file}: {error.message} [{error.code}]")
    if not usable:
        raise typer.Exit(ExitCode.NOTHING_USABLE)
    raise typer.Exit(ExitCode.DONE if usable == len(files) else ExitCode.SOME_FAILED)


def shown(file: Path, mapping: "TagMapping | None", options: "IngestOptions") -> bool:
    """Prints what one file holds; whether a loop of it can be audited."""
    from app.ingest import inspect as look

    if not file.is_file():
        raise DataError("no_such_file", f"{file} is not there or not a file")
    report = look(file, mapping=mapping, options=options)
    console = console_for(sys.stdout)
    for line in facts(report):
        console.print(line, markup=False)
    console.print(loop_table(report))
    for line in refused(report):
        console.print(line, markup=False)
    return any(auditable(loop) for loop in report.loops)


def facts(report: "InspectReport") -> Iterator[str]:
    summary = report.summary
    packed = ", compressed" if summary.compressed else ""
    yield f"{report.name}: {report.size_bytes:,} bytes{packed}"
    signs = f", delimiter {summary.delimiter!r}, decimals {summary.decimal_mark!r}" if summary.delimiter else ""
    yield f"layout      {summary.layout}, {summary.encoding}{signs}"
    yield f"time        {summary.time_format}, zone {summary.time_zone}"
    yield f"rows        {summary.rows_read:,} read, {summary.rows_kept:,} kept, {summary.values_kept:,} values"
    yield f"tags        {summary.tags:,} in {counted(len(report.loops), 'loop')}"
    for note in (*exchanged_tags(report.set_point_with_op), *summary.notes):
        yield f"note        {note}"


def loop_table(report: "InspectReport") -> "Table":
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for header in (
        "loop",
        "signals",
        "samples",
        "interval s",
        "even",
        "missing %",
        "from (UTC)",
        "to (UTC)",
        "to audit?",
    ):
        table.add_column(header, justify="right" if header in ("samples", "interval s", "missing %") else "left")
    for loop in report.loops[:SHOWN_LOOPS]:
        table.add_row(*map(Text, cells(loop)))
    if len(report.loops) > SHOWN_LOOPS:
        table.caption = f"and {counted(len(report.loops) - SHOWN_LOOPS, 'more loop')}"
    return table


def cells(loop: "LoopReport") -> list[str]:
    return [
        loop.loop,
        " ".join(loop.signals),
        f"{loop.samples:,}",
        "-" if loop.sampling_interval_s is None else f"{loop.sampling_interval_s:g}",
        "yes" if loop.even else "no",
        f"{100 * loop.missing_of_span:.1f}",
        utc(loop.first_time_ns),
        utc(loop.last_time_ns),
        to_audit(loop),
    ]


def to_audit(loop: "LoopReport") -> str:
    from app.engine.audit_config import AuditConfig

    if not auditable(loop):
        return "no: PV and OP are needed"
    least = AuditConfig().fitness.min_samples
    if loop.samples < least:
        return f"not alone: {least} samples are needed"
    return "yes" if loop.missing_share < MOSTLY else "yes, though mostly missing"


def auditable(loop: "LoopReport") -> bool:
    return {"PV", "OP"} <= set(loop.signals)


def utc(time_ns: int) -> str:
    return moment_of(time_ns).strftime("%Y-%m-%d %H:%M:%S")


def refused(report: "InspectReport", shown: int = 10) -> Iterator[str]:
    if not report.rejects.total:
        yield "nothing would be refused"
        return
    counts = ", ".join(f"{count:,} {code}" for code, count in sorted(report.rejects.counts.items()))
    yield f"{counted(report.rejects.total, 'row or value', 'rows or values')} would be refused: {counts}"
    for reject in report.rejects.listed[:shown]:
        where = "" if reject.line is None else f"line {reject.line}: "
        yield f"  {where}{reject.text} [{reject.code}]"
