"""The demo's table: a line a loop, whatever the width of the terminal."""

import io
import re

import pytest
from rich.text import Text

from app.cli.demo_table import print_demo
from app.services.demo import plant

ROW = {
    "unit": "CRUDE",
    "stiction_probability": 0.99,
    "reliability": "not_reliable",
    "health": 38.0,
    "stiction_S": 5.9,
    "stiction_S_low": 3.5,
    "stiction_S_high": 7.6,
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("columns", "size"), [(80, "5.9"), (140, "5.9 (3.5 to 7.6)")])
def test_verdict_and_reliability_stand_whole_in_the_line_of_a_loop(monkeypatch, columns, size):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    loops = [loop for loop in plant() if loop.right_verdict == "stiction"]
    terminal = Terminal()
    worst = print_demo(loops, [ROW | {"loop": loop.tag, "verdict": "stiction"} for loop in loops], terminal)
    lines = Text.from_ansi(terminal.getvalue()).plain.splitlines()
    assert worst == min(loop.tag for loop in loops)
    assert max(map(len, lines)) <= columns
    for loop in loops:
        (line,) = (line for line in lines if line.strip().startswith(loop.tag))
        assert {"valve sticks", "not reliable", size} <= set(re.split(r" {2,}", line.strip()))
        assert line.rstrip().endswith("right")
