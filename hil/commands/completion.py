"""``abreast completion``: what lets a shell complete commands, options, names and keys."""

from __future__ import annotations

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class, get_completion_class

from hil.log.report_json import print_text

VARIABLE = "_ABREAST_COMPLETE"


@click.command("completion")
@click.argument("shell", type=click.Choice(("bash", "zsh", "fish")))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print what SHELL is to run so that it completes the words of abreast."""
    found = get_completion_class(shell)
    assert found is not None
    print_text(found(ctx.find_root().command, {}, "abreast", VARIABLE).source() + "\n")


@add_completion_class
class _Bash(BashComplete):
    """Bash, for which ``=`` ends a word: ``--set KEY=VALUE`` reaches us in pieces, and goes back so."""

    # What ends with = or . goes on without a blank.
    source_template = BashComplete.source_template.replace(
        "    return 0\n", "    [[ ${COMPREPLY[0]} == *[=.] ]] && compopt -o nospace\n    return 0\n"
    )

    @staticmethod
    def _check_version() -> None:
        """Nothing: whoever has a shell that is too old finds that it completes nothing."""

    def get_completion_args(self) -> tuple[list[str], str]:
        args, incomplete = super().get_completion_args()
        self._before = ""
        if incomplete == "=":
            args, incomplete = [*args, "="], ""
        if len(args) >= 2 and args[-1] == "=":
            if args[-2].startswith("-"):
                args = args[:-1]
            else:
                self._before = f"{args[-2]}="
                args, incomplete = args[:-2], self._before + incomplete
        whole: list[str] = []
        for each in args:
            if whole and (each == "=" or whole[-1].endswith("=")):
                whole[-1] += each
            else:
                whole.append(each)
        return whole, incomplete

    def format_completion(self, item: CompletionItem) -> str:
        item.value = item.value.removeprefix(self._before)
        return super().format_completion(item)
