"""The order of verdicts and causes by the words that people are told, which the database has no part in."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, FromClause, case

from app.engine.codes import UNANSWERED

BY_VERDICT_WORDS = (("inconclusive",), ("no_stiction",), ("not_auditable",), ("stiction",))
BY_CAUSE_WORDS = (
    ("backlash",), ("quantised_sensor",), ("aggressive_controller",), ("sluggish_controller",), ("disturbance",),
    ("no_oscillation",), ("external_oscillation",), ("set_point_following",), ("not_in_automatic",),
    ("op_at_limits", "saturated_op"), ("controller_not_acting",), ("on_off_control",), (UNANSWERED,),
    ("sampled_too_slowly",), ("sensor_spikes",), ("sensor_sticking",), ("stiction",), ("tight_tuning",),
    ("tuning_or_sinusoidal_disturbance",), ("data",),
)  # fmt: skip
"""Codes in the order of the words that people are told in their place; those with the same words are together."""


def _worded(column: ColumnElement[Any], ordered: Sequence[Sequence[str]]) -> ColumnElement[Any]:
    """The place of the words of a code; one that is not known comes behind all others."""
    places = {code: place for place, codes in enumerate(ordered) for code in codes}
    return case(places, value=column, else_=case((column.is_not(None), len(ordered))))


def by_words(said: FromClause) -> dict[str, ColumnElement[Any]]:
    """Names to sort by, of `verdicts` or `newest_rows`."""
    return {
        "verdict_words": _worded(said.c.verdict, BY_VERDICT_WORDS),
        "likely_cause_words": _worded(said.c.likely_cause, BY_CAUSE_WORDS),
    }
