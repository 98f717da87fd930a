"""What is said of loops whose set point lies with OP: the same of an upload, of a file looked at and of one audited."""

from collections.abc import Iterator, Sequence

from app.services.telling.naming import named


def exchanged_tags(loops: Sequence[str]) -> Iterator[str]:
    if loops:
        yield f"SP lies with OP, far from PV, in {named(loops)}: are the tags of PV and OP exchanged, or is SP in %?"
