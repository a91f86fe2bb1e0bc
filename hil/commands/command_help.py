"""The help of commands: examples, the names that may be given, and what is expected of numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

import click

from hil.commands.examples import EXAMPLES
from hil.scenario.checked_toml import meant

_WIDTH = 76


def explain(command: click.Command, path: str) -> None:
    """Add to the help of a command what stands in other places; ``path``: its words, ``abreast run`` say."""
    for param in command.params:
        words = getattr(param.type, "words", "")
        if isinstance(param, click.Option) and words and words not in (param.help or ""):
            param.help = f"{param.help or ''} [{words}]".strip()
    names = names_text({param.name for param in command.params})
    examples = EXAMPLES.get(path.removeprefix("abreast "), ())
    parts = [names, "\n".join(["Examples:", *(f"  {each}" for each in examples)]) if examples else ""]
    # Click wraps paragraphs but those that begin with \b.
    command.epilog = "\n\n".join(f"\b\n{part}" for part in parts if part) or None


def names_text(params: Iterable[str]) -> str:
    """Names that parameters take, as far as these are among them: scenarios, laws, estimators, sweeps."""
    from hil.scenario.checked_toml import shipped_names
    from hil.scenario.files import scenario_names
    from hil.scenario.schema import ESTIMATOR_NAMES, LAW_NAMES

    known = {
        "scenario": ("Scenarios", scenario_names(), "or a TOML file"),
        "spec": ("Sweeps", shipped_names("sweeps"), "or a TOML file"),
        "estimator": ("Estimators", ESTIMATOR_NAMES, "or file.py:factory"),
        "estimators": ("Estimators", ESTIMATOR_NAMES, "or file.py:factory"),
        "law": ("Laws", LAW_NAMES, "or file.py:function"),
    }
    asked = {*params}
    return "\n".join(
        textwrap.fill(
            f"{', '.join(names)}, {others}",
            _WIDTH,
            initial_indent=f"{title + ':':12}",
            subsequent_indent=" " * 12,
        )
        for param, (title, names, others) in known.items()
        if param in asked
    )


def usage_mistake(error: click.UsageError) -> str:
    """What is wrong with what was given, in words."""
    if isinstance(error, click.NoSuchOption) and error.ctx is not None:
        known = [each for param in error.ctx.command.get_params(error.ctx) for each in param.opts]
        return f"{error.option_name} is no option{meant(error.option_name, known)}"
    message = error.format_message().rstrip(".")
    if isinstance(error, click.BadParameter) and error.param is not None and error.message:
        param = error.param
        name = param.opts[0] if isinstance(param, click.Option) else param.human_readable_name
        between = " " if error.message.startswith("is ") else ": "
        message = f"{name}{between}{error.message.rstrip('.')}"
    return message
