"""What was refused and found over time is taken from reports, and nothing that is no count."""

from __future__ import annotations

from hil.nodes.troubles import Trouble, troubles_in, troubles_of
from hil.wire.message_types import DiagnosticArray, DiagnosticStatus, KeyValue
from hil.wire.messages import header

AT_NS = 1_700_000_000_500_000_000


def report(name: str, **values: str) -> DiagnosticArray:
    entries = [KeyValue(key=key.replace("__", "."), value=value) for key, value in values.items()]
    status = DiagnosticStatus(level=0, name=f"abreast/{name}", message="", hardware_id="", values=entries)
    return DiagnosticArray(header=header(AT_NS, ""), status=[status])


def test_counts_and_names_are_taken_with_their_time() -> None:
    told = report("estimator", refused__gated="5", finding__odometry_late="by 0.3 s", taken__frames="7")
    assert troubles_in(told) == {"estimator": Trouble(AT_NS, {"gated": 5}, frozenset({"odometry_late"}))}


def test_what_is_no_count_is_left_out() -> None:
    told = report("estimator", refused__gated="many", refused__swapped="9" * 40, refused__frozen="-1")
    assert troubles_in(told)["estimator"].refused == {}


def test_only_the_reports_of_a_node_count() -> None:
    told = [report("controller", refused__gated="1"), report("estimator", refused__gated="2")]
    assert [each.refused for each in troubles_of(told, "estimator")] == [{"gated": 2}]
