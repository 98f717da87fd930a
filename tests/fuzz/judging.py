"""What must hold for any bytes that are read as an export."""

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.errors import DataError
from app.ingest import Export, IngestOptions, LoopSamples, SignalBlock, read_export

DECLARED = frozenset(
    (
        *("empty_file", "not_an_export", "unknown_layout", "nothing_readable", "decompressed_too_large"),
        "compression_ratio",
        *(
            "line_too_long",
            "too_many_tags",
            "bad_mapping",
            "excel_not_installed",
            "unknown_time_zone",
            "more_fields_than_names",
        ),
    )
)
OF_ROWS = ("bad_time", "ragged_row", "other_names", "no_tag", "name_too_long", "unbalanced_quote", "duplicate_time")
NOTHING = re.compile(rb"""[\s,;|"']*|["']?\s*[*#\[].*|[^,;\t|]*[,;\t|]["']?\s*[*#\[].*""")
OPTIONS = IngestOptions(max_bytes=72 << 20, max_signals=50_000)  # above what is unpacked whatever its ratio


@dataclass(frozen=True)
class Outcome:
    """What reading came to: `refused` is the code of a file that could not be used."""

    refused: str | None
    loops: dict[str, LoopSamples]
    rows_kept: int = 0


def judge(data: bytes, name: str = "fuzzed.csv", options: IngestOptions = OPTIONS) -> Outcome:
    """Reads the bytes by loop and by signal. Raises AssertionError, or whatever a reader raises that it must not."""
    refusal: DataError | None = None
    with tempfile.TemporaryDirectory(prefix="judged") as folder:
        path = Path(folder, "stored")
        path.write_bytes(data)
        try:
            export = read_export(path, filename=name, options=options)
            loops = _loops(export)
            _count(export, data)
            _signals(read_export(path, filename=name, options=options))
        except DataError as error:
            refusal = error
        assert [left.name for left in Path(folder).iterdir()] == ["stored"], "something was left behind"
    if refusal is not None:
        assert refusal.code in DECLARED, f"undeclared code {refusal.code}"
        assert "\n" not in refusal.message, "a message of several lines"
        return Outcome(refusal.code, {})
    return Outcome(None, loops, export.summary().rows_kept)


def _loops(export: Export) -> dict[str, LoopSamples]:
    found: dict[str, LoopSamples] = {}
    for stretch in export.loops():
        assert stretch.loop not in found, "a loop came twice"
        found[stretch.loop] = stretch
        assert np.all(np.diff(stretch.time_ns) > 0), "times of a loop go back or repeat"
        signals = (stretch.pv, stretch.op, stretch.sp, stretch.automatic, *stretch.others.values())
        for signal in signals:
            assert signal is None or len(signal) == stretch.samples, "signals of different lengths"
            assert signal is None or not np.any(np.isinf(signal)), "a value that is not finite"
        mode = stretch.automatic
        assert mode is None or np.all(np.isnan(mode) | (mode == 0) | (mode == 1)), "a mode that is none"
    return found


def _signals(export: Export) -> None:
    blocks: list[SignalBlock] = list(export)
    kept = sum(int(np.isfinite(block.value).sum()) for block in blocks)
    assert kept == export.summary().values_kept, "values that were counted are not those that came"
    assert len({block.tag for block in blocks}) <= export.summary().tags


def _count(export: Export, data: bytes) -> None:
    """Rows kept and rows refused are all rows, but for those that hold nothing and comments."""
    summary, rejects = export.summary(), export.rejects()
    assert 0 < summary.rows_kept <= summary.rows_read
    assert all(count > 0 for count in rejects.counts.values())
    assert len(rejects.listed) <= rejects.total
    if summary.compressed or summary.encoding not in ("utf-8", "utf-8-sig"):
        return
    lost = summary.rows_read - summary.rows_kept
    refused = sum(rejects.counts.get(code, 0) for code in OF_ROWS)
    passed = sum(NOTHING.fullmatch(line) is not None for line in re.split(rb"\r\n|\r|\n", data))
    assert lost <= refused + passed, f"{lost} of {summary.rows_read} rows lost, {refused} refused, {passed} empty"
