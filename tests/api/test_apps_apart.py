"""Applications of one process have their routes in common, and nothing else."""

from app.errors import RequestError
from app.http.parameters import only_known
from app.main import create_app


def refused() -> None:
    raise RequestError("unknown_sort", "not here")


def test_what_one_is_given_does_not_reach_another(open_plant, serve):
    one, other = (create_app(open_plant(require_keys=required).settings) for required in (False, True))
    with serve(one) as client, serve(other) as closed:
        assert client.get("/v1/loops").json()["rows"] == []
        assert closed.get("/v1/loops").status_code == 401
        one.dependency_overrides[only_known] = refused
        assert client.get("/v1/loops").json()["code"] == "unknown_sort"
        with serve(create_app(open_plant().settings)) as third:
            assert third.get("/v1/loops").json()["rows"] == []
    assert one.openapi() == other.openapi()
