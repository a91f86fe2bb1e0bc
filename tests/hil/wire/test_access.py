"""Who may say and hear what: by the rules, and by a real router with real certificates."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.scenario.schema import Scenario
from hil.wire.access import access_control, access_of
from hil.wire.pubsub import Wire
from hil.wire.role_keys import RoleKeys
from hil.wire.roles import ROLES, ROUTER, Role
from hil.wire.session import Endpoints, NoRouterError, close_session, open_session, reserved_endpoint
from hil.wire.session_config import keys_config
from hil.wire.topics import DIAGNOSTICS, RIGID_BODIES, STOP
from hil.wire.undeclare import undeclare
from tests.tls_labs import PATIENCE, TlsLab, lab_keys, tls_lab

TURTLEBOT3 = with_guards(load_scenario("turtlebot3"))
LAYOUTS = {
    "ros2dds": ("wire.prefix=lab7",),
    "rmw_zenoh": ("wire.layout=rmw_zenoh", "wire.domain=30", "wire.prefix=lab7"),
    "poses": ("source.type=PoseStamped",),
}
CLIENTS = tuple(role for role in ROLES if role != ROUTER)
SILENCE_S = 0.5
"""How long a message that was refused is given to arrive all the same."""


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TlsLab]:
    folder = tmp_path_factory.mktemp("plain") / "keys"
    lab_keys(folder)
    with tls_lab(folder) as lab:
        yield lab


def heard_by(wire: Wire, wanted: set[tuple[str, bytes]]) -> set[tuple[str, bytes]]:
    """What a wire hears until it has heard all that is wanted, and then nothing for a moment."""
    heard: set[tuple[str, bytes]] = set()
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        event = wire.inbox.take(SILENCE_S)
        if event is not None:
            heard.add((event.topic, event.payload))
        elif heard >= wanted:
            break
    return heard


def is_listened_to(publisher: zenoh.Publisher) -> bool:
    # Zenoh's stubs take the status for the answer itself.
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


def all_topics(scenario: Scenario) -> set[str]:
    given = access_of(scenario).values()
    return {topic for each in given for topic in each.says | each.hears}


def speak(wires: dict[Role, Wire], topics: set[str], heard: Wire, expected: set[tuple[str, bytes]]) -> None:
    """Let everybody say everything until what is expected has come once: subscriptions take a moment."""
    deadline = time.monotonic() + PATIENCE
    known: set[tuple[str, bytes]] = set()
    while not known >= expected and time.monotonic() < deadline:
        for role, wire in wires.items():
            for topic in topics:
                wire.publish(topic, role.encode())
        while (event := heard.inbox.take(0.1)) is not None:
            known.add((event.topic, event.payload))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_router_lets_through_what_a_role_may_say_and_nothing_else(layout: str, tmp_path: Path) -> None:
    scenario = lab_keys(tmp_path / "keys", *LAYOUTS[layout])
    given = access_of(scenario)
    expected = {(topic, role.encode()) for role, each in given.items() for topic in each.says}
    with tls_lab(tmp_path / "keys") as lab:
        recorder, robot = lab.wire("recorder", scenario), lab.wire("robot", scenario)
        recorder.subscribe(sorted(all_topics(scenario)), ours=False)
        robot.subscribe(sorted(all_topics(scenario)), ours=False)
        wires = {role: lab.wire(role, scenario, strict=False) for role in CLIENTS}
        speak(wires, all_topics(scenario), recorder, expected)
        for role, wire in wires.items():
            for topic in all_topics(scenario):
                wire.publish(topic, role.encode())
        assert heard_by(recorder, expected) == expected
        to_robot = {each for each in expected if each[0] in given["robot"].hears}
        assert to_robot
        assert heard_by(robot, to_robot) == to_robot


def test_whoever_may_say_something_knows_it_and_is_told_what_it_may_not(plain: TlsLab) -> None:
    given = access_of(TURTLEBOT3)
    for role in CLIENTS:
        wire = plain.wire(role, TURTLEBOT3)
        allowed = {topic for topic in all_topics(TURTLEBOT3) if wire.may_publish(topic)}
        assert allowed == given[role].says
    viewer = plain.wire("viewer", TURTLEBOT3)
    with pytest.raises(UsageError, match=r"follower/cmd_vel: our keys do not let us publish"):
        viewer.publish("follower/cmd_vel", b"drive")


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_a_viewer_reaches_nobody_by_puts_deletes_and_wildcards(plain: TlsLab, mode: str) -> None:
    listening = plain.session("operator")
    heard: list[str] = []
    watched = ("follower/cmd_vel", "follower/cmd_vel_wanted", RIGID_BODIES, "follower/odom", STOP)
    subscribers = [
        listening.declare_subscriber(key, lambda each: heard.append(str(each.key_expr))) for key in watched
    ]
    config = keys_config(RoleKeys(plain.folder, "viewer"), plain.endpoint, None)
    config.insert_json5("mode", json.dumps(mode))
    with zenoh.open(config) as viewer:
        publishers = [viewer.declare_publisher(key) for key in watched]
        for _ in range(3):
            for publisher, key in zip(publishers, watched, strict=True):
                publisher.put(b"bad")
                viewer.put(key, b"bad", congestion_control=zenoh.CongestionControl.BLOCK)
                viewer.delete(key)
            for wild in ("**", "*/cmd_vel", "follower/*", "*", "follower/cmd_vel/**"):
                viewer.put(wild, b"bad")
                viewer.delete(wild)
            time.sleep(SILENCE_S / 3)
        # The only sign of it that Zenoh gives: nobody seems to listen.
        assert not any(map(is_listened_to, publishers))
    # Not because nobody would have heard it.
    guard = plain.wire("guard", TURTLEBOT3)
    deadline = time.monotonic() + PATIENCE
    while not heard and time.monotonic() < deadline:
        guard.publish("follower/cmd_vel", b"good")
        time.sleep(0.02)
    assert set(heard) == {"follower/cmd_vel"}
    undeclare(*subscribers)


def test_a_controllers_wildcard_does_not_reach_further_than_the_controller(plain: TlsLab) -> None:
    recorder = plain.wire("recorder", TURTLEBOT3)
    recorder.subscribe(["follower/cmd_vel", "follower/cmd_vel_wanted", STOP], ours=False)
    controller, allowed = plain.session("controller"), plain.wire("controller", TURTLEBOT3)
    wanted = {("follower/cmd_vel_wanted", b"good")}
    deadline = time.monotonic() + PATIENCE
    while not recorder.inbox.waiting and time.monotonic() < deadline:
        for wild in ("**", "follower/*", "*/cmd_vel", "*"):
            controller.put(wild, b"bad")
        controller.delete("follower/cmd_vel_wanted")
        allowed.publish("follower/cmd_vel_wanted", b"good")
        time.sleep(0.02)
    assert heard_by(recorder, wanted) == wanted


def test_strangers_are_told_what_is_wrong_with_what_they_show(plain: TlsLab, tmp_path: Path) -> None:
    lab_keys(tmp_path / "foreign")
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for name in ("operator.pem", "operator.key", "operator.json5"):
        (mixed / name).write_bytes((tmp_path / "foreign" / name).read_bytes())
    (mixed / "operator.key").chmod(0o600)
    (mixed / "ca.pem").write_bytes((plain.folder / "ca.pem").read_bytes())

    def said(endpoints: Endpoints) -> str:
        with pytest.raises(NoRouterError) as refused:
            open_session(endpoints, patience=0.1)
        return str(refused.value)

    foreign = Endpoints(connect=plain.endpoint, keys=RoleKeys(tmp_path / "foreign", "operator"))
    assert "the router's certificate is refused by" in said(foreign)
    assert "the router refuses the operator's certificate" in said(
        Endpoints(connect=plain.endpoint, keys=RoleKeys(mixed, "operator"))
    )
    assert "give --secure DIR" in said(Endpoints(connect=plain.endpoint))
    assert "if that router has keys" in said(Endpoints(connect=plain.endpoint.replace("tls/", "tcp/")))


def test_nobody_but_the_router_passes_for_the_router(plain: TlsLab, tmp_path: Path) -> None:
    false = RoleKeys(tmp_path, ROUTER)
    for name in ("ca.pem", "router.json5"):
        (tmp_path / name).write_bytes((plain.folder / name).read_bytes())
    for end in (".pem", ".key"):
        (tmp_path / f"router{end}").write_bytes((plain.folder / f"operator{end}").read_bytes())
    false.secret.chmod(0o600)
    with reserved_endpoint("tls") as endpoint:
        impostor = open_session(Endpoints(listen=endpoint, keys=false))
    try:
        with pytest.raises(NoRouterError, match="the router's certificate is refused"):
            open_session(Endpoints(connect=endpoint, keys=RoleKeys(plain.folder, "controller")), patience=0.1)
    finally:
        close_session(impostor)


def test_the_other_end_shows_who_it_is(plain: TlsLab) -> None:
    assert plain.wire("operator", TURTLEBOT3).shown_names() == (ROUTER,)


def test_a_viewer_does_not_pass_for_a_robot_that_listens(plain: TlsLab) -> None:
    with tls_lab(plain.folder) as lab:
        operator, robot = lab.wire("operator", TURTLEBOT3), lab.wire("robot", TURTLEBOT3)
        operator.watch_graph()
        viewer, false = lab.wire("viewer", TURTLEBOT3), lab.session("mocap")
        viewer.subscribe(["leader/cmd_vel"])
        token = f"@/{false.zid()}/@ros2_lv/MS/leader§cmd_vel/geometry_msgs§msg§TwistStamped/:1:0:0,10"
        held = false.liveliness().declare_token(token)
        robot.subscribe(["follower/cmd_vel"])
        deadline = time.monotonic() + PATIENCE
        while not operator.graph():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        time.sleep(SILENCE_S)
        assert [(each.key, each.publishes) for each in operator.graph()] == [("follower/cmd_vel", False)]
        undeclare(held)


@pytest.mark.parametrize("name", ["turtlebot3", "chain5"])
def test_only_guards_drive_where_there_are_some(name: str) -> None:
    scenario = with_guards(load_scenario(name))
    given = access_of(scenario)
    driven = {topic for each in given.values() for topic in each.says if topic.endswith("/cmd_vel")}
    robots = 2 if name == "turtlebot3" else 5
    assert len(driven) == robots
    assert given["guard"].says >= driven
    # An emulated leader tells what it drives by itself.
    others = {role for role, each in given.items() if each.says & driven} - {"guard", "emulator"}
    assert not others
    assert len(given["controller"].says & {f"{topic}_wanted" for topic in driven}) == robots - 1
    assert len(given["leader"].says & {f"{topic}_wanted" for topic in driven}) == 1


def test_orders_are_given_by_operators_and_guards_alone() -> None:
    given = access_of(TURTLEBOT3)
    for order in (STOP, "arm", "follower/side"):
        assert {role for role, each in given.items() if order in each.says} == {"operator", "guard"}


def test_without_guards_whoever_drives_a_robot_tells_it() -> None:
    given = access_of(load_scenario("turtlebot3"))
    told = {role for role, each in given.items() if "follower/cmd_vel" in each.says}
    assert told == {"controller", "follower", "operator"}
    assert not any(topic.endswith("_wanted") for each in given.values() for topic in each.says)


def test_what_comes_from_outside_says_no_more_than_that() -> None:
    given = access_of(TURTLEBOT3)
    assert given["mocap"].says == {RIGID_BODIES, DIAGNOSTICS}
    assert given["robot"].says == {"leader/odom", "follower/odom", "follower/leader_sighting"}
    assert given["robot"].hears == {"leader/cmd_vel", "follower/cmd_vel", STOP}
    assert not given["viewer"].says
    assert given["recorder"].says == {DIAGNOSTICS}


def test_every_subject_is_a_role_with_rules_that_are_there() -> None:
    made = access_control(TURTLEBOT3)
    names = {rule["id"] for rule in made["rules"]}
    assert len(names) == len(made["rules"])
    assert {each for policy in made["policies"] for each in policy["rules"]} == names
    assert {name for each in made["subjects"] for name in each["cert_common_names"]} == set(CLIENTS)
    assert not any("delete" in rule["messages"] for rule in made["rules"])
    asked = [rule for rule in made["rules"] if {"query", "reply"} & set(rule["messages"])]
    assert {key for rule in asked for key in rule["key_exprs"]} == {"abreast/clock/*", "@/*/router"}


def test_who_takes_part_may_ask_who_is_connected_and_a_viewer_may_not(plain: TlsLab) -> None:
    with tls_lab(plain.folder) as lab:
        operator, viewer = lab.wire("operator", TURTLEBOT3), lab.session("viewer")
        clients = operator.clients()
        deadline = time.monotonic() + PATIENCE
        while not clients.suspects() and time.monotonic() < deadline:
            clients.ask()
            clients.wait(SILENCE_S)
        (suspect,) = clients.suspects()
        assert str(viewer.zid()) in suspect
        assert not list(viewer.get("@/*/router", timeout=SILENCE_S))
        assert not list(viewer.get("@/*/router/**", timeout=SILENCE_S))
