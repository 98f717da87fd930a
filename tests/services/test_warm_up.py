"""A worker's first loops must not pay, out of their time limit, for what could be compiled before."""

import pytest

from app.services.auditing import chunks


def test_the_warm_up_goes_the_longest_way_through_the_engine(
    monkeypatch: pytest.MonkeyPatch, warm_kernels: None
) -> None:
    """Both searches of the reference, its widening and the size of stiction: each has kernels of its own."""
    audit, found = chunks.audit, []
    monkeypatch.setattr(chunks, "audit", lambda recording: found.append(audit(recording)))
    chunks.warm_up()
    assert any(one.reference is not None and one.reference.last.two is not None for one in found)
    assert any(one.stiction_size is not None for one in found)
    assert {one.judgement.verdict for one in found} == {"stiction", "no_stiction"}
