"""What the benchmark makes of its runs."""

from pathlib import Path

import pytest

from app.services.bench import ingest, plant
from app.services.bench.page import performance_page
from app.services.bench.running import read

FIGURES = Path(__file__).parents[2] / "docs" / "performance.json"


def test_one_disturbed_run_does_not_move_the_scaling() -> None:
    usual = {1: 30.0, 2: 16.0}
    found = {name: {"wall_s": usual[count]} for name, count in plant.SCALING}
    assert plant._scaling(found) == 30.0 / 16.0
    assert plant._scaling(found | {"some_2_third": {"wall_s": 25.0}}) == 30.0 / 16.0
    assert plant._scaling(found | {"some_1": {"wall_s": 50.0}}) == 30.0 / 16.0


def test_polars_is_judged_by_its_median_run_for_each_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    times = iter([5.0, 9.0, 7.0, 4.0, 6.0, 4.5])

    def timed(path: Path, threads: int) -> dict[str, float]:
        asked.append(threads)
        return {"s": next(times), "cpu_s": 0.0, "peak_mb": 0.0}

    monkeypatch.setattr(ingest, "_polars", timed)
    found = ingest._alone(Path("any"))
    assert asked == [1, 2] * 3
    assert (found[1]["s"], found[1]["runs_s"]) == (6.0, [5.0, 7.0, 6.0])
    assert (found[2]["s"], found[2]["runs_s"]) == (4.5, [9.0, 4.0, 4.5])


def test_the_page_can_be_written_from_the_figures_that_are_kept() -> None:
    page = performance_page(read(FIGURES))
    assert "## Reading a day of" in page
    assert "Of polars" in page
    assert "in this order" in page
