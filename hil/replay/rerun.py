"""Replay: a log through the very same steps that run live, to verify it or to estimate anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from hil.errors import UsageError
from hil.log.events import Recorded, check_inputs, logged_events, recorded_commands, recorded_estimates
from hil.log.metadata import scenario_of
from hil.log.reader import Log
from hil.nodes.controller import ControllerState
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.nodes.findings import Findings, all_found, findings_in
from hil.nodes.link_nodes import controller_node, estimator_node
from hil.nodes.node import Outgoing
from hil.replay.feeding import why_edited
from hil.replay.foreign_log import foreign_inputs
from hil.replay.re_execution import (
    Execution,
    Parity,
    execute,
    index_by_digest,
    parity_beside,
    parity_of,
    re_execute,
)
from hil.replay.smoothing import ListeningEstimator, smoothed_estimates
from hil.replay.topic_map import TopicMap
from hil.scenario.certify import same_steps
from hil.scenario.links import Link, links_of
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire.events import Event
from hil.wire.messages import decode_as, typename_of

M = TypeVar("M", bound=msg.Message)


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What came out of a replay of one follower.

    ``parity``: by ``estimates``, ``commands`` and, where the log has any, ``certified``, how they compare
    with the recorded ones; empty where the log was estimated anew. ``missing_inputs``: inputs that were
    consumed live but are not in the log. ``certified``: estimates with radii, where these are asked for.
    ``controller``: None where there were no commands to repeat. ``restarts``: how often each node was started
    again during the run. ``fed``: why its inputs were fed in log order though nobody asked for that; empty
    where they were not. ``found``: findings of the nodes that were executed, by their names.
    """

    link: Link
    estimates: tuple[msg.LeaderEstimate, ...]
    commands: tuple[msg.Command, ...]
    estimator: EstimatorState
    controller: ControllerState | None = None
    parity: Mapping[str, Parity] = field(default_factory=dict)
    missing_inputs: int = 0
    certified: tuple[msg.CertifiedEstimate, ...] = ()
    restarts: Mapping[str, int] = field(default_factory=dict)
    fed: str = ""
    found: Mapping[str, Findings] = field(default_factory=dict)

    @property
    def scenario(self) -> Scenario:
        """The pair's scenario."""
        return self.link.scenario

    @property
    def mismatched(self) -> int:
        """How many outputs differ from the recorded ones."""
        return sum(parity.mismatched for parity in self.parity.values())


def replay(log: Log, scenario: Scenario | None = None) -> Replay:
    """Put one of our logs through the estimator of a scenario (the log's own by default).

    A log with estimates is replayed by what each of these consumed: with its own scenario, certified or not,
    its estimates and commands come out again, bit for bit; with another one its estimates are made anew, and
    there are no commands, as these would have moved the robot elsewhere. A log without estimates is fed in
    log order. Raises :class:`UsageError` for a log that is not ours or lacks what the estimator needs.
    """
    own = _own_scenario(log)
    return replay_link(log, Link(own if scenario is None else scenario), Link(own))


def replay_chain(log: Log, scenario: Scenario | None = None) -> tuple[Replay, ...]:
    """The same for every follower of a chain, from the leader on, each by itself.

    Raises :class:`UsageError` too if the scenario has more or fewer agents than the log.
    """
    return tuple(replay_link(log, link, was) for link, was in linked(log, scenario))


def linked(log: Log, scenario: Scenario | None = None) -> list[tuple[Link, Link]]:
    """Links of a scenario (the log's own by default), each with the log's own; raises as above."""
    own = links_of(_own_scenario(log))
    chosen = own if scenario is None else links_of(scenario)
    if len(chosen) != len(own):
        raise UsageError(
            f"log {log.path}: has {len(own) + 1} agents, expected as many as chain.agents = {len(chosen) + 1}"
        )
    return list(zip(chosen, own, strict=True))


def replay_link(log: Log, chosen: Link, own: Link) -> Replay:
    """Replay of one follower by a link that may differ from the log's own; see :func:`replay`."""
    if not same_steps(chosen.scenario, own.scenario):
        check_inputs(log, chosen.scenario)
    node = _estimator_of(chosen)
    recorded = recorded_estimates(log, node.topics.estimate)
    if not recorded:
        check_inputs(log, chosen.scenario)
        return _estimated_anew(chosen, node, execute(node, logged_events(log, node.subscribes)))
    index = index_by_digest(logged_events(log, node.subscribes))
    if why := _why_edited(log, node, recorded, index):
        return replay_fed(log, chosen, why)
    same = same_steps(chosen.scenario, own.scenario)
    execution = re_execute(node, node.topics.estimate, recorded, index, same_node=same)
    if not same:
        return _estimated_anew(chosen, node, execution)
    parity = {"estimates": parity_of(execution.repeated, node.topics.estimate, {})}
    if chosen.scenario.estimator.certify and own.scenario.estimator.certify:
        logged = [event.payload for event, _ in logged_events(log, [node.topics.certified])]
        parity["certified"] = parity_beside(execution.outputs, node.topics.certified, logged)
    return _with_commands(log, chosen, execution, parity)


def replay_fed(log: Log, link: Link, why: str) -> Replay:
    """Put the inputs of a log through the estimator of a link in log order, each at its log time.

    ``why``: what keeps them from being put through as they were consumed.
    Raises :class:`UsageError` if the log lacks what the estimator needs.
    """
    check_inputs(log, link.scenario)
    node = _estimator_of(link)
    fed = _estimated_anew(link, node, execute(node, logged_events(log, node.subscribes)))
    return replace(fed, fed=why)


def replay_foreign(log: Log, chart: TopicMap) -> Replay:
    """Put another lab's log through the estimator of the scenario that its topic map leads to.

    Raises :class:`UsageError` as :func:`hil.replay.foreign_log.foreign_inputs`.
    """
    link = Link(chart.scenario)
    node = _estimator_of(link)
    inputs = foreign_inputs(log, chart)
    played = _estimated_anew(link, node, execute(node, inputs.events))
    return replace(played, found=all_found([played.found, {"log": inputs.found}]))


def _why_edited(
    log: Log, node: EstimatorNode, recorded: Sequence[Recorded], index: Mapping[int, Event]
) -> str:
    consumed = [receipt for output in recorded for receipt in output.consumed]
    if all(digest in index for digest, _ in consumed):
        return ""
    logged = logged_events(log, node.subscribes)
    return why_edited(consumed, ((event.digest, log_ns) for event, log_ns in logged))


def _own_scenario(log: Log) -> Scenario:
    own = scenario_of(log)
    if own is None:
        raise UsageError(
            f"log {log.path}: was not made by abreast; name its topics with --map FILE "
            f"(topics there: {', '.join(sorted(log.topics)) or 'none'})"
        )
    return own


def _estimator_of(link: Link) -> EstimatorNode:
    if link.scenario.estimator.kind == "smoother":
        return ListeningEstimator(link.scenario, link.node_name("estimator"), link.other_bodies)
    return estimator_node(link)


def _estimated_anew(link: Link, node: EstimatorNode, execution: Execution[EstimatorState]) -> Replay:
    if isinstance(node, ListeningEstimator):
        smoothed = smoothed_estimates(node)
        estimates, certified = smoothed.estimates, smoothed.certified
    else:
        estimates = _decoded(execution.outputs, msg.LeaderEstimate)
        certified = _decoded(execution.outputs, msg.CertifiedEstimate)
    return Replay(
        link,
        estimates,
        (),
        execution.state,
        missing_inputs=execution.missing,
        certified=certified,
        found=_found(execution.reports),
    )


def _with_commands(
    log: Log, link: Link, estimator: Execution[EstimatorState], parity: Mapping[str, Parity]
) -> Replay:
    """Execute the controller again too. It is fed with the estimates as logged, so it is judged by itself."""
    node = controller_node(link)
    recorded = recorded_commands(log, node.topics.command)
    index = index_by_digest(logged_events(log, node.subscribes))
    execution = re_execute(node, node.topics.command, recorded, index)
    drive = node.topics.wanted
    sent = [event.payload for event, _ in logged_events(log, [drive])]
    return Replay(
        link=link,
        estimates=_decoded(estimator.outputs, msg.LeaderEstimate),
        commands=_decoded(execution.outputs, msg.Command),
        estimator=estimator.state,
        controller=execution.state,
        parity={
            **parity,
            "commands": parity_of(execution.repeated, node.topics.command, {drive: sent}),
        },
        missing_inputs=estimator.missing + execution.missing,
        certified=_decoded(estimator.outputs, msg.CertifiedEstimate),
        restarts={"estimator": estimator.restarts, "controller": execution.restarts},
        found=_found((*estimator.reports, *execution.reports)),
    )


def _found(reports: Iterable[Outgoing]) -> Mapping[str, Findings]:
    return all_found(findings_in(decode_as(report.payload, msg.DiagnosticArray)) for report in reports)


def _decoded(outputs: Iterable[Outgoing], kind: type[M]) -> tuple[M, ...]:
    return tuple(
        decode_as(message.payload, kind) for message in outputs if message.typename == typename_of(kind)
    )
