"""The console script ``abreast``: finds the command, and turns every expected error into one line."""

from __future__ import annotations

import errno
import importlib
import sys
from collections.abc import Sequence

import click

from formation.collector import collector_paused
from hil import __version__
from hil.errors import AbreastError, UsageError

COMMANDS = {
    "run": "the main job: emulated robots, estimator, controller, recorder; live or in lockstep",
    "replay": "run a log through the same steps: verify it, re-estimate it, judge it",
    "simulate": "the noise-free experiments of the paper, with pictures",
    "bounds": "the certificate: what is guaranteed of estimates and formation, and on what it rests",
    "sweep": "Monte Carlo over noise against the bounds, on this machine or a cluster",
    "gains": "propose gains for a scenario, with the reason for each",
    "import": "turn other recordings into logs",
    "export": "a log as tables for pandas and polars, or as a file for Foxglove and PlotJuggler",
    "calibrate": "find the offsets of a range and bearing sensor that mocap has watched",
    "recover": "make a log whole that was cut off or damaged",
    "doctor": "what is wrong in a lab before anything moves, and what to do about it",
    "status": "daemons, bodies and robots of a lab, live",
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
    "faults": "faults put into live runs on purpose, and whether robots stand for them",
    "soak": "a long live run: whether memory stays flat, cycles on time, and its log repeats",
    "secure": "keys by which a router knows who is who, and what each may do",
    "bridge": "motion captures of others brought to the wire, and the wire to Foxglove, as a daemon",
}
_OF_NAMES = (errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.EACCES)
"""What is wrong with a name that was given, and not with the machine."""

_MODULES = {"import": "import_recording"}
_DAEMONS = ("emulator", "follower", "estimator", "controller", "leader", "recorder")


class _LazyGroup(click.Group):
    """Imports a command's module only when that command is called, so that each starts fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        with collector_paused():
            if cmd_name in _DAEMONS:
                from hil.commands.daemon import daemon_command

                return daemon_command(cmd_name, COMMANDS[cmd_name])
            module = importlib.import_module(f"hil.commands.{_MODULES.get(cmd_name, cmd_name)}")
            command: click.Command = module.command
            return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="abreast")
def abreast() -> None:
    """Estimate a leader's motion, keep abreast of it, and judge how well that went."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the console script and exit: 0 done, 1 a check failed, 2 bad usage or bad input, 130 Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _refuse_no_text(given)
        code = abreast.main(args=given, prog_name="abreast", standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "abreast"
        _say(f"{where}: {error.format_message()} (see `{where} --help`)")
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
