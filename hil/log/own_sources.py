"""Laws and estimators of others in logs: which they were, by digest, and where a replay has them from.

What a log names is checked by its digest before it is imported: another version of a law would give other
commands, and be told of as a replay that differs.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import tomli_w

from hil.errors import UsageError
from hil.extensions import estimators, laws
from hil.extensions.reference import found, is_reference, short
from hil.log.reader import Log
from hil.scenario.schema import Scenario

RECORD = "abreast.sources"
"""Metadata record with the digest of the log's own law and estimator."""
_PROGRAM = "program:"


class _Source(NamedTuple):
    """A law or an estimator of a log: how it and its option are called, and its key in the scenario."""

    noun: str
    option: str
    section: str
    key: str


_SOURCES = (
    _Source("law", "--law", *laws.NOUN.split(".")),
    _Source("estimator", "--estimator", *estimators.NOUN.split(".")),
)


def source_metadata(scenario: Scenario) -> dict[str, dict[str, str]]:
    """Metadata record with the digests of what a scenario has from others; empty if that is nothing."""
    given = {"law": scenario.controller.law, "estimator": scenario.estimator.kind}
    digests = {noun: found(text, noun).digest() for noun, text in given.items() if is_reference(text)}
    return {RECORD: digests} if digests else {}


def digest_of(log: Log, noun: str) -> str | None:
    """Digest of a log's own law or estimator; None if it has none or does not say."""
    return log.metadata.get(RECORD, {}).get(noun)


def law_json(scenario: Scenario, digest: str | None) -> str | dict[str, Any]:
    """Law as summaries have it: its name, or the name and the digest of one's own."""
    text = scenario.controller.law
    return {"name": short(text), "digest": digest} if is_reference(text) else text


def with_sources(log: Log, given: Mapping[str, str | None], record: str) -> Log:
    """Log whose law and estimator are where they can be had, as its scenario in ``record`` then says.

    ``given``: by ``law`` and ``estimator``, settled references in the place of the log's own. Who is of the
    same source takes that place; of others the log's own are not needed. Raises :class:`UsageError` if one is
    needed and not to be had, or another one by now.
    """
    text = log.metadata.get(record, {}).get("scenario_toml")
    if text is None:
        return log
    tree = tomllib.loads(text)
    changed = False
    for source in _SOURCES:
        section = tree.get(source.section, {})
        own, other = section.get(source.key, ""), given.get(source.noun)
        if not is_reference(own):
            continue
        digest = digest_of(log, source.noun)
        if other is None:
            _refuse_unless_there(log, source, own, digest)
        elif is_reference(other) and _is_same(source, own, other, digest):
            section[source.key], changed = other, True
    if not changed:
        return log
    metadata = dict(log.metadata)
    metadata[record] = {**metadata[record], "scenario_toml": tomli_w.dumps(tree)}
    return replace(log, metadata=metadata)


def _is_same(source: _Source, own: str, other: str, digest: str | None) -> bool:
    """Whether another reference is to the source that a log was made with."""
    if own.startswith(_PROGRAM):
        # Whoever brought it had a function, not a file; that its commands come out again is to be seen.
        return other.rpartition(":")[2] == own.rpartition(":")[2]
    return found(other, source.option).digest() == digest


def _refuse_unless_there(log: Log, source: _Source, own: str, digest: str | None) -> None:
    called = f"log {log.path}: its {source.noun} {short(own)} (digest {digest or 'not known'})"
    remedy = f"give it with {source.option} FILE.py:{own.rpartition(':')[2]}"
    try:
        there = found(own, source.noun).digest()
    except UsageError:
        raise UsageError(f"{called} is not at {own.rpartition(':')[0]}; {remedy}") from None
    if digest is not None and there != digest:
        raise UsageError(f"{called} is another one by now at {own.rpartition(':')[0]} ({there}); {remedy}")
