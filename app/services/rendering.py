"""Templates of what leaves the service as a document of its own: mails, reports. What comes from a plant is escaped."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from app.services.telling.health_classes import HEALTH_LIMITS, HEALTH_WORDS
from app.services.telling.naming import isolated, with_capital
from app.services.telling.reasons import first_reasons
from app.services.telling.wording import (
    CHANGE_WORDS,
    POSSIBLY,
    RELIABILITY_BRIEF,
    RELIABILITY_SHORT,
    RELIABILITY_WORDS,
    VERDICT_RANK,
    VERDICT_WORDS,
    brief,
    cause_words,
    headline,
    health,
    measured_probability,
    probability,
    rely,
    starter_words,
    unusual_importance,
    weakly,
)


def figure(value: float | None, digits: int) -> str:
    """A number for people; a dash where there is none."""
    return "–" if value is None else f"{value:z.{digits}f}"


def importance(value: float) -> str:
    """As it was set: one of 0.04 is not none."""
    return f"{value:g}"


FILTERS: dict[str, Callable[..., Any]] = {
    "brief": brief,
    "weakly": weakly,
    "with_capital": with_capital,
    "cause_words": cause_words,
    "figure": figure,
    "first_reasons": first_reasons,
    "grouped": "{:,}".format,
    "headline": headline,
    "importance": importance,
    "isolated": isolated,
    "health": health,
    "measured_probability": measured_probability,
    "probability": probability,
    "rely": rely,
    "starter_words": starter_words,
    "unusual_importance": unusual_importance,
}
GLOBALS = {
    "possibly": POSSIBLY,
    "verdict_words": VERDICT_WORDS,
    "reliability_words": RELIABILITY_WORDS,
    "reliability_short": RELIABILITY_SHORT,
    "reliability_brief": RELIABILITY_BRIEF,
    "change_words": CHANGE_WORDS,
    "ranks": VERDICT_RANK,
    "health_limits": HEALTH_LIMITS,
    "health_words": HEALTH_WORDS,
}
"""What all templates may call, those of the pages too."""


def _environment() -> Environment:
    folder = Path(__file__).parent / "templates"
    templates = Environment(loader=FileSystemLoader(folder), autoescape=True, undefined=StrictUndefined)
    templates.trim_blocks = templates.lstrip_blocks = True
    templates.filters |= FILTERS
    templates.globals |= GLOBALS
    return templates


TEMPLATES = _environment()


def document(name: str, **values: Any) -> str:
    return TEMPLATES.get_template(name).render(**values)
