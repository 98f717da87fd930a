"""Export files of historians to samples of loops: bytes in, signals and rejects out. No database, no web.

For services that store a plant's samples::

    options = IngestOptions(time_zone="Europe/Berlin")
    export = read_export(path, filename="night.csv.gz", mapping=mapping, options=options)
    for stretch in export.loops():  # LoopSamples: loop, time_ns (int64, UTC), pv, op, sp, automatic, others, resampled
        store(stretch)              # a signal that the stretch lacks is None, a missing value NaN
    export.rejects()                # Rejects: counts by code (exact), listed (the first: line, code, text, tag)
    export.summary()                # FileSummary: layout, encoding, tags, loops, rows, values, times, notes

* `read_export` raises DataError at once where the file is no export; iterating may raise one later (an unpacked size
  beyond the caps, nothing readable). Nothing else is raised by any bytes.
* Memory grows with the largest loop and not with the file, and each loop comes once: what is more than
  `options.buffered_values` values is put aside in files without a name in `options.spill_folder`; NoRoomToPartError
  where they do not fit there (see `export.share_taken`).
* `for block in export` gives the raw signals tag by tag instead (SignalBlock); `align(blocks)` makes LoopSamples of one
  loop's blocks; `realigned` does of a stretch whose PV and OP came apart.
* A file of relative seconds is anchored at `options.start_ns` (1970-01-01 UTC), its loop is named by the file.
* `mapping.find(tag)` has what the plant's mapping says besides: `.attributes` (unit, low, high, loop_type, ...),
  `.number("low")`.

Reject codes: bad_time, not_a_number, unclear_mark, not_finite, sentinel, bad_quality, off_line, unknown_mode,
ragged_row, other_names, other_unit, unbalanced_quote, duplicate_time, name_too_long, no_tag, sheet_not_read.
DataError codes: empty_file, not_an_export, unknown_layout, nothing_readable, decompressed_too_large, compression_ratio,
line_too_long, too_many_tags, bad_mapping, excel_not_installed, unknown_time_zone, matlab_version,
more_fields_than_names.

`read_recordings(path)` gives recordings for the engine, `inspect(path)` a report on a file, `read_named(path)` a table
whose columns are asked for by name, or by what they are: `column_of("PV")` by the names that exports are read by.
"""

from app.ingest.align import align, carried, realigned
from app.ingest.columns.names import names_no_measurement
from app.ingest.exports.export import Export
from app.ingest.exports.reading import is_export_name, is_read_packed, read_export, stem_of, takes_its_name
from app.ingest.files.unpacking import GZIP, Unpacking
from app.ingest.inspection import InspectReport, LoopReport, inspect
from app.ingest.model import (
    NO_TIME,
    FileSummary,
    IngestOptions,
    LoopSamples,
    LoopTags,
    Reject,
    Rejects,
    Signal,
    SignalBlock,
)
from app.ingest.named_columns import NamedTable, parse_named, read_instants, read_named
from app.ingest.recordings import RecordingsRead, read_recordings, second_zero_ns, to_recording
from app.ingest.set_points import SetPoints
from app.ingest.tables.scanning import warm_up
from app.ingest.tables.spilling import NoRoomToPartError
from app.ingest.tags.grouping import (
    SIMULATED,
    MappedTag,
    TagMapping,
    loop_of,
    mapping_text,
    names_its_loop,
    unit_of,
    without_unit,
)
from app.ingest.tags.lists import BEYOND, MAY_PART_THOUSANDS, Listed, list_rows, list_text
from app.ingest.tags.loops import group
from app.ingest.telling import without_controls
from app.ingest.times.stamps import check_time_zone

__all__ = [
    "BEYOND",
    "GZIP",
    "MAY_PART_THOUSANDS",
    "NO_TIME",
    "SIMULATED",
    "Export",
    "FileSummary",
    "IngestOptions",
    "InspectReport",
    "Listed",
    "LoopReport",
    "LoopSamples",
    "LoopTags",
    "MappedTag",
    "NamedTable",
    "NoRoomToPartError",
    "RecordingsRead",
    "Reject",
    "Rejects",
    "SetPoints",
    "Signal",
    "SignalBlock",
    "TagMapping",
    "Unpacking",
    "align",
    "carried",
    "check_time_zone",
    "group",
    "inspect",
    "is_export_name",
    "is_read_packed",
    "list_rows",
    "list_text",
    "loop_of",
    "mapping_text",
    "names_its_loop",
    "names_no_measurement",
    "parse_named",
    "read_export",
    "read_instants",
    "read_named",
    "read_recordings",
    "realigned",
    "second_zero_ns",
    "stem_of",
    "takes_its_name",
    "to_recording",
    "unit_of",
    "warm_up",
    "without_controls",
    "without_unit",
]
