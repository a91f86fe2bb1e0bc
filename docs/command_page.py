"""Writes docs/commands.md, every command with its options, out of the commands themselves: `scripts/docs`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click

PAGE = Path(__file__).resolve().parent / "commands.md"
HEAD = """\
# All commands

Made by `scripts/docs` out of the commands themselves, as `--help` after any of them has it. Results go to
stdout, progress and notes to stderr; with `--json` exactly one JSON object goes to stdout. SCENARIO is a
shipped name or a TOML file ([its keys](scenario.md)); an endpoint is `tcp/HOST:PORT`, or `tls/HOST:PORT` with
[keys](security.md).

| exit code | means |
| --- | --- |
| 0 | done |
| 1 | a check that was asked for failed, or what ran broke down |
| 2 | wrong usage or input, with one line that says what to do |
| 130 | ended by Ctrl-C |
"""


def written(root: click.Group, name: str) -> str:
    """The whole page, of a console script of this name."""
    context = click.Context(root, info_name=name)
    return "\n".join([HEAD, *_below(root, context)])


def _below(group: click.Group, context: click.Context) -> Iterator[str]:
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None or command.hidden:
            continue
        inner = click.Context(command, info_name=name, parent=context)
        yield from _section(command, inner)
        if isinstance(command, click.Group):
            yield from _below(command, inner)


def _section(command: click.Command, context: click.Context) -> Iterator[str]:
    depth = context.command_path.count(" ") + 1
    yield f"{'#' * depth} {context.command_path}\n"
    yield from _paragraphs(command.help or "")
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"```text\n{context.command_path} {usage}\n```\n"
    options = [each for each in command.get_params(context) if isinstance(each, click.Option)]
    records = [each.get_help_record(context) for each in options]
    rows = [
        f"| `{_cell(option)}` | {_cell(_plain(does))} |"
        for option, does in filter(None, records)
        if not option.endswith("--help")
    ]
    if rows:
        yield "\n".join(["| option | does |", "| --- | --- |", *rows, ""])


def _paragraphs(text: str) -> Iterator[str]:
    """Paragraphs of a help text; click keeps the lines of one that begins with a backspace."""
    for paragraph in text.strip().split("\n\n"):
        kept = paragraph.removeprefix("\b\n")
        if kept != paragraph:
            yield f"```text\n{kept}\n```\n"
        else:
            yield f"{_plain(' '.join(paragraph.split()))}\n"


def _plain(text: str) -> str:
    """Text that Markdown shows as it is."""
    return "".join(f"\\{sign}" if sign in "\\*<`" else sign for sign in text)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def main() -> None:
    """Write the page."""
    from hil.command_line import abreast

    PAGE.write_text(written(abreast, "abreast"), encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(PAGE.parent.parent))
    main()
