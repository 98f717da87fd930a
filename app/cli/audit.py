"""`loopaudit audit`: files and folders of recordings, without a service, through the engine that the service uses."""

import os
from collections.abc import Generator, Iterator
from concurrent.futures import ProcessPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing import active_children, get_context
from os.path import realpath
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any

import typer

from app.cli import interrupts
from app.cli.compiling import compiling_told, told_by_one
from app.cli.mapping import MappingOption, mapping_bytes
from app.cli.messages import ExitCode, progress, say
from app.cli.outputs import is_stream, part_of, written
from app.cli.stamps import DateOrder, DateOrderOption, TimeZoneOption, read_in
from app.counting import counted
from app.errors import DataError, LoopauditError
from app.threads import OF_LINEAR_ALGEBRA, OF_READING, limit_to_one

if TYPE_CHECKING:
    from app.ingest import IngestOptions, RecordingsRead

FORMS = "CSV, text, parquet, Excel, MATLAB"
PROCESSES_PAY_FROM_FILES = 8
NO_SIGNALS = "unknown_layout"
SHOWN_REJECTS = 3
INTERRUPTED_WITHIN_S = 0.2


class Format(StrEnum):
    table = "table"
    jsonl = "jsonl"
    csv = "csv"


@dataclass(frozen=True)
class Reading:
    """How files are read; `mapping` as its bytes, which another process can be sent."""

    options: "IngestOptions"
    mapping: bytes | None = None


@dataclass(frozen=True)
class AuditedFile:
    """What became of one file: the audit lines of its recordings, or why there are none."""

    path: Path
    lines: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()
    skipped: bool = False
    failed: bool = False


def audit(
    paths: Annotated[
        list[Path], typer.Argument(help="Files, or folders of exports: CSV, text, parquet, Excel, MATLAB.")
    ],
    format_: Annotated[
        Format, typer.Option("--format", help="A table to read; jsonl or csv for machines.")
    ] = Format.table,
    out: Annotated[Path | None, typer.Option("--out", help="Write the results here instead of stdout.")] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=0, help="Processes, one thread each; 0: one a core.")] = 0,
    time_zone: TimeZoneOption = "UTC",
    date_order: DateOrderOption = DateOrder.auto,
    mapping: MappingOption = None,
) -> None:
    """Audit files or folders of recordings without a service: one line a recording.

    Loops of one file are heard beside each other: where one whose valve sticks may shake another, it says so.

    A recording has columns time, SP, PV, OP and perhaps MODE (any case, the usual synonyms), or any layout that a
    plant's historian exports. A file without PV and OP is reported and skipped.

    [bold]Examples[/bold]

      loopaudit audit FIC101.csv

      loopaudit audit recordings/ --format jsonl > verdicts.jsonl

      loopaudit audit recordings/ --format csv --out verdicts.csv --jobs 4

      loopaudit audit export.csv --time-zone Europe/Berlin --mapping tags.csv
    """
    how = Reading(read_in(time_zone, date_order), mapping_bytes(mapping))
    files = recording_files(paths)
    audited: list[AuditedFile] = []
    try:
        with (
            written(out, read_files(files, paths, mapping, out), part_of(out)) as stream,
            closing(audit_files(files, jobs, how)) as results,
        ):
            _audit_into(stream, audited, results, len(files), format_)
            if (code := exit_code(audited, paths)) is ExitCode.NOTHING_USABLE:
                raise typer.Exit(code)  # and what was in the file stays
    except KeyboardInterrupt:
        say(interrupted(audited, len(files), out))
        raise
    raise typer.Exit(code)


def _audit_into(
    stream: IO[str],
    audited: list[AuditedFile],
    results: Iterator[AuditedFile],
    files: int,
    format_: Format,
) -> None:
    """Gathers the results and writes them; of an interrupted audit those that it came to."""
    try:
        with progress("auditing", files) as advance:
            for result in results:
                advance(label=result.path.name)
                with interrupts.done_whole():  # what counts as audited is written
                    audited.append(result)
                    for note in result.notes:
                        say(f"{result.path}: {note}")
                    if format_ is Format.jsonl:
                        write_jsonl(stream, result.lines)
    except KeyboardInterrupt:
        write_rest(stream, format_, audited)
        raise
    write_rest(stream, format_, audited)


def recording_files(paths: list[Path]) -> list[Path]:
    """The files to read, each once, folders in the order of their names, and what was named and is not there: that
    fails by itself. Raises where nothing is left.
    """
    files = []
    for path in paths:
        if path.is_dir():
            from app.ingest import is_export_name  # with all that reads files, which is not needed to send one

            files += sorted(file for file in path.iterdir() if is_export_name(file.name) and file.is_file())
        else:
            files.append(path)
    if not files:
        raise DataError(
            "nothing_to_read", f"no exports (CSV, text, parquet, Excel, MATLAB) in {', '.join(map(str, paths))}"
        )
    return list(each_once(files))


def each_once(files: list[Path]) -> Iterator[Path]:
    """Without those that are one that came before, by whatever path; said on stderr."""
    first: dict[str, Path] = {}
    for file in files:
        before = first.setdefault(realpath(file), file)
        if before is file:
            yield file
        else:
            how = "named twice" if before == file else f"the same file as {before}"
            say(f"{file}: {how}, read once [same_file]")


def read_files(files: list[Path], named: list[Path], mapping: Path | None, out: Path | None) -> list[Path]:
    """All that is read, and what `out` would be the next time: a file that is taken for an export of its folder."""
    from app.ingest import is_export_name

    folders = [path for path in named if path.is_dir()]
    read = [*files, *([] if mapping is None else [mapping])]
    if out is not None and is_export_name(out.name):
        read += [folder / out.name for folder in folders]
    return read


def interrupted(audited: list[AuditedFile], files: int, out: Path | None) -> str:
    kept = "what was found so far is written"
    if not is_stream(out):
        found = any(result.lines for result in audited)
        kept = f"what was found so far is in {part_of(out)}; " if found else ""
        kept += f"{out} is left as it was"
    return f"loopaudit: interrupted, {len(audited):,} of {counted(files, 'file')} audited; {kept}"


def audit_files(files: list[Path], jobs: int, how: Reading) -> Generator[AuditedFile]:
    """Results in the order of the files, whichever process is done first.

    Processes with one thread each where there is enough to share; otherwise this one, which an interrupt ends at once.
    """
    wanted = min(jobs or os.cpu_count() or 1, len(files))
    if wanted <= 1 or (jobs == 0 and len(files) < PROCESSES_PAY_FROM_FILES):
        for file in files:
            audited = audited_here(file, how)
            interrupts.raise_swallowed()
            yield audited
        return
    limit_to_one(OF_LINEAR_ALGEBRA + OF_READING)
    with interrupts.ended_in_order():
        yield from _audited_by(_processes(wanted), files, how)


def _processes(number: int) -> ProcessPoolExecutor:
    context = get_context("spawn")
    return ProcessPoolExecutor(number, mp_context=context, initializer=told_by_one, initargs=(context.Lock(),))


def _audited_by(pool: ProcessPoolExecutor, files: list[Path], how: Reading) -> Generator[AuditedFile]:
    try:
        with interrupts.held_off():
            futures = [pool.submit(audit_file, file, how) for file in files]
        for file, future in zip(files, futures, strict=True):
            while not future.done():
                wait([future], timeout=INTERRUPTED_WITHIN_S)  # in steps: another thread may have got the signal
            error = future.exception()
            yield future.result() if error is None else failed_file(file, error)
    except BaseException:
        end(pool)
        raise
    pool.shutdown()


def end(pool: ProcessPoolExecutor) -> None:
    pool.shutdown(wait=False, cancel_futures=True)
    for process in active_children():
        process.terminate()


def audited_here(file: Path, how: Reading) -> AuditedFile:
    try:
        return audit_file(file, how)
    except Exception as error:  # noqa: BLE001 - told beside its file, as that of another process
        return failed_file(file, error)


def failed_file(file: Path, error: BaseException) -> AuditedFile:
    """A user's error fails its file alone, and so does a fault of ours: the others are still worth having."""
    if isinstance(error, LoopauditError):
        skipped = error.code == NO_SIGNALS
        text = f"{'skipped: ' if skipped else ''}{error.message} [{error.code}]"
        return AuditedFile(file, notes=(text,), skipped=skipped, failed=not skipped)
    if isinstance(error, FileNotFoundError):
        return AuditedFile(file, notes=("is not there [no_such_file]",), failed=True)
    if isinstance(error, OSError | UnicodeError):
        return AuditedFile(file, notes=(f"cannot be read: {error}",), failed=True)
    return AuditedFile(file, notes=(f"fault of loopaudit: {type(error).__name__}: {error}",), failed=True)


def audit_file(path: Path, how: Reading) -> AuditedFile:
    """Reads and audits one file; runs in a worker process."""
    from app.ingest import TagMapping, read_recordings
    from app.services.auditing.file_audit import audited_lines
    from app.services.moments import PlantClock
    from app.services.telling.exchanged_tags import exchanged_tags

    mapping = None if how.mapping is None else TagMapping.from_bytes(how.mapping)
    with compiling_told():
        content = read_recordings(path, mapping=mapping, options=how.options)
        lines = tuple(audited_lines(content, PlantClock(how.options.time_zone)))
    notes = tuple(in_words(content))
    if not content.recordings:
        # What the file holds instead may tell why.
        return AuditedFile(path, notes=(*notes, "skipped: no loop with PV and OP in it", *content.notes), skipped=True)
    return AuditedFile(
        path, lines, (*exchanged_tags(content.set_point_with_op), *content.notes, *notes), failed=bool(content.damage)
    )


def in_words(content: "RecordingsRead") -> Iterator[str]:
    """What is worth knowing about a file: loops that were passed over, the first refused rows, the rest as a number."""
    yield from (f"skipped: {why}" for why in content.skipped)
    for reject in content.rejects[:SHOWN_REJECTS]:
        where = "" if reject.line is None else f"line {reject.line}: "
        yield f"{where}{reject.text} [{reject.code}]"
    yield from beside_shown(sum(content.reject_counts.values()), len(content.rejects[:SHOWN_REJECTS]))


def beside_shown(refused: int, shown: int) -> Iterator[str]:
    """How many rows and values were refused beside those that are shown, where there are more."""
    if refused > shown:
        yield f"and {counted(refused - shown, 'more row or value that was', 'more rows or values that were')} refused"


def exit_code(audited: list[AuditedFile], named: list[Path]) -> ExitCode:
    """A folder may hold other files too; a file that was named is expected to hold a recording."""
    if not any(result.lines for result in audited):
        return ExitCode.NOTHING_USABLE
    expected = {realpath(path) for path in named}
    missed = any(result.failed or (result.skipped and realpath(result.path) in expected) for result in audited)
    return ExitCode.SOME_FAILED if missed else ExitCode.DONE


def write_jsonl(stream: IO[str], lines: tuple[dict[str, Any], ...]) -> None:
    import json

    for line in lines:
        stream.write(json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n")
    stream.flush()


def write_rest(stream: IO[str], format_: Format, audited: list[AuditedFile]) -> None:
    """What is written once all files are there; lines of JSON are written already."""
    lines = [line for result in audited for line in result.lines]
    if format_ is Format.jsonl or not lines:
        return
    if format_ is Format.csv:
        from app.services.audit_json.line import NOT_OF_FILES, reliability_row
        from app.services.spreadsheet import csv_lines

        rows = [reliability_row(line) for line in lines]
        stream.writelines(csv_lines(rows, [name for name in rows[0] if name not in NOT_OF_FILES]))
        return
    from app.cli.tables import print_verdicts

    print_verdicts(lines, stream)
