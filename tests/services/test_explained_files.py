"""Files as what the engine compares: read once, each with what it is compared with."""

from pathlib import Path

import numpy as np
import pytest

from app.errors import DataError, RequestError
from app.ingest import IngestOptions
from app.services.explaining import comparisons
from app.services.explaining.comparisons import Columns
from app.services.explaining.files import Asked, Compared, explained_files
from app.services.explaining.line import Kind, Second
from tests.engine.wandering import STICKY, TS, recorded

MODEL = '{"gain": 1.2, "time_constants_s": [20]}'


def table(path: Path, samples: int, simulated: bool = False) -> Path:
    loop = recorded(STICKY, samples, seed=2)
    columns = [np.arange(samples) * TS, loop.pv, loop.op, *([loop.pv + 0.1] if simulated else [])]
    header = "time,PV,OP" + (",PV_sim" if simulated else "")
    np.savetxt(path, np.stack(columns, axis=1), fmt="%.5f", delimiter=",", header=header, comments="")
    return path


def explained(file: Path, **told: object) -> Compared:
    known = {"simulated": None, "model": None, "second": None, "judged": False, **told}
    return explained_files(Asked(file, Columns(), second_columns=Columns(), options=IngestOptions(), **known))


def test_the_part_that_an_audit_judges_is_found_without_reading_the_file_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, read = [], comparisons.read_recordings

    def counted(*args: object, **more: object) -> object:
        asked.append(args)
        return read(*args, **more)

    monkeypatch.setattr(comparisons, "read_recordings", counted)
    path = table(tmp_path / "F1.csv", 6500)
    found = explained(path, judged=True)
    assert len(found.first.pv) < 2000
    assert len(asked) == 1
    assert not found.long
    assert explained(path).long


@pytest.mark.parametrize(
    ("simulated", "told", "kind", "second"),
    [
        (False, {}, "identified", "identified"),
        (True, {}, "column", "column"),
        (True, {"simulated": "PV_sim"}, "column", "column"),
        (True, {"model": MODEL}, "model", "model"),
    ],
)
def test_it_is_told_what_each_recording_is_compared_with(
    tmp_path: Path, simulated: bool, told: dict[str, object], kind: Kind, second: Kind
) -> None:
    first, other = (table(tmp_path / f"{name}.csv", 400, simulated) for name in ("F1", "F2"))
    found = explained(first, second=other, **told)
    assert found.kind == kind
    assert found.told_second == Second("F2", second)
    assert (found.first.simulation is not None) is (kind == "model")


def test_a_simulation_in_a_file_is_the_first_recordings_alone(tmp_path: Path) -> None:
    first, second = (table(tmp_path / f"{name}.csv", 400) for name in ("F1", "F2"))
    found = explained(first, second=second, simulated=str(table(tmp_path / "S1.csv", 400, True)))
    assert found.kind == "trace"
    assert found.told_second == Second("F2", "identified")


def test_what_is_wrong_with_the_second_recording_is_told_of_it(tmp_path: Path) -> None:
    first = table(tmp_path / "F1.csv", 400)
    with pytest.raises(DataError, match=r"in the second recording, .*F2.csv: "):
        explained(first, second=table(tmp_path / "F2.csv", 20))


def test_a_part_of_a_record_has_no_simulation(tmp_path: Path) -> None:
    with pytest.raises(RequestError) as refused:
        explained(table(tmp_path / "F1.csv", 400, True), judged=True)
    assert refused.value.code == "judged_alone"
