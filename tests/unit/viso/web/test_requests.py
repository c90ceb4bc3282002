# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages ask for is done by the vehicle's own handlers; what makes no sense is answered, and harms nobody."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ap_core.verdict import Verdict
from mav_handlers.verdicts import PARAM_NOT_FINITE, PARAM_UNKNOWN
from mav_handlers.wire.messages import HEARTBEAT, PARAM_VALUE
from tests.unit.viso.conftest import Bench
from viso.web.faults import FaultSwitches
from viso.web.requests import ACTIONS, REQUESTS_WAITING, Answer, RequestQueue


def ask(bench: Bench, requests: RequestQueue | None = None, **request: Any) -> Answer:
    """Ask for something, have it done, and return the answer."""
    requests = requests or RequestQueue(FaultSwitches([]))
    at_once = requests.ask(3, json.dumps({"id": 7, **request}))
    if at_once is not None:
        return at_once
    (answer,) = requests.run(bench.vehicle)
    assert (answer.client, answer.request) == (3, 7)
    return answer


def test_parameter_is_set_and_told_on_every_link(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(VISO_TYPE=1)
    bench.send(HEARTBEAT(6, 8, 0, 0, 4, 3))
    bench.run_for(0.1)
    bench.received()
    answer = ask(bench, do="param", name="VISO_DELAY_MS", value=80)
    assert (answer.ok, answer.text) == (True, "VISO_DELAY_MS is 80.0")
    assert bench.vehicle.params.get_int("VISO_DELAY_MS") == 80
    bench.run_for(0.01)
    echoes = [message for message in bench.received() if isinstance(message, PARAM_VALUE)]
    assert [(echo.param_id, echo.param_value) for echo in echoes] == [("VISO_DELAY_MS", 80.0)]


@pytest.mark.parametrize(
    ("name", "value", "verdict"), [("NO_SUCH", 1, PARAM_UNKNOWN), ("VISO_SCALE", 1e300, PARAM_NOT_FINITE)]
)
def test_parameter_that_cannot_be_set_is_told_as_the_firmware_sees_it(
    make_bench: Callable[..., Bench], name: str, value: float, verdict: Verdict
) -> None:
    answer = ask(make_bench(), do="param", name=name, value=value)
    assert (answer.ok, answer.text) == (False, verdict.rule.text)


def test_arming_that_is_refused_says_so_and_why_in_the_texts(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(VISO_TYPE=1)
    answer = ask(bench, do="action", name="arm")
    assert (answer.ok, answer.text) == (False, "Arm: refused; the texts say why")
    assert any(text.startswith("Arm: ") for *_, text in bench.texts)


def test_arming_and_disarming(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(ARMING_CHECK=0)
    assert ask(bench, do="action", name="arm").ok
    assert bench.vehicle.copter.is_armed()
    assert ask(bench, do="action", name="disarm").ok
    assert not bench.vehicle.copter.is_armed()


@pytest.mark.parametrize("number", [1, 2, 3])
def test_source_set_is_chosen(make_bench: Callable[..., Bench], number: int) -> None:
    bench = make_bench()
    assert ask(bench, do="action", name=f"source{number}").ok
    assert bench.vehicle.sources.active_set == number - 1


def test_alignment_is_asked_of_the_camera(make_bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(boot=False, VISO_TYPE=2)
    asked = []
    monkeypatch.setattr(bench.vehicle.visual_odom, "request_align_yaw_to_ahrs", lambda: asked.append(True))
    assert ask(bench, do="action", name="align").ok
    assert asked == [True]


def test_restart_is_asked_for(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench()
    assert ask(bench, do="action", name="restart").ok
    assert bench.vehicle.reboot_requested


def test_command_is_logged_as_a_ground_stations(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench()
    ask(bench, do="action", name="check")
    (record,) = bench.written("MAVC")
    assert (record["SS"], record["SC"], record["Cmd"]) == (255, 190, 401)


def test_answers_go_to_the_page_alone(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench()
    bench.received()
    for action in ACTIONS:
        ask(bench, do="action", name=action.name)
    assert bench.vehicle.endpoint.bytes_to_send(bench.channel) == b""


def test_keys_and_names_of_actions_are_unique() -> None:
    assert len({action.name for action in ACTIONS}) == len(ACTIONS)
    keys = [action.key for action in ACTIONS if action.key]
    assert len(set(keys)) == len(keys)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)
FIELD = st.sampled_from(["do", "name", "id", "value", "on"])
WORDS = st.sampled_from(["param", "action", "fault", "arm", "VISO_TYPE", "frozen", True, False])


@pytest.mark.slow
@given(st.text() | JSON.map(json.dumps) | st.dictionaries(FIELD, JSON | WORDS).map(json.dumps))
@example("[" * 1900)
@example('{"do":"param","name":"VISO_TYPE","value":1e999}')
@example('{"do":"param","name":"VISO_TYPE","value":' + "9" * 400 + "}")
@example('{"do":"param","name":"' + "x" * 17 + '","value":1}')
@example('{"id":' + "9" * 1900 + "}")
@example("9" * 1900 + "9" * 50_000)
@example('{"do":["param"],"name":{},"id":true}')
def test_nothing_that_comes_over_the_socket_raises(text: str) -> None:
    answer = RequestQueue(FaultSwitches([])).ask(1, text)
    assert answer is None or (not answer.ok and answer.text and "\n" not in answer.text)


def test_no_name_and_no_number_harms_the_vehicle(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench()

    @given(st.text(min_size=1, max_size=16).filter(str.isprintable), st.floats(allow_nan=False, allow_infinity=False))
    def check(name: str, value: float) -> None:
        assert ask(bench, do="param", name=name, value=value).text

    check()


def test_request_of_no_use_is_answered_under_its_number() -> None:
    answer = RequestQueue(FaultSwitches([])).ask(1, '{"do":"fly","name":"away","id":12}')
    assert answer == Answer(1, 12, False, "nothing that can be done here")


def test_no_page_can_ask_for_more_than_is_done(make_bench: Callable[..., Bench]) -> None:
    requests = RequestQueue(FaultSwitches([]))
    request = '{"do":"action","name":"source1","id":1}'
    answers = [requests.ask(1, request) for _ in range(REQUESTS_WAITING + 1)]
    assert [answer for answer in answers if answer] == [Answer(1, 1, False, "too much at once")]
    assert len(list(requests.run(make_bench().vehicle))) == REQUESTS_WAITING


def test_unknown_fault_is_told(make_bench: Callable[..., Bench]) -> None:
    answer = ask(make_bench(), do="fault", name="gremlins", on=True)
    assert (answer.ok, answer.text) == (False, "no such fault")
