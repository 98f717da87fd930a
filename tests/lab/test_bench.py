"""What the benchmark makes of its runs."""

from pathlib import Path

import pytest

from app.cli.bench import Section
from app.lab.bench import audit, files, ingest, plant
from app.lab.bench.bench import QUICK, Bench, SkippedError
from app.lab.bench.machine import describe
from app.lab.bench.measure import yardstick_s
from app.lab.bench.page import performance_page
from app.lab.bench.running import SECTIONS, read
from app.services import demo

FIGURES = Path(__file__).parents[2] / "docs" / "performance.json"


def test_one_disturbed_run_does_not_move_the_scaling() -> None:
    usual = {1: 30.0, 2: 16.0}
    found = {name: {"wall_s": usual[count]} for name, count in plant.SCALING}
    assert plant._scaling(found) == 30.0 / 16.0
    assert plant._scaling(found | {"some_2_third": {"wall_s": 25.0}}) == 30.0 / 16.0
    assert plant._scaling(found | {"some_1": {"wall_s": 50.0}}) == 30.0 / 16.0


def test_reading_is_judged_by_the_median_of_rounds_of_one_run_each(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[object] = []
    polars = iter([5.0, 9.0, 7.0, 4.0, 6.0, 4.5])
    ours = iter([(12.0, 500.0), (30.0, 400.0), (16.0, 700.0)])

    def timed(path: Path, threads: int) -> dict[str, float]:
        asked.append(threads)
        return {"s": next(polars), "cpu_s": 0.0, "peak_mb": 0.0}

    def end_to_end(bench: object, name: str, path: Path) -> dict[str, float]:
        asked.append("ours")
        took, peak = next(ours)
        return {"whole_s": took, "read_s": took - 2.0, "peak_mb": peak}

    monkeypatch.setattr(ingest, "_polars", timed)
    monkeypatch.setattr(ingest, "_end_to_end", end_to_end)
    path = tmp_path / "day.csv"
    path.write_bytes(b"x" * 1000)
    found = ingest._measured(None, "day", path, 10)  # type: ignore[arg-type]  # nothing of it is used here
    assert asked == [1, 2, "ours"] * 3
    assert found["polars_s"] == {"1": 6.0, "2": 4.5}
    assert found["polars_runs_s"] == {"1": [5.0, 7.0, 6.0], "2": [9.0, 4.0, 4.5]}
    assert (found["whole_s"], found["runs_whole_s"]) == (16.0, [12.0, 30.0, 16.0])
    assert found["share_of_polars_2"] == 4.5 / 16.0
    assert found["peak_mb"] == 700.0  # the greatest of all runs, not the median run's


def test_each_section_can_be_asked_for() -> None:
    assert [section.value for section in Section] == list(SECTIONS)


def bench_in(folder: Path) -> Bench:
    return Bench(QUICK, postgres="", redis="", folder=folder, recordings=None, tell=lambda text: None)


def test_files_of_a_loop_are_timed_beside_polars(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(files, "FILES", 2)
    found = files.run(bench_in(tmp_path))
    assert [it["file"] for it in found["kinds"]] == ["a column a signal", "a row a value", "date and clock apart"]
    assert all(0.0 < it["opened_ms"] < it["read_ms"] and it["polars_ms"] > 0.0 for it in found["kinds"])
    page = performance_page({"sections": {"files": found | {"machine": describe()}}})
    assert "2 files of each kind" in page
    assert page.count("| a row a value |") == 1


def test_a_file_that_is_not_read_whole_gets_no_figure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(files, "FILES", 1)
    monkeypatch.setattr(files, "_wide", lambda loop: files._long(loop).head(100))
    with pytest.raises(SkippedError, match=r"was not read whole: \d+ samples"):
        files.run(bench_in(tmp_path))


def test_the_page_can_be_written_from_the_figures_that_are_kept() -> None:
    figures = read(FIGURES)
    figures["sections"]["plant"]["storage"] |= {"series": 6223.0, "verdict_details": 8018.0, "verdicts": 2669.0}
    page = performance_page(figures)
    assert "## Reading a day of" in page
    assert "rounds of one run each" in page
    assert "in this order" in page
    assert "1.7 GB a night (0.6 of `series`, 0.8 of `verdict_details`, 0.3 of `verdicts`)" in page
    assert "249 GB of `series` (400 days), 72 GB of `verdict_details` (90 days)" in page


def test_the_page_counts_workers_as_one_says_it_and_tells_which_loop_grows() -> None:
    figures = read(FIGURES)
    figures["sections"]["plant"]["whole"]["ms_a_loop"] = 14.1
    page = performance_page(figures)
    assert "one worker does it within 6 hours" in page
    grows = demo.plant()[21]  # the last of the 22 that `audit._longest` draws
    assert (grows.type, grows.truth) == ("pressure", "sticky valve, S 2 J 0.5")
    assert "a pressure loop of the simulated plant whose valve sticks (S 2 %, J 0.5 %)" in page
    figures["sections"]["plant"]["whole"]["ms_a_loop"] = 600.0
    assert "3 workers do it within 6 hours" in performance_page(figures)


def test_the_page_tells_audits_beside_what_the_machine_did_meanwhile() -> None:
    figures = read(FIGURES)
    told = {"ms_max": 60.0, "ms_max_least": 55.55, "ms_mean": 30.0, "yardstick_ms": 40.0}
    figures["sections"]["audit"]["longer"] |= told
    page = performance_page(figures)
    assert "In its fastest run, no simulated loop of 2,000 samples took more than 55.55 ms." in page
    assert "took 40 ms (median): the most expensive audit cost 1.5 times that, the mean audit 0.75 times" in page
    assert "holds only on a faster machine" in page
    del figures["sections"]["audit"]["longer"]["yardstick_ms"]
    assert "a million additions" not in performance_page(figures)
    assert yardstick_s() > 0.0


def test_recordings_of_a_folder_are_audited_beside_simulated_loops(tmp_path: Path) -> None:
    row = "2024-03-01T{:02d}:{:02d}:00Z,{},{}\n"
    for name, samples in (("long", 300), ("short", 90)):
        rows = (row.format(k // 60, k % 60, 50.0 + k % 7, 40.0 + k % 5) for k in range(samples))
        (tmp_path / f"{name}.csv").write_text("time,PV,OP\n" + "".join(rows))
    (tmp_path / "labels.csv").write_text("recording,label\nlong,stiction\n")
    found = audit._recorded(tmp_path, 200)
    assert {name: one.samples for name, one in found.items()} == {"long": 200, "short": 90}
    figures = read(FIGURES)
    recorded = audit._spread(found, 200)
    assert (recorded["loops"], recorded["samples"]) == (2, 200)
    figures["sections"]["audit"]["recorded"] = recorded | {"ms_max": 61.0}
    page = performance_page(figures)
    assert "| at most 200, recorded in plants | 2 |" in page
    assert "| the same, the most expensive recording, ms | at most 60 | 61 | **missed** |" in page
    del figures["sections"]["audit"]["recorded"]
    assert "recorded in plants" not in performance_page(figures)


def test_of_a_folder_what_holds_no_recording_of_one_loop_is_left_out(tmp_path: Path) -> None:
    assert audit._recorded(tmp_path, 200) == {}
    assert audit._recorded(tmp_path / "nowhere", 200) == {}
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "gone.csv").symlink_to(tmp_path / "nowhere.csv")
    (tmp_path / "empty.csv").write_bytes(b"")
    (tmp_path / "zeros.csv").write_bytes(bytes(3000))
    rows = (f"2024-03-01T00:{k:02d}:00Z,{k % 7},{k % 5},{k % 6},{k % 9}\n" for k in range(60))
    (tmp_path / "two.csv").write_text("time,A.PV,A.OP,B.PV,B.OP\n" + "".join(rows))
    assert audit._recorded(tmp_path, 200) == {}


def test_of_the_kernel_the_version_is_told_and_not_whose_build_it_is(monkeypatch) -> None:
    monkeypatch.setattr("platform.release", lambda: "6.1.0-own-build-7")
    assert describe()["system"].endswith(" 6.1.0")


def test_the_page_says_which_sections_another_machine_measured() -> None:
    figures = read(FIGURES)
    one = figures["sections"]["audit"]["machine"] | {"processor": "One"}
    for found in figures["sections"].values():
        found["machine"] = one | {"date": found["machine"]["date"]}
    assert "**Except" not in performance_page(figures)
    figures["sections"]["audit"]["machine"] |= {"processor": "Other", "date": "9999-01-01 00:00 UTC"}
    page = performance_page(figures)
    machines = page[page.index("## The machine") : page.index("## Targets")]
    assert (
        machines.index("Other") < machines.index("Except api, files, ingest, plant, search**") < machines.index("One")
    )
