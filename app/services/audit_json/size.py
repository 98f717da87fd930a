"""The size of stiction as JSON: what an audit line states of it, and what is stored beside."""

from typing import Any

from pydantic import BaseModel, Field

from app.engine.audit import Audit
from app.engine.quantification import StictionSize


class StictionSizeLine(BaseModel):
    """How large stiction is. Null where the valve is cleared, or where the record does not tell (`identifiable`)."""

    identifiable: bool = Field(description="Whether the record can tell S: a regular, long, well sampled limit cycle.")
    S: float | None = Field(description="Deadband plus stickband, in units of OP.")
    S_low: float | None = Field(description="Low end of the 95 % interval of S, in units of OP.")
    S_high: float | None = Field(description="High end of the 95 % interval of S, in units of OP.")
    S_pct_of_op_range: float | None = Field(description="S in per cent of the range that OP covers in the window.")
    S_pct_of_span: float | None = Field(description="S in per cent of the span of OP; null where that is not known.")
    J_low: float | None = Field(description="Least slip jump that is possible, in units of OP.")
    J_high: float | None = Field(description="Largest slip jump of a valve without overshoot, in units of OP.")
    missed: list[str] = Field(description="Codes of what the record lacks for S to be identifiable.")


class FlatSize(BaseModel):
    """The same in a row of the reliability table."""

    stiction_size_identifiable: bool = Field(False, description="Whether the record can tell how large stiction is.")
    stiction_S: float | None = Field(None, description="Deadband plus stickband, in units of OP; null: not told.")
    stiction_S_low: float | None = Field(None, description="Low end of the 95 % interval of S, in units of OP.")
    stiction_S_high: float | None = Field(None, description="High end of the 95 % interval of S, in units of OP.")
    stiction_S_pct_of_op_range: float | None = Field(None, description="S in per cent of OP's range in the window.")
    stiction_S_pct_of_span: float | None = Field(None, description="S in per cent of the span of OP, where known.")
    stiction_J_low: float | None = Field(None, description="Least slip jump that is possible, in units of OP.")
    stiction_J_high: float | None = Field(None, description="Largest slip jump that is possible, in units of OP.")


NO_SIZE = StictionSizeLine(
    identifiable=False,
    S=None,
    S_low=None,
    S_high=None,
    S_pct_of_op_range=None,
    S_pct_of_span=None,
    J_low=None,
    J_high=None,
    missed=[],
)


def stiction_size_line(audit: Audit) -> StictionSizeLine:
    """The size as it is stated: null throughout where the record does not tell it."""
    size = audit.stiction_size
    if size is None:
        return NO_SIZE
    missed = [finding.code for finding in size.findings if finding.outcome != "pass"]
    if not size.identifiable:
        return NO_SIZE.model_copy(update={"missed": missed})
    interval = size.interval()
    return StictionSizeLine(
        identifiable=True,
        S=size.S,
        S_low=interval.low,
        S_high=interval.high,
        S_pct_of_op_range=100.0 * size.S / audit.op_span if audit.op_span else None,
        S_pct_of_span=100.0 * size.S / audit.op_instrument_span if audit.op_instrument_span else None,
        J_low=0.0,
        J_high=interval.high,
        missed=missed,
    )


def stiction_size_detail(size: StictionSize) -> dict[str, Any]:
    """All intervals and the checks of what is identifiable, for storage."""
    return {
        "S": size.S,
        "S_intervals": [vars(interval) for interval in size.S_intervals],
        "identifiable": size.identifiable,
        "findings": [vars(finding) for finding in size.findings],
    }


def flat_size(stated: dict[str, Any]) -> dict[str, Any]:
    """`FlatSize` from a `StictionSizeLine` that was dumped."""
    values = {
        f"stiction_{name}": value for name, value in stated.items() if f"stiction_{name}" in FlatSize.model_fields
    }
    return {**values, "stiction_size_identifiable": stated["identifiable"]}
