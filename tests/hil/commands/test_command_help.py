"""Help: what stands at its end parses, and what it says of numbers is in words."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator

import click
import pytest

from hil.command_line import COMMANDS, GROUPS, abreast, main
from hil.commands.examples import EXAMPLES
from hil.scenario.files import scenario_names
from hil.scenario.schema import ESTIMATOR_NAMES, LAW_NAMES


def leaves(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """All commands that do something, by their words."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from leaves(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


LEAVES = dict(leaves(abreast))


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    capsys.readouterr()
    with pytest.raises(SystemExit) as left:
        main(arguments)
    said = capsys.readouterr()
    assert (left.value.code, said.err) == (0, "")
    return said.out


def test_abreast_alone_shows_all_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys)
    assert text == shown(capsys, "--help")
    for name in (*COMMANDS, *scenario_names(), *ESTIMATOR_NAMES, *LAW_NAMES):
        assert re.search(rf"(?<![\w-]){name}(?![\w-])", text), name
    assert "Others:" not in text


@pytest.mark.parametrize("group", ["import", "bridge", "secure", "scenario"])
def test_a_group_alone_shows_its_commands(group: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "Commands:" in shown(capsys, group)


def test_every_command_is_in_one_group() -> None:
    grouped = [name for names in GROUPS.values() for name in names]
    assert len(grouped) == len(set(grouped))
    assert set(COMMANDS) <= set(grouped)


@pytest.mark.parametrize("words", LEAVES)
def test_the_examples_of_a_command_parse_and_stand_in_its_help(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, *words.split(), "--help")
    assert 2 <= len(EXAMPLES[words]) <= 5
    for example in EXAMPLES[words]:
        assert example in text
        line = example.removeprefix('eval "$(').removesuffix(')"')
        given = shlex.split(re.sub(r" > \S+$", "", line))
        assert given[: 1 + len(words.split())] == ["abreast", *words.split()]
        LEAVES[words].make_context(words, given[1 + len(words.split()) :])


@pytest.mark.parametrize("words", LEAVES)
def test_help_tells_types_in_words(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, *words.split(), "--help")
    assert not re.search(r"RANGE|INTEGER|FLOAT|<=", text)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["rnu"], "abreast: 'rnu' is no command; did you mean 'run'?"),
        (["import", "cvs"], "abreast import: 'cvs' is no command; did you mean 'csv'?"),
        (["xyzzy"], "'xyzzy' is no command; there are: run, "),
        (["run", "--sead", "3"], "abreast run: --sead is no option; did you mean '--seed'?"),
        (["run", "--seed", "-1"], "abreast run: --seed is '-1', expected a whole number of 0 or more"),
        (["run", "--seed", "x"], "abreast run: --seed is 'x', expected a whole number of 0 or more"),
        (["run", "--duration", "0"], "--duration is '0', expected a number of seconds, more than 0"),
        (["replay", "a", "--from", "soon"], "--from is 'soon', expected a number of seconds"),
        (["secure", "init", "d", "--days", "9999"], "--days is '9999', expected a whole number of 1 to 3650"),
        (["run", "--emulate", "both"], "--emulate: 'both' is not one of 'leader', 'follower'"),
        (["run", "--estimator", "efk"], "did you mean 'ekf'?"),
        (["run", "--law", "indpendent"], "did you mean 'independent'?"),
        (["sweep", "--estimators", "ekf,ufk"], "did you mean 'ukf'?"),
        (["run", "--set", "estimator.own_motion=fusde"], "did you mean 'fused'?"),
    ],
)
def test_a_mistyped_word_is_answered_by_one_that_is_meant(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    printed = capsys.readouterr()
    assert (left.value.code, printed.out) == (2, "")
    assert said in printed.err
    assert printed.err.count("\n") == 1
