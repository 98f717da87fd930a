"""A refinery's loop monitor: tab separated, five header lines, MV = OP, SV = SP, MODE 1 = automatic, off-line flags a
signal.

PROCESSDATA <tab> FIC101 Data <tab> yyyy-MM-dd HH:mm:ss
8 <tab> 10 <tab> start <tab> rows
tagname <tab> FIC101.MV <tab> FIC101.PV <tab> FIC101.SV <tab> FIC101.MODE <tab> bOpOFL <tab> bPvOFL <tab> bSpOFL <tab>
bAutOFL
desc ...
settings of the monitor
"""

from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.time_columns import form_of
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place

_FLAGS = {"bopofl": "OP", "bpvofl": "PV", "bspofl": "SP", "bautofl": "MODE"}
_FIRST_ROW = 5


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    start = next((at for at, row in enumerate(head.rows[:PREAMBLE_ROWS]) if any(row)), 0)
    names, first_row = head.row(start + 2), start + _FIRST_ROW
    if head.row(start)[:1] != ("PROCESSDATA",) or names[:1] != ("tagname",):
        return None
    form = form_of(head, (0,), first_row, options)
    if form is None:
        return None
    flags = {_FLAGS[name.lower()]: index for index, name in enumerate(names) if name.lower() in _FLAGS}
    values = tuple(
        ValueColumn(index, name, off_line=flags.get(place(name, head.stem).signal))
        for index, name in enumerate(names)
        if index and name and name.lower() not in _FLAGS
    )
    interval = head.row(start + 1)[1:2]
    notes = (f"the header gives a sampling interval of {interval[0]} s",) if interval else ()
    heading = (first_row - 2, first_row - 1)
    return (
        WidePlan("dcs_tab", first_row, len(names), (TimedColumns((0,), form, values),), notes=notes, heading=heading)
        if values
        else None
    )
