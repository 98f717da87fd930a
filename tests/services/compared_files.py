"""Files that tests of comparisons write, and with which code one is refused."""

from pathlib import Path

import pytest

from app.errors import LoopauditError
from app.services.explaining.comparisons import Columns, read_comparison


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def rows(n: int, step: float = 2.0, start: float = 0.0) -> str:
    return "\n".join(f"{start + step * k},{50 + k % 7},{40 + k % 5}" for k in range(n))


def simulated_rows(simulated: list[str]) -> str:
    lines = [f"{line},{cell}" for line, cell in zip(rows(len(simulated)).split("\n"), simulated, strict=True)]
    return "time,PV,OP,PV_sim\n" + "\n".join(lines)


def code_of(path: Path, columns: Columns, simulated: str | None = None) -> str:
    with pytest.raises(LoopauditError) as raised:
        read_comparison(path, columns, simulated)
    return raised.value.code
