"""The answer of an audit, whichever rule gave it: verdict, probability, reliability, reasons."""

from dataclasses import dataclass
from typing import Literal

from app.engine.codes import Cause, ReasonCode
from app.engine.corroborate import Corroboration
from app.engine.evidence import Reason
from app.engine.rivals.rival import Rival

Verdict = Literal["stiction", "no_stiction", "inconclusive", "not_auditable"]
Reliability = Literal["reliable", "not_reliable"]

UNCOUPLED: ReasonCode = "uncoupled"
"""The reason that nothing in a record tells of a valve: PV owes nothing to OP."""

NO_ANSWER: ReasonCode = "no_answer"
"""The reason that a valve which is said not to stick may stand fast: PV is not seen to answer OP."""

HIDDEN_BAND: ReasonCode = "hidden_band"
"""The reason that a valve may have a band, whatever the shapes say: the stem of such a valve foretells PV."""

OWN_CYCLE: ReasonCode = "own_cycle"
FOREIGN_CYCLE: ReasonCode = "foreign_cycle"
"""The reasons that a cycle is the valve's, by what its stem tells of PV, and that it may be made elsewhere."""

OUTSIDE_CORNERS: ReasonCode = "outside_corners"
"""The reason that PV turns by itself, and not where OP has gone far enough: what shapes it may be outside."""

LINEAR_LOOK_ALIKES: ReasonCode = "linear_look_alikes"
"""The reason that shapes which look sticky are not told from those of a linear loop under a load that wanders."""

PV_STANDS: ReasonCode = "pv_stands"
WOUND_UP: ReasonCode = "wound_up"
"""The reasons that by the end of a record nothing is controlled any more."""

ANSWERS_NO_MORE: ReasonCode = "answers_no_more"
"""The reason that PV, which moves, has stopped to answer OP within the record."""


@dataclass(frozen=True)
class Judgement:
    """What is said about a valve, and why.

    stiction_probability: 0 to 1; None only with "not_auditable".
    likely_cause: a stable code of what probably drives the loop or spoils the record, or None where nothing is known.
    rivals: stiction and its rival explanations, ranked; empty where nothing could be weighed.
    methods: what each published method says beside the verdict; empty where none was asked.
    unanswered_s: for how long PV has not answered OP up to the record's end, s; None where that is not known.
    unanswered_since_s: since when, s from the recording's start; None where it did not when the recording began.
    hidden_band_op: the band that PV shows though the shapes clear the valve, unit of OP; None where it shows none.
    """

    verdict: Verdict
    stiction_probability: float | None
    reliability: Reliability
    reasons: tuple[Reason, ...]
    likely_cause: Cause | None
    rivals: tuple[Rival, ...] = ()
    methods: tuple[Corroboration, ...] = ()
    unanswered_s: float | None = None
    unanswered_since_s: float | None = None
    hidden_band_op: float | None = None

    @property
    def shows_no_valve(self) -> bool:
        """Whether the record, neither accusing nor clearing, tells nothing of a valve."""
        return self.verdict == "inconclusive" and any(reason.code == UNCOUPLED for reason in self.reasons)
