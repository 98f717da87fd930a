"""AVEVA Historian, long: DateTime,TagName,Value,vValue,Quality,QualityDetail,OPCQuality,wwTagKey; OPCQuality 192 or
Quality 0 is good."""

from app.ingest.columns.plain_names import first_of_each, words_in
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.plans_by_names import long_from
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    names = head.row(0)
    known = first_of_each(words_in(names)).keys()
    if "tagname" not in known or not known & {"vvalue", "wwtagkey", "qualitydetail"}:
        return None
    return long_from(head, "aveva", names, 1, options)
