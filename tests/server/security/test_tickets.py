import base64

from hypothesis import given
from hypothesis import strategies as st

from meshtide_server.security.tickets import TicketOffice

READ_TOKENS = ("token-of-a-reader-1", "token-of-a-reader-2")


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def office(clock: Clock, tokens: tuple[str, ...] = READ_TOKENS, **settings: int) -> TicketOffice:
    return TicketOffice(tokens, seconds=30.0, clock=clock, **settings)


def test_a_ticket_is_good_once() -> None:
    made = office(Clock())
    ticket = made.issue()
    assert made.take(ticket)
    assert not made.take(ticket)


def test_a_ticket_expires() -> None:
    clock = Clock()
    made = office(clock)
    early, late = made.issue(), made.issue()
    clock.now += 29.9
    assert made.take(early)
    clock.now += 0.2
    assert not made.take(late)
    assert not made.take(early)


def test_another_process_with_the_same_tokens_takes_it_and_no_other_does() -> None:
    clock = Clock()
    ticket = office(clock).issue()
    assert office(clock, READ_TOKENS[::-1]).take(ticket)
    assert not office(clock, READ_TOKENS[:1]).take(ticket)
    assert not office(clock, ()).take(office(clock, ()).issue())


def test_what_is_remembered_is_bounded_and_forgotten() -> None:
    clock = Clock()
    made = office(clock, most=3)
    assert [made.take(made.issue()) for _ in range(4)] == [True, True, True, False]
    clock.now += 30.0
    assert made.take(made.issue())
    assert repr(made) == "TicketOffice(1 taken)"


def test_a_ticket_of_a_longer_life_is_remembered_for_all_of_it() -> None:
    clock = Clock()
    patient = TicketOffice(READ_TOKENS, seconds=3600.0, clock=clock)
    made = office(clock)
    ticket = patient.issue()
    assert made.take(ticket)
    for _ in range(8):
        clock.now += 450.0
        assert made.take(made.issue())  # which forgets what has expired
        assert not made.take(ticket)


def test_clocks_that_do_not_agree_make_no_ticket_good_twice() -> None:
    ahead, behind = Clock(), Clock()
    ahead.now += 60.0
    made = office(behind)
    ticket = office(ahead).issue()
    assert made.take(ticket)
    behind.now += 89.0  # a life, and the difference of the clocks
    assert made.take(made.issue())
    assert not made.take(ticket)


def test_a_clock_that_goes_back_makes_no_ticket_good_twice() -> None:
    clock = Clock()
    made = office(clock)
    ticket = made.issue()
    assert made.take(ticket)
    clock.now += 31.0
    assert made.take(made.issue())
    clock.now -= 20.0
    assert not made.take(ticket)


def test_a_ticket_that_is_good_for_ever_is_good_for_nothing() -> None:
    clock = Clock()
    assert not office(clock).take(TicketOffice(READ_TOKENS, seconds=1e9, clock=clock).issue())


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 40)), max_size=60))
def test_no_ticket_is_taken_twice_whatever_the_clocks_do(steps: list[tuple[int, int]]) -> None:
    clocks = [Clock() for _ in range(3)]
    offices = [
        TicketOffice(READ_TOKENS, seconds=life, clock=clock) for clock, life in zip(clocks, (5, 30, 900), strict=True)
    ]
    tickets: list[str] = []
    taken: set[str] = set()
    for kind, amount in steps:
        if kind == 0:
            tickets.append(offices[amount % 3].issue())
        elif kind == 1:
            clocks[amount % 3].now += 10 * (amount - 10)
        elif tickets:
            ticket = tickets[amount % len(tickets)]
            if offices[1].take(ticket):
                assert ticket not in taken
                taken.add(ticket)


@given(st.integers(0, 55), st.integers(1, 255))
def test_no_changed_ticket_is_good(position: int, flip: int) -> None:
    made = office(Clock())
    data = bytearray(base64.urlsafe_b64decode(made.issue() + "="))
    data[position] ^= flip
    assert not made.take(base64.urlsafe_b64encode(data).decode().rstrip("="))


@given(st.text(max_size=80) | st.text(st.characters(codec="ascii"), min_size=75, max_size=75))
def test_nothing_else_is_a_ticket(text: str) -> None:
    assert not office(Clock()).take(text)
