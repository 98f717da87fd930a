"""The demo's table: a line a loop, whatever the width of the terminal."""

import io
import re
from pathlib import Path

import pytest
from rich.text import Text

from app.cli.demo import NOT_KEPT, where_to_look
from app.cli.demo_table import print_demo
from app.services.demo import plant

ROW = {
    "unit": "CRUDE",
    "stiction_probability": 0.99,
    "reliability": "not_reliable",
    "reasons": "",
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
    print_demo(loops, [ROW | {"loop": loop.tag, "verdict": "stiction"} for loop in loops], terminal)
    lines = Text.from_ansi(terminal.getvalue()).plain.splitlines()
    assert max(map(len, lines)) <= columns
    for loop in loops:
        (line,) = (line for line in lines if line.strip().startswith(loop.tag))
        assert {"valve sticks", "look first", size} <= set(re.split(r" {2,}", line.strip()))
        assert line.rstrip().endswith("right")


def test_the_readme_walks_to_the_loop_at_the_top_whichever_it_is():
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    walk = readme[readme.index("## Five minutes") : readme.index("Then with your own data")]
    assert [loop.tag for loop in plant() if loop.tag in walk] == []
    assert 'Click on the loop at the top of "Worst first" (the second address)' in walk
    said = where_to_look("http://127.0.0.1:1", "FIC1")
    assert said[1].endswith("http://127.0.0.1:1/loops/FIC1")
    assert "`loopaudit demo --serve`" in NOT_KEPT[0]
    assert "loopaudit demo --serve`" in walk
