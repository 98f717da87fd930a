"""What is told of tags, and how: those of which the same is said together, the first of them by name."""

from collections.abc import Mapping, Sequence

_SHOWN = 3
_CONTROLS = dict.fromkeys((*range(0x20), *range(0x7F, 0xA0)), "\N{REPLACEMENT CHARACTER}")


def tags_by(said: Mapping[str, str], order: Sequence[str] = ()) -> dict[str, str]:
    """By what is said of a tag, in the order of the tags: the names of the first ones, and whether there are more.
    order: that of the tags of which the same is said; those that are not in it come behind, as they were said."""
    tags_of: dict[str, list[str]] = {what: [] for what in said.values()}
    place = {tag: number for number, tag in enumerate(order)}
    for tag in sorted(said, key=lambda tag: place.get(tag, len(place))):
        tags_of[said[tag]].append(tag)
    return {what: first_of(tags, _SHOWN) for what, tags in tags_of.items()}


def first_of(names: Sequence[str], most: int) -> str:
    """The first ones, and whether there are more."""
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")


def without_controls(text: str) -> str:
    """A name as it can be shown: a line end in it would part a line of a list or of a log in two."""
    return text.translate(_CONTROLS)
