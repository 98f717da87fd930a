"""Writing a small file and reading it whole."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.ingest import FileSummary, IngestOptions, LoopSamples, Rejects, TagMapping, merge, read_export


@dataclass(frozen=True)
class Content:
    """A file, read to its end."""

    loops: dict[str, LoopSamples]
    rejects: Rejects
    summary: FileSummary


Read = Callable[..., Content]


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
        loops: dict[str, LoopSamples] = {}
        for stretch in export.loops():
            known = loops.get(stretch.loop)
            loops[stretch.loop] = stretch if known is None else merge(known, stretch)
        return Content(loops, export.rejects(), export.summary())

    return read_it
