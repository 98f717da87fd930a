"""The layouts that ingest knows, each in its own file, asked in this order.

A new layout is a new file with a function `sniff(head, options) -> Plan | None` and a line here.
"""

from collections.abc import Callable

from app.ingest.head import Head
from app.ingest.layouts import aveva, dcs_tab, ignition, long, long_bare, per_tag, pi_datalink, trendminer, wide
from app.ingest.model import IngestOptions
from app.ingest.plans import Plan

Sniff = Callable[[Head, IngestOptions], Plan | None]

LAYOUTS: tuple[Sniff, ...] = (
    dcs_tab.sniff,
    ignition.sniff,
    trendminer.sniff,
    aveva.sniff,
    long.sniff,
    pi_datalink.sniff,
    long_bare.sniff,
    per_tag.sniff,
    wide.sniff,
)


def recognise(head: Head, options: IngestOptions) -> Plan | None:
    return next((plan for sniff in LAYOUTS if (plan := sniff(head, options)) is not None), None)
