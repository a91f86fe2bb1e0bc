"""Every name of code in the docs and in docstrings is one: files, options, keys, tests, modules, names."""

from __future__ import annotations

import ast
import builtins
import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import click
import pytest
from msgspec import Struct
from msgspec.structs import fields

from hil.command_line import abreast
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire.topics import LOG
from tests.docs.pages import MADE, PAGES, ROOT, Block, blocks, code_in, options_of, prose

PACKAGES = ("formation", "controllers", "estimation", "hil", "abreast")
FOLDERS = (*PACKAGES, "tests", "benchmarks", "scripts", "data", "packaging", "docs", "examples", "ros")
TEXTS = [page for page in [*PAGES, ROOT / "CHANGELOG.md"] if page != MADE]
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))

TOPICS = {LOG, "abreast/rigid_bodies"}
"""What looks like a path, and is the name of a topic."""

ERRORS = ROOT / "hil" / "errors.py"
"""Errors, which are called by their name everywhere."""

GROUPS = {"abreast.laws", "abreast.estimators"}
"""Entry points, by which packages of others give names to laws and estimators."""

OTHERS = {"SceneUpdate", "enable_stamped_cmd_vel", "rmw_zenoh_cpp", "rmw_zenohd"}
"""Names of other people's programs, messages and parameters."""

JOINED = {"mount.leader_x_mm"}
"""Names that code puts together."""


@cache
def sources() -> str:
    """All code, and what else names things: messages, scenarios, maps, scripts, units."""
    kinds = ("*.py", "*.msg", "*.toml", "*.service", "*.cfg", "*.json5")
    found = [path for folder in FOLDERS for kind in kinds for path in sorted((ROOT / folder).rglob(kind))]
    found += [path for path in sorted((ROOT / "scripts").iterdir()) if path.is_file()]
    found += [ROOT / "pyproject.toml"]
    mine = Path(__file__)
    return "\n".join(path.read_text(encoding="utf-8") for path in found if path != mine)


@cache
def words() -> frozenset[str]:
    return frozenset(re.findall(r"\w+", sources()))


@cache
def options() -> set[str]:
    """Options of all commands, and what scripts and benchmarks take."""
    found = set(re.findall(r"--[a-z][a-z-]*", sources()))

    def below(group: click.Group, context: click.Context) -> None:
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            assert command is not None
            inner = click.Context(command, info_name=name, parent=context)
            found.update(options_of(inner))
            if isinstance(command, click.Group):
                below(command, inner)

    below(abreast, click.Context(abreast))
    return found


@cache
def keys() -> dict[str, set[str]]:
    """Keys of a scenario by section."""
    found: dict[str, set[str]] = {}
    for part in fields(Scenario):
        for kind in (part.type, *getattr(part.type, "__args__", ())):
            if isinstance(kind, type) and issubclass(kind, Struct):
                found[part.name] = {key.name for key in fields(kind)}
    return found


@cache
def saved() -> set[str]:
    """Files that pages tell their reader to save, and the examples of references."""
    return {block.file for page in PAGES for block in blocks(page)} | {"file.py"}


@cache
def summary_keys() -> set[str]:
    """Keys of a summary, which tests/docs/test_reference_pages.py holds to what there is."""
    page = (ROOT / "docs" / "summary.md").read_text(encoding="utf-8")
    return set(re.findall(r"`(\w+\.[\w.]+)`", page))


def wrong_path(code: str) -> str:
    """What is wrong with a path below this folder; empty if nothing is, or if it is none."""
    head = code.split()[0]
    if (
        head.partition("/")[0] not in FOLDERS
        or "/" not in head
        or head in TOPICS
        or re.search(r"[<{*]", head)
    ):
        return ""
    path, _, name = head.partition("::")
    place = ROOT / path.rstrip(":,")
    if not place.exists():
        return f"{path} is not there"
    return f"{path} has no {name}" if name and f"def {name}(" not in place.read_text(encoding="utf-8") else ""


def wrong_option(code: str) -> str:
    option = re.match(r"--[a-z][a-z-]*", code)
    return f"{option[0]} is no option" if option and option[0] not in options() else ""


def wrong_dotted(code: str) -> str:
    """What is wrong with a key of a scenario, a name of a module, or a file's."""
    dotted = re.match(r"([A-Za-z_]\w*)((?:\.[A-Za-z_]\w*)+)(?![\w/(])", code)
    if not dotted or dotted[0] in GROUPS:
        return ""
    first, parts = dotted[1], dotted[2][1:].split(".")
    if parts[-1] in ("py", "msg", "ipynb"):
        name = dotted[0]
        return "" if name in saved() or any(ROOT.glob(f"[!.]*/**/{name}")) else f"{name} is not there"
    if dotted[0] in JOINED or any(key.startswith(dotted[0]) for key in summary_keys()):
        return ""
    if (first in PACKAGES and len(parts) > 1) or first == "abreast":
        return "" if resolved(dotted[0], "") else f"{dotted[0]} is not there"
    if first in keys() and parts[0] in keys()[first]:
        return ""
    strange = [part for part in parts if not part.isupper() and part not in words()]
    return f"{dotted[0]}: nothing is called {strange[0]}" if strange else ""


def wrong_word(code: str) -> str:
    """That nothing has this name: one with an underscore, or with capitals within."""
    name = re.fullmatch(r"(\w+)(?:\(.*\))?", code)
    plain = not name or not re.search(r"[a-z0-9]_[a-z]|[a-z][A-Z]", name[1])
    if name is None or plain or name[1] in words():
        return ""
    return f"nothing is called {name[1]}"


@pytest.mark.parametrize("page", TEXTS, ids=[page.name for page in TEXTS])
def test_every_name_of_a_page_is_one(page: Path) -> None:
    wrong = {
        f"`{code}`: {what}"
        for code in code_in(prose(page))
        if code and code.split()[0] not in OTHERS
        for check in (wrong_path, wrong_option, wrong_dotted, wrong_word)
        if (what := check(code))
    }
    assert not wrong, "\n".join(sorted(wrong))


@cache
def named_in(module: Path) -> dict[str, set[str]]:
    """All names that a module defines or imports, with those that its classes define."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    found: dict[str, set[str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            found.setdefault(node.name, set()).update(_members(node))
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            found.setdefault(node.name, set())
        elif isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                found.setdefault((alias.asname or alias.name).partition(".")[0], set())
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.setdefault(node.id, set())
    return found


def _members(node: ast.ClassDef) -> set[str]:
    stored = {
        each.attr if isinstance(each, ast.Attribute) else each.id
        for each in ast.walk(node)
        if isinstance(each, ast.Attribute | ast.Name) and isinstance(each.ctx, ast.Store)
    }
    return stored | {each.name for each in node.body if isinstance(each, ast.FunctionDef | ast.ClassDef)}


def module_of(dotted: str) -> tuple[Path | None, list[str]]:
    """The module with which a dotted name begins, and what is left of the name."""
    parts = dotted.split(".")
    for n in range(len(parts), 0, -1):
        base = ROOT.joinpath(*parts[:n])
        for path in (base.with_suffix(".py"), base / "__init__.py"):
            if path.exists():
                return path, parts[n:]
    return None, parts


def resolved(name: str, role: str, here: Path | None = None) -> bool:
    """Whether a name is one: dotted from a package on, or as a module ``here`` sees it."""
    if name.startswith("."):
        ends = name[1:].split(".")
        return any(ends[-1] in named_in(module) for module in MODULES if module.stem == ends[0])
    if name.split(".")[0] in sys.stdlib_module_names or name in named_in(ERRORS):
        return True
    module, rest = module_of(name) if name.split(".")[0] in PACKAGES else (here, name.split("."))
    if not rest:
        return True
    if module is None or role == "mod":
        return False
    known = named_in(module)
    if len(rest) == 1:
        return rest[0] in {*known, *dir(builtins)}.union(*known.values())
    if rest[0] in known and not known[rest[0]]:
        return rest[-1] in words()
    return rest[0] in known and rest[1] in known[rest[0]]


def docstrings(module: Path) -> list[str]:
    """Docstrings of a module, and strings that stand by themselves below a name."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    return [
        node.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ]


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("module", MODULES, ids=named)
def test_every_name_of_a_docstring_is_one(module: Path) -> None:
    wrong = set()
    for text in docstrings(module):
        for role, name in re.findall(r":(mod|class|func|meth|data|attr|exc):`~?([\w.]+)`", text):
            if not resolved(name, role, module):
                wrong.add(f":{role}:`{name}`")
        for code in re.findall(r"``([^`]+)``", text):
            if what := wrong_path(code) or wrong_option(code):
                wrong.add(f"``{code}``: {what}")
    assert not wrong, sorted(wrong)


def test_every_page_that_the_code_names_is_there() -> None:
    pages = {page.name for page in (ROOT / "docs").glob("*.md")}
    named_pages = set(re.findall(r"docs/(\w+\.md)", sources()))
    assert named_pages
    assert named_pages <= pages


@pytest.mark.parametrize(
    ("check", "right", "wrong"),
    [
        (wrong_path, "hil/wire/topics.py", "hil/wire/themes.py"),
        (wrong_path, "tests/bits.py", "tests/bits.py::test_nothing"),
        (wrong_option, "--lockstep", "--no-such-option"),
        (wrong_dotted, "estimator.own_motion", "estimator.no_such_key"),
        (wrong_dotted, "hil.wire.topics.Topics", "hil.wire.topics.Themes"),
        (wrong_dotted, "topics.py", "themes_of_old.py"),
        (wrong_word, "topics_of", "themes" + "_of"),
        (wrong_word, "LogReplay", "Log" + "Display"),
    ],
)
def test_a_name_that_is_not_there_is_found(check: Callable[[str], str], right: str, wrong: str) -> None:
    assert check(right) == ""
    assert check(wrong)


TOML = [
    block
    for page in PAGES
    for block in blocks(page)
    if block.language == "toml" and "[columns]" not in block.text
]


@pytest.mark.parametrize("block", TOML, ids=[f"{block.page.name}:{block.line}" for block in TOML])
def test_a_part_of_a_scenario_that_a_page_shows_is_one(block: Block, tmp_path: Path) -> None:
    path = tmp_path / "shown.toml"
    base = "" if "base =" in block.text else 'base = "turtlebot3"\n'
    path.write_text(base + block.text, encoding="utf-8")
    assert load_scenario(str(path)).name
