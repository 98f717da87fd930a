"""Settings that cannot work are refused at the start, in words."""

import pytest
from pydantic import ValidationError

from app.settings import Settings


@pytest.mark.parametrize("address", ["garbage", "http://redis:6379", "redis.example:6379/0"])
def test_a_broker_that_celery_would_take_for_something_else_is_refused(address: str) -> None:
    with pytest.raises(ValidationError, match="must begin with redis://"):
        Settings(broker_url=address)


@pytest.mark.parametrize("address", ["", "redis://127.0.0.1:6379/3", "rediss://host/0"])
def test_known_brokers_are_taken(address: str) -> None:
    assert Settings(broker_url=address).broker_url == address
