"""The console script ``abreast``: finds the command, and turns every expected error into one line."""

from __future__ import annotations

import errno
import importlib
import os
import sys
from collections.abc import Sequence

import click

from formation.collector import collector_paused
from hil import __version__
from hil.commands.command_group import CommandGroup
from hil.commands.command_help import names_text, usage_mistake
from hil.commands.completed import complete_by_name
from hil.errors import AbreastError, UsageError
from hil.extras import is_left_out, needs_extra

COMMANDS = {
    "run": "the main job: emulated robots, estimator, controller, recorder; live or in lockstep",
    "replay": "run a log through the same steps: verify it, re-estimate it, judge it",
    "simulate": "the noise-free experiments of the paper, with pictures",
    "bounds": "the certificate: what is guaranteed of estimates and formation, and on what it rests",
    "sweep": "Monte Carlo over noise against the bounds, on this machine or a cluster",
    "compare": "runs, logs or sweeps beside each other: what differs, and which was better",
    "gains": "propose gains for a scenario, with the reason for each",
    "import": "turn other recordings into logs",
    "export": "a log as tables for pandas and polars, or as a file for Foxglove and PlotJuggler",
    "calibrate": "find the offsets of a range and bearing sensor that mocap has watched",
    "recover": "make a log whole that was cut off or damaged",
    "doctor": "what is wrong in a lab before anything moves, and what to do about it",
    "status": "daemons, bodies and robots of a lab, live",
    "live": "a page in the browser that shows a lab while it drives, and stops it",
    "stop": "stop all robots of a lab",
    "arm": "let robots be driven again that their guards hold",
    "guard": "the guard of a robot, between the wire and its driver, as a daemon",
    "emulator": "the emulated robots and motion capture, as a daemon",
    "follower": "estimator and controller in one process, as a daemon",
    "estimator": "the estimator, as a daemon",
    "controller": "the controller, as a daemon",
    "leader": "what drives a real leader by its program, as a daemon",
    "recorder": "the recorder, as a daemon",
    "router": "the router that all others connect to, on its own, as a daemon",
    "scenario": "scenarios: list them, show one as it is resolved, begin one of your own",
    "completion": "what lets bash, zsh or fish complete commands, options, names and keys",
    "faults": "faults put into live runs on purpose, and whether robots stand for them",
    "soak": "a long live run: whether memory stays flat, cycles on time, and its log repeats",
    "secure": "keys by which a router knows who is who, and what each may do",
    "bridge": "motion captures of others brought to the wire, and the wire to Foxglove, as a daemon",
}
_OF_NAMES = (errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.EACCES)
"""What is wrong with a name that was given, and not with the machine."""

GROUPS = {
    "Drive": ("run", "live", "doctor", "status", "stop", "arm"),
    "Look back": ("replay", "compare", "export", "import", "recover"),
    "Judge and design": ("bounds", "gains", "simulate", "sweep", "calibrate", "scenario"),
    "Try a lab": ("soak", "faults"),
    "Set up a lab": ("secure", "completion"),
    "Daemons": (
        *("router", "bridge", "guard", "emulator", "follower", "estimator", "controller", "leader"),
        "recorder",
    ),
}
"""Commands by what they are for, as help shows them."""

_COMPLETES = "_ABREAST_COMPLETE"
"""By this variable a shell asks for completions instead."""

_MODULES = {"import": "import_recording"}
_DAEMONS = ("emulator", "follower", "estimator", "controller", "leader", "recorder")


class _LazyGroup(CommandGroup):
    """Imports a command's module only when that command is called, so that each starts fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        with collector_paused():
            command = _loaded(cmd_name)
        complete_by_name(command)
        for each in getattr(command, "commands", {}).values():
            complete_by_name(each)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        grouped = {name for names in GROUPS.values() for name in names}
        others = {"Others": tuple(name for name in COMMANDS if name not in grouped)}
        for title, names in (GROUPS | others).items():
            if rows := [(name, COMMANDS[name]) for name in names if name in COMMANDS]:
                with formatter.section(title):
                    formatter.write_dl(rows, col_spacing=2)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        formatter.write_paragraph()
        for line in names_text(("scenario", "law", "estimator")).splitlines():
            formatter.write(f"{line}\n")
        formatter.write_paragraph()
        formatter.write("abreast COMMAND --help tells more of a command, with examples.\n")


def _loaded(name: str) -> click.Command:
    """A command, from its module."""
    if name in _DAEMONS:
        from hil.commands.daemon import daemon_command

        return daemon_command(name, COMMANDS[name])
    module = importlib.import_module(f"hil.commands.{_MODULES.get(name, name)}")
    command: click.Command = module.command
    return command


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="abreast")
def abreast() -> None:
    """Estimate a leader's motion, keep abreast of it, and judge how well that went."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the console script and exit: 0 done, 1 a check failed, 2 bad usage or bad input, 130 Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _refuse_no_text(given)
        if _COMPLETES in os.environ:
            importlib.import_module("hil.commands.completion")
        code = abreast.main(args=given, prog_name="abreast", standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "abreast"
        _say(f"{where}: {usage_mistake(error)} (see `{where} --help`)")
        code = 2
    except click.ClickException as error:
        _say(f"abreast: {error.format_message()}")
        code = 2
    except (click.Abort, KeyboardInterrupt):
        _say("abreast: interrupted")
        code = 130
    except AbreastError as error:
        _say(f"abreast: {error}")
        code = error.exit_code
    except BrokenPipeError:
        sys.stderr.close()
        code = 1
    except ModuleNotFoundError as error:
        if not is_left_out(error):
            raise
        _say(f"abreast: {needs_extra(given[0], error)}")
        code = 2
    except OSError as error:
        # A full disk, say, on the way.
        _say(f"abreast: {error.filename or 'a file'}: {error.strerror or error}")
        code = 2 if error.errno in _OF_NAMES else 1
    sys.exit(code if isinstance(code, int) else 0)


def _refuse_no_text(arguments: Sequence[str]) -> None:
    """Raise :class:`UsageError` for a NUL, which no name of a file and no text may hold."""
    for argument in arguments:
        if "\0" in argument:
            raise UsageError(f"argument {argument!r}: has a NUL character; leave it out")


def _say(line: str) -> None:
    # Names of files may be no text.
    shown = line.encode("utf-8", "backslashreplace").decode()
    click.echo(" ".join(shown.split()), err=True)


if __name__ == "__main__":
    main()
