from __future__ import annotations

from ipaddress import ip_network
from typing import Any

import pytest

from meshtide_server.security.client_limits import Client, ClientLimits


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def limits(clock: Clock | None = None, **settings: Any) -> ClientLimits:
    defaults: dict[str, Any] = {"connections": 2, "bytes_per_second": 1000, "writes_per_minute": 3, "unlimited": ()}
    return ClientLimits(**(defaults | settings), clock=clock or Clock())


def known(made: ClientLimits, address: str) -> Client:
    client = made.client(address)
    assert client is not None
    return client


def test_connections_are_counted_by_address() -> None:
    made = limits()
    first, other = known(made, "192.0.2.1"), known(made, "192.0.2.2")
    assert [made.enter(first) for _ in range(3)] == [True, True, False]
    assert made.enter(other)
    made.leave(first)
    assert made.enter(known(made, "192.0.2.1"))


@pytest.mark.parametrize(
    ("one", "another", "same"),
    [
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8:0:1::1", "2001:db8:0:2::1", False),
        ("192.0.2.1", "::ffff:192.0.2.1", True),
        ("fe80::1%eth0", "fe80::2%eth1", True),
        ("no address", "", True),
    ],
)
def test_who_counts_as_one_client(one: str, another: str, same: bool) -> None:
    made = limits()
    assert (known(made, one) is known(made, another)) is same


def test_writes_are_counted_and_come_back() -> None:
    clock = Clock()
    made = limits(clock)
    client = known(made, "192.0.2.1")
    assert [made.write(client) for _ in range(4)] == [0, 0, 0, 20]
    clock.now += 20.0
    assert made.write(client) == 0


def test_bytes_are_shared_by_all_connections_of_a_client() -> None:
    made = limits()
    client = known(made, "192.0.2.1")
    assert made.send(client, 1000) == 0.0
    assert made.send(client, 500) == 0.5
    assert made.send(known(made, "192.0.2.1"), 500) == 1.0
    assert made.send(known(made, "192.0.2.2"), 1000) == 0.0


def test_zero_means_no_limit() -> None:
    made = limits(connections=0, bytes_per_second=0, writes_per_minute=0)
    client = known(made, "192.0.2.1")
    assert all(made.enter(client) and made.write(client) == 0 and made.send(client, 10**9) == 0.0 for _ in range(1000))


def test_some_networks_are_spared() -> None:
    made = limits(unlimited=(ip_network("10.0.0.0/8"), ip_network("::1/128")))
    assert made.client("10.1.2.3") is None
    assert made.client("::ffff:10.1.2.3") is None
    assert made.client("::1") is None
    assert made.client("11.0.0.1") is not None
    assert made.client("::2") is not None


def test_idle_clients_are_forgotten_and_busy_ones_are_not() -> None:
    clock = Clock()
    made = limits(clock)
    idle, writer = known(made, "192.0.2.1"), known(made, "192.0.2.2")
    for client in (idle, writer):
        made.enter(client)
    made.write(writer)
    for client in (idle, writer):
        made.leave(client)
    assert len(made) == 1
    assert known(made, "192.0.2.2") is writer
    clock.now += 60.0
    for number in range(1, 1100):
        made.enter(known(made, f"198.51.{number // 256}.{number % 256}"))
    assert known(made, "192.0.2.2") is not writer


def test_a_full_table_treats_newcomers_as_one() -> None:
    made = limits(most=3)
    clients = [known(made, f"192.0.2.{number}") for number in range(3)]
    for client in clients:
        made.enter(client)
    fourth = known(made, "192.0.2.3")
    made.enter(fourth)
    assert known(made, "192.0.2.4") is fourth
    assert len(made) == 4
    assert known(made, "192.0.2.1") is clients[1]
