"""Settings that cannot work are refused at the start, in words."""

import pytest
from pydantic import ValidationError

from app.settings import Settings


@pytest.mark.parametrize("address", ["garbage", "http://redis:6379", "redis.example:6379/0"])
def test_a_broker_that_celery_would_take_for_something_else_is_refused(address: str) -> None:
    with pytest.raises(ValidationError, match="must begin with redis://"):
        Settings(broker_url=address)


def test_a_broker_that_is_refused_is_not_told_with_its_password() -> None:
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url="redi://:hunter2@host/0")
    told = [error["msg"] for error in raised.value.errors(include_input=False)]
    assert "'redi'" in told[0]
    assert "hunter2" not in told[0]


@pytest.mark.parametrize("address", ["", "redis://127.0.0.1:6379/3", "rediss://host/0"])
def test_known_brokers_are_taken(address: str) -> None:
    assert Settings(broker_url=address).broker_url == address


@pytest.mark.parametrize("name", ["localtime", "Nowhere/City", "", "UTC+8", "../UTC"])
def test_a_zone_is_one_that_browsers_know_too(name):
    with pytest.raises(ValueError, match="is no time zone"):
        Settings(time_zone=name)
