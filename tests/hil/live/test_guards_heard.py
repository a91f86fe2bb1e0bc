"""What guards say of their robots, as whoever arms them hears it."""

from __future__ import annotations

from hil.guard.diagnostics_bytes import diagnostics_bytes
from hil.live.guards_heard import GuardsHeard


def test_a_guard_is_armed_when_it_says_that_it_holds_nothing() -> None:
    guards = GuardsHeard()
    assert not guards.are_armed("")
    guards.hear(b"nonsense")
    guards.hear(diagnostics_bytes("controller", 1, "", {"latched": "stopped"}))
    assert guards.held == {}
    guards.hear(diagnostics_bytes("guard/leader", 1, "", {"latched": ""}))
    guards.hear(diagnostics_bytes("guard/follower", 1, "latched (stopped): enough", {"latched": "stopped"}))
    assert guards.held == {"leader": "", "follower": "latched (stopped): enough"}
    assert guards.are_armed("leader")
    assert not guards.are_armed("follower")
    assert not guards.are_armed("")
    assert not guards.are_armed("agent3")
    guards.hear(diagnostics_bytes("guard/follower", 2, "", {"latched": ""}))
    assert guards.are_armed("")


def test_a_flood_of_names_keeps_no_known_guard_from_being_heard() -> None:
    for robots in (None, ["follower"]):
        guards = GuardsHeard(robots)
        assert guards.hear(diagnostics_bytes("guard/follower", 1, "", {"latched": ""})) == {"follower"}
        for k in range(1100):
            guards.hear(diagnostics_bytes(f"guard/stranger{k}", 1, "", {"latched": ""}))
        assert len(guards.held) == (1000 if robots is None else 1)
        guards.hear(diagnostics_bytes("guard/follower", 2, "enough", {"latched": "stopped"}))
        assert guards.held["follower"] == "enough"
