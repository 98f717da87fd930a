"""OP beside the traces of an explanation."""

from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.judge.result import Verdict
from app.services.axes import ticks
from app.services.explaining.plot import COLOURS, LINE, as_many, explanation_html, figure_of
from app.services.explaining.svg import DIFFERS, UNSEEN, explanation_svg, legend, panel
from tests.engine.plain_loop import GIVEN, TS, moves, recorded


def test_ticks_are_round_numbers_within_the_axis() -> None:
    assert ticks(0.0, 2700.0) == [0.0, 1000.0, 2000.0]
    assert ticks(-0.31, 0.42) == [-0.2, 0.0, 0.2, 0.4]


def test_a_drawing_has_what_was_given_and_two_colours_for_two_kinds_of_stretch() -> None:
    t = np.arange(20.0)
    drawn = "".join(panel((0, 0), (100, 50), t, [("recording", t), ("given", 2 * t)], "PV", [(2.0, 5.0)], DIFFERS))
    assert COLOURS["given"] in drawn
    assert DIFFERS in drawn
    said = "".join(legend(0, 0, ["recording", "given"]))
    assert all(words in said for words in ("given", "where they differ", "held out of the fit", UNSEEN))


def test_op_keeps_step_with_traces_at_an_interval_that_is_no_whole_number_of_samples() -> None:
    np.testing.assert_array_equal(as_many(np.arange(10.0), 4), [0.0, 2.0, 5.0, 7.0])
    np.testing.assert_array_equal(as_many(np.arange(10.0), 10), np.arange(10.0))


@pytest.mark.parametrize(("verdict", "said"), [("consistent", "nothing is missing"), ("inconclusive", "cannot tell")])
def test_a_plot_without_names_says_what_the_verdict_says(verdict: Verdict, said: str) -> None:
    op = 40.0 + moves()
    found = replace(explain(Comparison("loop", TS, op, recorded(moves()), simulation=GIVEN)), verdict=verdict)
    assert found.effects == ()
    for drawn in (explanation_svg(found, op), explanation_html(found, op)):
        assert said in drawn
        assert ("nothing is missing" in drawn) is (verdict == "consistent")
    assert '"showSendToCloud": false' in explanation_html(found, op)  # its bytes stay with the plant


def test_the_page_has_room_between_its_plots_and_says_what_is_shaded_and_framed() -> None:
    """The title of the time axis stood across that of the plot below it."""
    op = 40.0 + moves()
    drawn = figure_of(explain(Comparison("loop", TS, op, recorded(moves()), simulation=GIVEN)), op).layout
    inner = drawn.height - drawn.margin.t - drawn.margin.b
    below, above = drawn.yaxis3.domain[1], drawn.yaxis2.domain[0]
    assert (above - below) * inner >= 80  # labels of ticks, title of the axis, title of the plot
    titles = [annotation.text for annotation in drawn.annotations]
    assert ["shaded" in titles[0], "framed" in titles[1]] == [True, True]


def test_a_name_is_shown_as_it_is_and_its_title_folded() -> None:
    """`<b>` and the like in a tag were taken for markup, and of a long title the end was beyond the page."""
    op = 40.0 + moves()
    found = explain(Comparison("loop", TS, op, recorded(moves()), simulation=GIVEN))
    drawn = figure_of(replace(found, name="<b>&amp;" + "Long_" * 40), op).layout
    lines = [unescape(line) for line in drawn.title.text.split("<br>")]
    assert "".join(lines).startswith("<b>&amp;" + "Long_" * 40)
    assert max(map(len, lines)) <= 42
    titles = [line for annotation in drawn.annotations for line in annotation.text.split("<br>")]
    assert max(map(len, titles)) <= 40
    above_title = (drawn.legend.y - 1) * (drawn.height - drawn.margin.t - drawn.margin.b)
    assert (drawn.legend.yanchor, above_title) == ("bottom", pytest.approx(2.5 * LINE))
    # A row on top, the title, the names of the lines in two rows on a telephone, the title of the plot.
    assert drawn.margin.t >= LINE * (1 + len(lines) + 2 + 2.5)
