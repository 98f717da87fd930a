"""What is told of tags in a note: those of which the same is said together, the first of them by name."""

from collections.abc import Mapping

_SHOWN = 3


def tags_by(said: Mapping[str, str]) -> dict[str, str]:
    """By what is said of a tag, in the order of the tags: the names of the first ones, and whether there are more."""
    tags_of: dict[str, list[str]] = {}
    for tag, what in said.items():
        tags_of.setdefault(what, []).append(tag)
    return {
        what: f"{', '.join(tags[:_SHOWN])}{', ...' if len(tags) > _SHOWN else ''}" for what, tags in tags_of.items()
    }
