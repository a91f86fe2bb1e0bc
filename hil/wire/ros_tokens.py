"""Who publishes and who hears what, as ROS 2 graphs on Zenoh say it: liveliness tokens, written and read.

zenoh-bridge-ros2dds and rmw_zenoh have one for every publisher and subscription, and list a topic by them.
"""

from __future__ import annotations

from typing import NamedTuple

from hil.wire.key_layout import KeyLayout, dds_type, ros_type

_PUBLISHER, _SUBSCRIPTION = "MP", "MS"
_DEPTH = 10
_RELIABLY_HEARD = ("std_msgs/msg/String",)
"""Types of orders; who hears all else hears best effort, as that hears any publisher."""


class Endpoint(NamedTuple):
    """A publisher or a subscription. ``key``: of its topic, without domain, type and hash.

    ``session``: id of its Zenoh session; ``node``: its name, where the layout tells.
    """

    session: str
    publishes: bool
    key: str
    typename: str
    node: str = ""


def node_token(layout: KeyLayout, session: str, node: str) -> str:
    """Key expression of the token of a node; of a bridge in the layout of bridges, which has no nodes."""
    if layout.kind == "ros2dds":
        return f"@/{session}/@ros2_lv"
    return layout.within(f"@ros2_lv/{layout.domain}/{session}/0/0/NN/%/%/{node}")


def endpoint_token(layout: KeyLayout, number: int, topic: str, endpoint: Endpoint) -> str:
    """Key expression of the token of a publisher or a subscription, the ``number``-th of its session."""
    kind = _PUBLISHER if endpoint.publishes else _SUBSCRIPTION
    reliable = endpoint.publishes or endpoint.typename in _RELIABLY_HEARD
    if layout.kind == "ros2dds":
        known = "" if layout.distro == "humble" else f":typehash={layout.type_hash(topic)};"
        quality = f":{int(reliable)}:0:0,{_DEPTH}{known}"
        key, typename = (each.replace("/", "§") for each in (endpoint.key, endpoint.typename))
        return f"@/{endpoint.session}/@ros2_lv/{kind}/{key}/{typename}/{quality}"
    quality = f"{'' if reliable else 2}::,{_DEPTH}:,:,:,,"
    place = f"@ros2_lv/{layout.domain}/{endpoint.session}/0/{number}/{kind}/%/%/{endpoint.node}"
    name = f"%{layout.name(topic).replace('/', '%')}"
    told = (name, dds_type(endpoint.typename), layout.type_hash(topic), quality)
    return layout.within(f"{place}/{'/'.join(told)}")


def all_tokens(layout: KeyLayout) -> str:
    """Key expression of the tokens of everybody."""
    if layout.kind == "ros2dds":
        return "@/*/@ros2_lv/**"
    return layout.within(f"@ros2_lv/{layout.domain}/**")


def node_tokens(layout: KeyLayout) -> str:
    """Key expression of the tokens of all nodes."""
    if layout.kind == "ros2dds":
        return "@/*/@ros2_lv"
    return layout.within(f"@ros2_lv/{layout.domain}/*/*/*/NN/*/*/*")


def topic_tokens(layout: KeyLayout, topic: str, *, publishes: bool) -> str:
    """Key expression of the tokens of all publishers of a topic, or of all subscriptions to it."""
    kind, name = _PUBLISHER if publishes else _SUBSCRIPTION, layout.name(topic)
    if layout.kind == "ros2dds":
        return f"@/*/@ros2_lv/{kind}/{layout.within(name).replace('/', '§')}/*/*"
    return layout.within(f"@ros2_lv/{layout.domain}/*/*/*/{kind}/*/*/*/%{name.replace('/', '%')}/*/*/*")


def session_in(layout: KeyLayout, token: str) -> str:
    """Id of the session that shows a token of any kind, empty for what is none."""
    parts = token.removeprefix(layout.within("")).split("/")
    match parts:
        case ["@", session, "@ros2_lv", *_] | ["@ros2_lv", _, session, *_]:
            return session
    return ""


def endpoint_in(layout: KeyLayout, token: str) -> Endpoint | None:
    """The publisher or subscription that a token stands for; None for one that stands for something else."""
    own = layout.within("")
    parts = token.removeprefix(own).split("/") if layout.kind == "rmw_zenoh" else token.split("/")
    match parts:
        case ["@", session, "@ros2_lv", "MP" | "MS" as kind, key, typename, _]:
            return Endpoint(session, kind == _PUBLISHER, key.replace("§", "/"), typename.replace("§", "/"))
        case ["@ros2_lv", _, session, _, _, "MP" | "MS" as kind, _, _, node, name, typename, _, _]:
            key = layout.within(name.replace("%", "/").removeprefix("/"))
            return Endpoint(session, kind == _PUBLISHER, key, ros_type(typename), node)
    return None
