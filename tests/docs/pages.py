"""The pages as tests look at them: fenced blocks with what is said of them, code within lines, commands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click

ROOT = Path(__file__).resolve().parent.parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
MADE = ROOT / "docs" / "commands.md"
"""Made out of the commands: nothing in it can differ from them."""

_FENCE = re.compile(r"^(?P<indent> *)```(?P<info>.*)$")
_MARKER = re.compile(r"^ *<!-- (.+) -->$")
_CODE = re.compile(r"(`+)((?:(?!`).|(?!\1)`)+?)\1", re.DOTALL)


class Block(NamedTuple):
    """A fenced block; ``marker``: the comment in the line before it, which says how it is run."""

    page: Path
    line: int
    language: str
    marker: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Lines that begin with ``abreast``, comments taken off."""
        lines = [re.sub(r"\s+#\s.*$", "", line) for line in self.text.splitlines()]
        return [line for line in lines if re.match(r"abreast [a-z]+(\s|$)", line)]

    @property
    def file(self) -> str:
        """Name that the first line gives to what the block holds; empty if it gives none."""
        named = re.match(r"# ([\w.-]+\.(?:py|toml))\n", self.text)
        return named[1] if named else ""


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    found, text, opened, marker, before = [], list[str](), 0, "", ""
    language = ""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        fence = _FENCE.match(line)
        if fence and not opened:
            told = _MARKER.match(before)
            opened, language, marker, text = number, fence["info"].strip(), told[1] if told else "", []
        elif fence:
            found.append(Block(page, opened, language, marker, "".join(f"{each}\n" for each in text)))
            opened = 0
        else:
            text.append(line)
        before = line
    assert not opened, f"{page}:{opened}: a block without an end"
    return found


def prose(page: Path) -> str:
    """The text of a page without its fenced blocks."""
    return re.sub(r"^ *```.*?^ *```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def code_in(text: str) -> Iterator[str]:
    """What stands between backquotes, on one line."""
    for _, code in _CODE.findall(text):
        yield " ".join(code.split())


def command_of(root: click.Group, words: list[str]) -> tuple[click.Context, list[str]]:
    """The innermost command that words begin with, and the words that are left.

    Raises :class:`KeyError` for a name that is no command.
    """
    context, left = click.Context(root, info_name="abreast"), list(words)
    command: click.Command = root
    while isinstance(command, click.Group) and left and not left[0].startswith("-"):
        inner = command.get_command(context, left[0])
        if inner is None:
            raise KeyError(left[0])
        context = click.Context(inner, info_name=left.pop(0), parent=context)
        if not isinstance(inner, click.Group):
            break
        command = inner
    return context, left


def options_of(context: click.Context) -> set[str]:
    """Options of a command, ``--help`` too."""
    told = [each for each in context.command.get_params(context) if isinstance(each, click.Option)]
    return {name for each in told for name in (*each.opts, *each.secondary_opts)}


def words_of(line: str) -> list[str]:
    """Words of a shell's line after ``abreast``, up to where its output goes."""
    words = shlex.split(line)
    ends = [k for k, word in enumerate(words) if word in {">", "|", "&&", ";"}]
    return words[1 : min(ends, default=len(words))]
