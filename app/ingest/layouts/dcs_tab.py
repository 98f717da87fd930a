"""A refinery's loop monitor: tab separated, five header lines, MV = OP, SV = SP, MODE 1 = automatic, off-line flags a
signal.

PROCESSDATA <tab> FIC101 Data <tab> yyyy-MM-dd HH:mm:ss
8 <tab> 10 <tab> start <tab> rows
tagname <tab> FIC101.MV <tab> FIC101.PV <tab> FIC101.SV <tab> FIC101.MODE <tab> bOpOFL <tab> bPvOFL <tab> bSpOFL <tab>
bAutOFL
desc ...
settings of the monitor
"""

from app.ingest.columns.names import form_of
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place

_FLAGS = {"bopofl": "OP", "bpvofl": "PV", "bspofl": "SP", "bautofl": "MODE"}
_FIRST_ROW = 5
_HEADING = (3, 4)


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    if head.row(0)[:1] != ("PROCESSDATA",) or head.row(2)[:1] != ("tagname",):
        return None
    names = head.row(2)
    form = form_of(head, (0,), _FIRST_ROW, options)
    if form is None:
        return None
    flags = {_FLAGS[name.lower()]: index for index, name in enumerate(names) if name.lower() in _FLAGS}
    values = tuple(
        ValueColumn(index, name, off_line=flags.get(place(name, head.stem).signal))
        for index, name in enumerate(names)
        if index and name and name.lower() not in _FLAGS
    )
    interval = head.row(1)[1:2]
    notes = (f"the header gives a sampling interval of {interval[0]} s",) if interval else ()
    return (
        WidePlan("dcs_tab", _FIRST_ROW, len(names), (TimedColumns((0,), form, values),), notes=notes, heading=_HEADING)
        if values
        else None
    )
