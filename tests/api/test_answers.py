"""What the API answers has the fields of what the services give: one that only one of the two has is lost in silence,
or answered as what it is by default.
"""

from dataclasses import fields, is_dataclass

import pytest

from app.api import models
from app.services import results

NAMED_OTHERWISE = {"Ready": "Readiness", "TrailRow": "Trail"}
OF_A_ROW = {"Health"}
"""Whose fields are those of the stored row itself."""

GIVEN = {name.removesuffix("View"): kind for name, kind in vars(results).items() if is_dataclass(kind)}
ANSWERED = {name.removesuffix("Out"): model for name, model in vars(models).items() if name.endswith("Out")}


@pytest.mark.parametrize("name", sorted(set(ANSWERED) - OF_A_ROW))
def test_an_answer_has_the_fields_of_what_it_is_made_from(name):
    given = GIVEN[NAMED_OTHERWISE.get(name, name)]
    assert set(ANSWERED[name].model_fields) == {field.name for field in fields(given)}
