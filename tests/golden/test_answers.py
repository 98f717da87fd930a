"""The engine's version, which is stored with each verdict so that it can be made again, changes with its answers."""

import pytest

from app.engine import ENGINE_VERSION
from tests.golden.answers import QUESTIONS, kept, same

MEND = "python -m tests.golden.answers raises it and keeps the new answers"


def test_the_answers_are_kept_of_this_version():
    assert kept()["engine_version"] == ENGINE_VERSION, MEND
    assert kept()["answers"].keys() == QUESTIONS.keys(), MEND


@pytest.mark.parametrize("question", QUESTIONS)
def test_other_answers_have_another_version(question, warm_kernels):
    given, before = QUESTIONS[question](), kept()["answers"][question]
    assert same(given, before), f"engine {ENGINE_VERSION} said {before}, and now {given}: {MEND}"
