"""What is said of a loop that a neighbour's valve may shake."""

from dataclasses import replace

from app.engine.plant_wide import Suspect
from app.services.auditing.hearing import neighbour_text


def test_a_source_that_swung_sooner_is_not_called_likelier() -> None:
    shaken = Suspect("TIC201", 0.95, 1.4, 9000.0, 0.91, -3.0)
    source = Suspect("FIC101", 0.85, 1.7, None, 1.0, 0.0)
    assert "is likelier to stick (0.98 against 0.95)" in neighbour_text(
        shaken, replace(source, stiction_probability=0.98), 0.95
    )
    assert "whose swing began sooner (0.85 against 0.95)" in neighbour_text(shaken, source, 0.95)
