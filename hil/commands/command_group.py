"""Groups of commands: alone they show what there is, and a word that is none of them is answered by one."""

from __future__ import annotations

import click

from hil.commands.command_help import explain
from hil.scenario.checked_toml import meant


class CommandGroup(click.Group):
    """A group of commands as ``abreast`` has them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse what was given; nothing asks for help."""
        if not args and not ctx.resilient_parsing:
            click.echo(ctx.get_help())
            ctx.exit()
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that was asked for; its help is put in words if that is what is wanted of it."""
        word, *others = args
        command = self.get_command(ctx, word)
        if command is None:
            if not ctx.resilient_parsing and not word.startswith("-"):
                known = self.list_commands(ctx)
                hint = meant(word, known) or f"; there are: {', '.join(known)}"
                ctx.fail(f"{word!r} is no command{hint}")
            return super().resolve_command(ctx, args)
        if not {*ctx.help_option_names}.isdisjoint(others):
            explain(command, f"{ctx.command_path} {word}")
        return word, command, others
