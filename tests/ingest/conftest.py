"""Writing a small file and reading it whole."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

import pytest

from app.ingest import FileSummary, IngestOptions, LoopSamples, Rejects, TagMapping, read_export


@dataclass(frozen=True)
class Content:
    """A file, read to its end."""

    loops: dict[str, LoopSamples]
    rejects: Rejects
    summary: FileSummary


Read = Callable[..., Content]


def in_pairs(**choices: Sequence[object]) -> pytest.MarkDecorator:
    """Cases in which each choice of one argument meets each of another, as few as it takes: most faults need no three
    of them, and all products are many times as many files to be read.
    """

    def pairs_of(case: tuple[int, ...]) -> set[tuple[tuple[int, int], ...]]:
        return set(combinations(enumerate(case), 2))

    every = list(product(*(range(len(values)) for values in choices.values())))
    missing, cases = set().union(*map(pairs_of, every)), []
    while missing:
        best = max(every, key=lambda case: len(pairs_of(case) & missing))
        missing -= pairs_of(best)
        cases.append(best)
    chosen = [tuple(values[at] for values, at in zip(choices.values(), case, strict=True)) for case in sorted(cases)]
    return pytest.mark.parametrize(tuple(choices), chosen)


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read_it(
        data: str | bytes,
        name: str = "export.csv",
        mapping: TagMapping | None = None,
        options: IngestOptions | None = None,
    ) -> Content:
        path = tmp_path / "stored"
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        export = read_export(path, filename=name, mapping=mapping, options=options)
        loops = list(export.loops())
        by_name = {samples.loop: samples for samples in loops}
        assert len(by_name) == len(loops), "a loop came twice"
        return Content(by_name, export.rejects(), export.summary())

    return read_it
