import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import OptionError
from meshtide_server.security.token_bucket import TokenBucket


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_burst_passes_and_then_the_rate_holds() -> None:
    clock = Clock()
    bucket = TokenBucket(2.0, 4.0, clock)
    assert [bucket.try_take(1.0) for _ in range(5)] == [0.0, 0.0, 0.0, 0.0, 0.5]
    clock.now += 0.25
    assert bucket.try_take(1.0) == 0.25
    clock.now += 0.25
    assert bucket.try_take(1.0) == 0.0
    assert not bucket.full
    clock.now += 60.0
    assert bucket.full
    assert bucket.try_take(4.0) == 0.0


def test_what_happens_anyway_leaves_a_debt() -> None:
    clock = Clock()
    bucket = TokenBucket(100.0, 50.0, clock)
    assert bucket.take(50.0) == 0.0
    assert bucket.take(200.0) == 2.0
    assert bucket.take(100.0) == 3.0
    clock.now += 3.0
    assert bucket.take(0.0) == 0.0


def test_a_clock_that_goes_back_gives_nothing() -> None:
    clock = Clock()
    bucket = TokenBucket(1.0, 1.0, clock)
    bucket.try_take(1.0)
    clock.now -= 50.0
    assert bucket.try_take(1.0) == 1.0


@pytest.mark.parametrize(("rate", "capacity"), [(0.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (float("nan"), 1.0)])
def test_buckets_that_make_no_sense_are_refused(rate: float, capacity: float) -> None:
    with pytest.raises(OptionError, match="must be positive"):
        TokenBucket(rate, capacity, Clock())


def test_more_than_it_holds_can_never_be_had() -> None:
    with pytest.raises(OptionError, match="more than the bucket's 3"):
        TokenBucket(1.0, 3.0, Clock()).try_take(4.0)


@given(st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 8.0)), max_size=50))
def test_no_more_passes_than_the_capacity_and_the_rate_allow(requests: list[tuple[float, float]]) -> None:
    clock = Clock()
    bucket = TokenBucket(2.0, 8.0, clock)
    taken = 0.0
    for pause, amount in requests:
        clock.now += pause
        if bucket.try_take(amount) == 0.0:
            taken += amount
        assert taken <= 8.0 + 2.0 * (clock.now - 100.0) + 1e-9


@given(st.lists(st.floats(1.0, 1000.0), min_size=1, max_size=30))
def test_who_waits_as_told_keeps_the_rate(sizes: list[float]) -> None:
    clock = Clock()
    bucket = TokenBucket(10.0, 20.0, clock)
    for size in sizes:
        clock.now += bucket.take(size)
    assert sum(sizes) <= 20.0 + 10.0 * (clock.now - 100.0) + 1e-6
