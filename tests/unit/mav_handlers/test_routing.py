# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames go: the table of destinations row by row, the route table, heartbeats, private and radio links."""

from collections.abc import Collection

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.routing import MAX_ROUTES, Route, RouteTable, Routing
from mav_handlers.wire.codec import Header
from mav_handlers.wire.messages import HEARTBEAT

OWN = 7
AUTOPILOT = 1
GCS = (255, 190)
CAMERA = (OWN, 100)
GIMBAL = (OWN, 154)
OTHER_VEHICLE = (9, 1)
LINKS = (0, 1, 2, 3)
LOCAL_ONLY = Routing(True)
NOWHERE = Routing(False)


class Network:
    """An autopilot with system id 7, four open links, and what has been heard on them."""

    def __init__(self, *, private: Collection[int] = (), silent: Collection[int] = (), links: tuple[int, ...] = LINKS):
        self.table = RouteTable()
        self.private, self.silent, self.links = private, silent, links

    def hear(self, sender: tuple[int, int], link: int, name: str = "ATTITUDE") -> None:
        """Learn from a frame."""
        self.table.learn(header(sender, name), None, link, own_system=OWN)

    def route(
        self, sender: tuple[int, int], link: int, target: tuple[int | None, int | None], name: str = "COMMAND_LONG"
    ) -> Routing:
        """Decide about a frame, having learned from it."""
        self.hear(sender, link, name)
        return self.table.decide(
            header(sender, name),
            *target,
            link,
            own_system=OWN,
            is_private=lambda number: number in self.private,
            is_active=lambda number: number not in self.silent,
            channels=self.links,
        )


def header(sender: tuple[int, int], name: str = "ATTITUDE") -> Header:
    return Header(name, 0, *sender, 0, 2, b"")


def heartbeat(vehicle_type: int) -> HEARTBEAT:
    return HEARTBEAT(vehicle_type, 8, 0, 0, 4, 3)


@pytest.fixture
def network() -> Network:
    """Return four links: a ground station on 0, a camera on 1, another vehicle on 2, a gimbal on 3."""
    network = Network()
    for link, sender in enumerate((GCS, CAMERA, OTHER_VEHICLE, GIMBAL)):
        network.hear(sender, link)
    return network


# Rows 1 and 2: own frames, and what is learned


def test_own_frame_that_comes_back_is_dropped(network: Network) -> None:
    assert network.route((OWN, AUTOPILOT), 0, (None, None)) == NOWHERE


def test_nothing_is_learned_from_own_frames(network: Network) -> None:
    before = network.table.routes
    network.hear((OWN, AUTOPILOT), 0)
    assert network.table.routes == before


def test_nothing_is_learned_from_own_system_with_component_0(network: Network) -> None:
    before = network.table.routes
    network.hear((OWN, 0), 0)
    assert network.table.routes == before


def test_nothing_is_learned_from_system_0(network: Network) -> None:
    before = network.table.routes
    network.hear((0, 42), 0)
    assert network.table.routes == before


def test_component_0_of_another_system_is_learned() -> None:
    network = Network()
    network.hear((9, 0), 2)
    assert network.table.routes == (Route(9, 0, 2, 0),)


def test_sender_is_learned_once_for_each_link() -> None:
    network = Network()
    for link in (0, 1, 0, 1):
        network.hear(GCS, link)
    assert network.table.routes == (Route(*GCS, 0, 0), Route(*GCS, 1, 0))


def test_twenty_routes_are_remembered_and_no_more() -> None:
    network = Network()
    for system in range(100, 100 + MAX_ROUTES + 5):
        network.hear((system, 1), 1)
    assert [route.system_id for route in network.table.routes] == list(range(100, 120))


def test_sender_beyond_the_table_gets_nothing() -> None:
    network = Network()
    for system in range(100, 100 + MAX_ROUTES):
        network.hear((system, 1), 1)
    network.hear(GCS, 2)
    assert network.route((100, 1), 1, GCS) == NOWHERE


def test_full_table_still_learns_vehicle_types() -> None:
    table = RouteTable()
    for system in range(100, 100 + MAX_ROUTES):
        table.learn(header((system, 1)), None, 1, own_system=OWN)
    table.learn(header((119, 1), "HEARTBEAT"), heartbeat(26), 1, own_system=OWN)
    assert table.routes[-1].vehicle_type == 26


def test_vehicle_type_comes_from_the_first_heartbeat() -> None:
    table = RouteTable()
    for message in (None, heartbeat(26), None, heartbeat(2)):
        table.learn(header(GIMBAL), message, 3, own_system=OWN)
    assert table.routes == (Route(*GIMBAL, 3, 26),)


@pytest.mark.parametrize("name", ["RADIO", "RADIO_STATUS"])
def test_radio_report_is_processed_and_not_forwarded(network: Network, name: str) -> None:
    assert network.route((51, 68), 0, (None, None), name) == LOCAL_ONLY


def test_radio_itself_is_learned_and_its_link_gets_broadcasts() -> None:
    network = Network(silent=(2,))
    network.hear((51, 68), 2, "RADIO_STATUS")
    assert network.route(CAMERA, 1, (None, None)) == Routing(True, (2,))


# Row 3: heartbeats


def test_heartbeat_goes_to_every_other_active_link(network: Network) -> None:
    assert network.route(GCS, 0, (None, None), "HEARTBEAT") == Routing(True, (1, 2, 3))


def test_heartbeat_does_not_go_to_a_link_where_its_sender_is_known(network: Network) -> None:
    network.hear(GCS, 2)
    assert network.route(GCS, 0, (None, None), "HEARTBEAT") == Routing(True, (1, 3))


def test_heartbeat_does_not_go_to_silent_or_private_links() -> None:
    network = Network(silent=(1,), private=(2,))
    assert network.route(GCS, 0, (None, None), "HEARTBEAT") == Routing(True, (3,))


def test_heartbeat_from_a_private_link_stays_there() -> None:
    network = Network(private=(0,))
    assert network.route(GCS, 0, (None, None), "HEARTBEAT") == LOCAL_ONLY


def test_heartbeat_of_a_sender_that_did_not_fit_the_table_does_not_come_back() -> None:
    network = Network()
    for system in range(100, 100 + MAX_ROUTES):
        network.hear((system, 1), 1)
    assert network.route(GCS, 0, (None, None), "HEARTBEAT") == Routing(True, (1, 2, 3))


# Row 4: the table of destinations


def test_without_target_fields_is_processed_and_goes_to_every_other_learned_link(network: Network) -> None:
    assert network.route(CAMERA, 1, (None, None), "VISION_POSITION_ESTIMATE") == Routing(True, (0, 2, 3))


@pytest.mark.parametrize("component", [0, 1, 42, None])
def test_target_system_0_is_processed_and_goes_to_every_other_learned_link(
    network: Network, component: int | None
) -> None:
    assert network.route(GCS, 0, (0, component)) == Routing(True, (1, 2, 3))


def test_broadcast_does_not_go_to_a_link_where_nobody_was_heard() -> None:
    network = Network()
    network.hear(CAMERA, 1)
    assert network.route(GCS, 0, (None, None)) == Routing(True, (1,))


def test_own_system_and_component_1_is_processed_and_not_forwarded(network: Network) -> None:
    assert network.route(GCS, 0, (OWN, AUTOPILOT)) == LOCAL_ONLY


@pytest.mark.parametrize("component", [0, None])
def test_own_system_without_component_is_processed_and_goes_to_others_of_own_system(
    network: Network, component: int | None
) -> None:
    assert network.route(GCS, 0, (OWN, component)) == Routing(True, (1, 3))


def test_own_system_and_component_known_on_another_link_is_forwarded_only(network: Network) -> None:
    assert network.route(GCS, 0, GIMBAL) == Routing(False, (3,))


def test_own_system_and_unknown_component_is_processed(network: Network) -> None:
    assert network.route(GCS, 0, (OWN, 42)) == LOCAL_ONLY


def test_own_system_and_component_known_only_on_the_same_link_is_processed(network: Network) -> None:
    network.hear((OWN, 42), 0)
    assert network.route(GCS, 0, (OWN, 42)) == LOCAL_ONLY


def test_other_system_is_forwarded_only_to_links_where_it_is_known(network: Network) -> None:
    network.hear(OTHER_VEHICLE, 3)
    assert network.route(GCS, 0, OTHER_VEHICLE) == Routing(False, (2, 3))


def test_other_system_is_known_by_any_of_its_components(network: Network) -> None:
    assert network.route(GCS, 0, (OTHER_VEHICLE[0], 42)) == Routing(False, (2,))


def test_unknown_system_is_neither_processed_nor_forwarded(network: Network) -> None:
    assert network.route(GCS, 0, (99, 1)) == NOWHERE


def test_system_known_only_on_the_same_link_gets_nothing(network: Network) -> None:
    assert network.route(OTHER_VEHICLE, 2, (OTHER_VEHICLE[0], 42)) == NOWHERE


def test_link_with_two_receivers_gets_a_frame_once(network: Network) -> None:
    network.hear((OWN, 101), 1)
    assert network.route(GCS, 0, (OWN, 0)) == Routing(True, (1, 3))


def test_link_that_is_closed_gets_nothing(network: Network) -> None:
    network.links = (0, 1, 3)
    assert network.route(GCS, 0, (None, None)) == Routing(True, (1, 3))


def test_component_known_only_on_a_closed_link_counts_as_unknown(network: Network) -> None:
    network.links = (0, 1, 2)
    assert network.route(GCS, 0, GIMBAL) == LOCAL_ONLY


# Private links


def test_broadcast_does_not_go_to_a_private_link(network: Network) -> None:
    network.private = (2,)
    assert network.route(GCS, 0, (None, None)) == Routing(True, (1, 3))


def test_private_link_gets_what_names_its_component_exactly(network: Network) -> None:
    network.private = (3,)
    assert network.route(GCS, 0, GIMBAL) == Routing(False, (3,))


def test_private_link_does_not_get_what_names_another_component_of_its_system(network: Network) -> None:
    network.private = (2,)
    assert network.route(GCS, 0, (OTHER_VEHICLE[0], 42)) == NOWHERE


def test_broadcast_from_a_private_link_is_processed_and_not_forwarded(network: Network) -> None:
    network.private = (1,)
    assert network.route(CAMERA, 1, (None, None)) == LOCAL_ONLY


def test_private_link_cannot_reach_an_unknown_component_by_the_autopilot(network: Network) -> None:
    network.private = (1,)
    assert network.route(CAMERA, 1, (OWN, 42)) == NOWHERE


# Keys


@pytest.mark.parametrize(("target", "local"), [((0, 0), True), ((OWN, 0), True), (OTHER_VEHICLE, False)])
def test_signing_key_is_never_forwarded(network: Network, target: tuple[int, int], local: bool) -> None:
    assert network.route(GCS, 0, target, "SETUP_SIGNING") == Routing(local)


def test_signing_key_for_a_known_component_is_not_taken_by_the_autopilot(network: Network) -> None:
    assert network.route(GCS, 0, GIMBAL, "SETUP_SIGNING") == NOWHERE


# Any traffic

ids = st.sampled_from((0, 1, OWN, 9, 100, 255)) | st.integers(0, 255)
frames = st.tuples(
    st.tuples(ids, ids),
    st.sampled_from(LINKS),
    st.sampled_from((None, 0, OWN, 9)) | ids,
    st.none() | ids,
    st.sampled_from(("COMMAND_LONG", "HEARTBEAT", "RADIO_STATUS", "SETUP_SIGNING")),
)
links = st.sets(st.sampled_from(LINKS))


@given(st.lists(frames, min_size=1, max_size=40), links, links)
def test_no_frame_goes_back_or_twice_or_uninvited(
    traffic: list[tuple[tuple[int, int], int, int | None, int | None, str]], private: set[int], silent: set[int]
) -> None:
    network = Network(private=private, silent=silent)
    for sender, link, *target, name in traffic:
        routing = network.route(sender, link, (target[0], target[1]), name)
        assert link not in routing.forward_to
        assert len(set(routing.forward_to)) == len(routing.forward_to)
        assert link not in private or not routing.forward_to
        if name == "HEARTBEAT":
            assert not {*routing.forward_to} & (private | silent)
        for goal in routing.forward_to:
            heard = {(r.system_id, r.component_id) for r in network.table.routes if r.channel == goal}
            assert goal not in private or tuple(target) in heard
        assert len(network.table.routes) <= MAX_ROUTES


@given(frames, links)
def test_what_names_the_autopilot_is_always_processed(
    frame: tuple[tuple[int, int], int, int | None, int | None, str], private: set[int]
) -> None:
    sender, link, *_ = frame
    routing = Network(private=private).route(sender, link, (OWN, AUTOPILOT))
    assert routing == Routing(sender != (OWN, AUTOPILOT))
