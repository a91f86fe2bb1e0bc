"""A log replayed and judged as was asked: of a pair, one follower of a chain or all, or a stranger's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from hil.errors import UsageError
from hil.judge.own_motion import judge_own_motion
from hil.judge.replay_verdict import (
    Played,
    fed_json,
    parity_json,
    refuse_other_steps,
    run_data_of_replay,
    why_not_same,
)
from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.log.description import RECORD
from hil.log.metadata import scenario_of
from hil.log.own_sources import with_sources
from hil.log.reader import DamagedLogError, Log
from hil.log.unpacked import salvaged
from hil.replay.feeding import guessed_link, why_guessed
from hil.replay.log_replay import GoOn, kept_replays
from hil.replay.rerun import linked, replay_chain, replay_fed, replay_foreign, replay_link
from hil.replay.topic_map import load_topic_map
from hil.scenario.brought import settled_references
from hil.scenario.certify import CERTIFY, same_steps
from hil.scenario.files import Overrides, with_overrides
from hil.scenario.links import Link, chain_of, link_of
from hil.scenario.schema import Scenario

_KEYS = {"law": "controller.law", "estimator": "estimator.kind"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayChoice:
    """What a log is replayed by, and what is judged.

    ``estimator``, ``law``: in place of the log's, or where its own are now. ``leader``, ``follower``: names
    of bodies; in a chain ``follower`` is the one to look at, and without it all are. ``chart``: topic map of
    a log that is not ours. ``from_s``, ``to_s`` [s] limit what is judged. ``verify``: whether outputs are
    compared with the recorded ones. ``certify``: whether certified estimates are made. ``in_messages``: not
    to be done in one pass, which leaves rows, but message by message. ``go_on``: called now and then with the
    share that is done, where that is known; a replay ends where it says no.
    """

    estimator: str | None = None
    law: str | None = None
    leader: str | None = None
    follower: str | None = None
    chart: str | None = None
    overrides: Overrides = ()
    from_s: float | None = None
    to_s: float | None = None
    verify: bool = False
    certify: bool = False
    in_messages: bool = False
    go_on: GoOn | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """A replay of one follower, or of each of a chain: its JSON, what it was judged by, and how it went.

    ``scenario``: the one that it was replayed by, of a chain as a whole. ``damage``: what is gone of the log.
    """

    summary: dict[str, Any]
    runs: tuple[RunData, ...]
    played: tuple[Played, ...]
    scenario: Scenario
    damage: str = ""

    def why_not_same(self, log: Log) -> str:
        """What speaks against a replay that repeats the log bit for bit; empty if nothing does."""
        return next(filter(None, (why_not_same(log, each) for each in self.played)), "")


def chain_in(log: Log, choice: ReplayChoice) -> Scenario | None:
    """The log's own scenario if it is one of a chain whose followers are all replayed, else None."""
    own = None if choice.chart is not None or choice.follower is not None else scenario_of(log)
    return None if own is None or chain_of(own) is None else own


def replayed(log: Log, choice: ReplayChoice) -> Replayed:
    """Replay a log and judge what comes out, of a damaged log what is whole.

    Raises :class:`UsageError` for what cannot be replayed so, and for settings that cannot be verified.
    """
    try:
        return _replayed(log, choice)
    except DamagedLogError:
        if log.damage or log.source is not None:
            raise
    return _replayed(salvaged(log.path), choice)


def _replayed(log: Log, choice: ReplayChoice) -> Replayed:
    if choice.from_s is not None and choice.to_s is not None and choice.to_s <= choice.from_s:
        raise UsageError(f"--to {choice.to_s:g}: expected more than --from {choice.from_s:g}")
    log, changes = _with_sources(log, choice)
    if (chain := chain_in(log, choice)) is not None:
        return _replayed_chain(log, chain, choice, changes)
    played = _played(log, choice, changes)
    run_data = _with_damage(log, run_data_of_replay(log, played, choice.from_s, choice.to_s))
    summary = summarise(run_data)
    if choice.chart is None and (own_motion := judge_own_motion(log, played)):
        summary["own_motion"] = own_motion
    if choice.verify:
        summary["parity"] = parity_json(played)
    summary |= fed_json(played)
    return Replayed(summary, (run_data,), (played,), played.scenario, log.damage)


def _with_damage(log: Log, run_data: RunData) -> RunData:
    """Run data that names what is gone of the log among what was found."""
    if not log.damage:
        return run_data
    others = run_data.found or {}
    of_log = {**others.get("log", {}), "log_damaged": log.damage}
    return replace(run_data, found={**others, "log": of_log})


def _with_sources(log: Log, choice: ReplayChoice) -> tuple[Log, tuple[Overrides, ...]]:
    """Log with its own law and estimator where they are now, and all that is to be different, in order."""
    chosen = settled_references(choice.law, choice.estimator)
    placed = with_sources(log, chosen, RECORD)
    own = scenario_of(placed)
    kept = {} if own is None else {"law": own.controller.law, "estimator": own.estimator.kind}
    others = {
        _KEYS[noun]: text for noun, text in chosen.items() if text is not None and text != kept.get(noun)
    }
    return placed, (choice.overrides, others, [CERTIFY] if choice.certify else [])


def _replayed_chain(log: Log, own: Scenario, choice: ReplayChoice, changes: Sequence[Overrides]) -> Replayed:
    # Brings integrators along: half a second of imports that a pair has no use for.
    from hil.judge.chain_summary import summarise_chain

    _refuse_leader(choice.leader)
    chosen = with_overrides(own, *changes)
    if choice.verify:
        refuse_other_steps(chosen, own)
    kept = None if choice.in_messages else kept_replays(log, linked(log, chosen), choice.go_on)
    played: tuple[Played, ...] = replay_chain(log, chosen) if kept is None else kept
    runs = tuple(
        _with_damage(log, run_data_of_replay(log, each, choice.from_s, choice.to_s)) for each in played
    )
    summary = summarise_chain(chosen, runs)
    for pair, each in zip(summary["pairs"], played, strict=True):
        pair |= fed_json(each)
    if choice.verify:
        summary["parity"] = parity_json(*played)
        for pair, each in zip(summary["pairs"], played, strict=True):
            pair["parity"] = parity_json(each)
    return Replayed(summary, runs, played, chosen, log.damage)


def _played(log: Log, choice: ReplayChoice, changes: Sequence[Overrides]) -> Played:
    """Replay of one of our logs, or of another lab's by its topic map."""
    if choice.chart is not None:
        if choice.verify:
            raise UsageError("--verify: a log that needs --map has no estimates of ours; leave one out")
        chart = load_topic_map(choice.chart, choice.leader, choice.follower, *changes)
        return replay_foreign(log, chart)
    own = scenario_of(log)
    if own is None:
        link = guessed_link(log, choice.leader, choice.follower, *changes)
        return replay_fed(log, link, why_guessed(link))
    if chain_of(own) is not None and choice.follower is not None:
        _refuse_leader(choice.leader)
        link = link_of(with_overrides(own, *changes), choice.follower)
        was = link_of(own, choice.follower)
        if choice.verify:
            refuse_other_steps(link.scenario, was.scenario)
        return _in_one_pass(log, link, was, choice)
    names = {"leader.name": choice.leader, "follower.name": choice.follower}
    renamed = {key: name for key, name in names.items() if name is not None}
    chosen = with_overrides(own, *changes, renamed)
    if choice.verify and not same_steps(chosen, own):
        raise UsageError(
            f"--verify compares with what was recorded: by {own.estimator.kind}, of leader "
            f"{own.leader.name!r} and follower {own.follower.name!r}, with the log's own settings; leave out "
            "what changes that"
        )
    return _in_one_pass(log, Link(chosen), Link(own), choice)


def _in_one_pass(log: Log, link: Link, was: Link, choice: ReplayChoice) -> Played:
    """Replay of one follower, message by message where it cannot be done in one pass."""
    kept = None if choice.in_messages else kept_replays(log, [(link, was)], choice.go_on)
    return replay_link(log, link, was) if kept is None else kept[0]


def _refuse_leader(leader: str | None) -> None:
    if leader is not None:
        raise UsageError(
            f"--leader {leader!r}: in the log of a chain everybody follows the robot before; "
            "leave it out, and give --follower"
        )
