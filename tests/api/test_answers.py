"""What the API answers is declared once, where the services make it: of two declarations one gets a field that the
other lacks, which is lost in silence, or answered as what it is by default.
"""

from dataclasses import fields, is_dataclass

from app.api import models
from app.api.reference import fields_of
from app.services import outward

OF_A_ROW = {"HealthOut"}
"""Whose fields are those of the stored row itself."""

ANSWERS = {kind for kind in vars(outward).values() if isinstance(kind, type) and kind.__module__ == outward.__name__}


def test_an_answer_is_what_a_service_gives():
    assert {name for name in vars(models) if name.endswith("Out") and vars(models)[name] not in ANSWERS} == OF_A_ROW


def test_every_field_of_an_answer_goes_out():
    assert all(is_dataclass(kind) for kind in ANSWERS)
    assert {kind: {*fields_of(kind)} for kind in ANSWERS} == {kind: {f.name for f in fields(kind)} for kind in ANSWERS}
