"""Every command of the docs is one: its options are read, and where no lab is needed it is run."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.command_line import COMMANDS, abreast
from hil.wire.session import reserved_endpoint
from tests.docs.pages import MADE, PAGES, Block, blocks, code_in, command_of, options_of, prose, words_of
from tests.docs.supposed import lay_out, record

ROUTER = "tcp/127.0.0.1:7447"
LAB = re.compile(r"(tcp|tls|tcp:/)/(192\.0\.2|0\.0\.0\.0)|--server 192|--real|--drive")
"""What needs a lab: robots, machines and cameras that are not here."""

ALONE = {"run", "soak", "faults"}
"""Of the commands that can join a router those that need none."""

SHORTER = {
    "run": "--duration 6 --set run.evaluate_from_s=3",
    "sweep": "--runs 1 --duration 1 --workers 1",
    "soak": "--duration 8",
    "faults": "--tries 1",
    "status": "--once",
}
"""Said after what a page says, so that a test ends; lockstep and what else is quick is run as it stands."""

ALL = [block for page in PAGES for block in blocks(page) if page != MADE]
LINES = [(block, line) for block in ALL for line in block.commands]
INLINE = [
    (page, code)
    for page in PAGES
    if page != MADE
    for line in code_in(prose(page))
    for code in line.split(" && ")
    if re.match(r"abreast [a-z]", code)
]


def placed(block: Block, line: str) -> str:
    return f"{block.page.name}:{block.line}:{line}"


@pytest.mark.parametrize(("block", "line"), LINES, ids=[placed(*each) for each in LINES])
def test_a_command_of_a_block_is_read(
    block: Block, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path)
    context, left = command_of(abreast, words_of(line))
    context.command.make_context(context.info_name, left, parent=context.parent)


@pytest.mark.parametrize(("page", "code"), INLINE, ids=[f"{page.name}:{code}" for page, code in INLINE])
def test_a_command_within_a_line_has_these_options(page: Path, code: str) -> None:
    context, left = command_of(abreast, re.findall(r"[^\s,]+", code)[1:])
    told = {word.partition("=")[0] for word in left if re.match(r"-[\w-]", word)}
    assert told <= options_of(context), code


def test_every_command_stands_in_the_docs() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES if page != MADE)
    for name in COMMANDS:
        assert re.search(rf"abreast {name}\b|`{name}`", text), name


def joins(line: str) -> bool:
    """Whether a command takes part in a lab that is there."""
    context, left = command_of(abreast, words_of(line))
    return "--connect" in options_of(context) and context.info_name not in ALONE and "--write" not in left


def runs(block: Block, line: str, *, in_lab: bool) -> bool:
    """Whether a line is run; ``in_lab``: while daemons of its page are."""
    return block.marker != "hardware" and not LAB.search(line) and (in_lab or not joins(line))


def runnable(block: Block) -> bool:
    return is_python(block) or any(runs(block, line, in_lab=False) for line in block.commands)


def is_python(block: Block) -> bool:
    return block.language == "python" and not block.file


def finite(line: str, router: str) -> str:
    """A line of a page that ends soon; in a lab on loopback, where there is a ``router``, that one's."""
    context, left = command_of(abreast, words_of(line))
    options, live = options_of(context), "--lockstep" not in left
    told = [line.replace(ROUTER, router) if router else line]
    if live and (more := SHORTER.get(context.info_name or "")):
        told.append(more)
    if router and "--connect" in options and not {"--connect", "--listen"} & set(left):
        told.append(f"--connect {router}")
    return " ".join(told)


def environment() -> dict[str, str]:
    """With ``abreast`` where a shell finds it."""
    return os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


class Lab:
    """Daemons of a page on this machine, which run until they are told to end."""

    def __init__(self, folder: Path, router: str) -> None:
        self.folder = folder
        self.router = router
        self.running: list[subprocess.Popen[str]] = []

    def begin(self, line: str) -> None:
        process = subprocess.Popen(
            ["bash", "-c", f"exec {finite(line, self.router)}"],
            cwd=self.folder,
            env=environment(),
            stderr=subprocess.PIPE,
            text=True,
        )
        self.running.append(process)
        assert process.stderr is not None
        assert ": ready, " in process.stderr.readline(), line

    def end(self) -> None:
        """As by Ctrl-C in the terminal of each, the router's last."""
        while self.running:
            process = self.running.pop()
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=60)[1]
            assert process.returncode == 0, said


@contextmanager
def lab(folder: Path) -> Iterator[Lab]:
    with reserved_endpoint() as router:
        started = Lab(folder, router)
        try:
            yield started
        finally:
            for process in started.running:
                process.kill()
                process.communicate()


PAGES_RUN = sorted({block.page for block in ALL if runnable(block)})


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES_RUN, ids=[page.name for page in PAGES_RUN])
def test_the_commands_of_a_page_run_in_their_order(page: Path, tmp_path: Path) -> None:
    lay_out(tmp_path)
    record(tmp_path)
    for block in blocks(page):
        if block.file:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    with lab(tmp_path) as started:
        for block in blocks(page):
            if block.marker == "end of daemons":
                started.end()
            if is_python(block):
                run_python(block, tmp_path)
            for line in block.commands:
                if block.marker == "daemons":
                    started.begin(line)
                elif runs(block, line, in_lab=bool(started.running)):
                    router = started.router if started.running else ""
                    run(finite(line, router), tmp_path, placed(block, line))


def run(line: str, folder: Path, where: str) -> None:
    ended(["bash", "-c", line], folder, f"{where}\n{line}")


def run_python(block: Block, folder: Path) -> None:
    ended([sys.executable, "-c", block.text], folder, f"{block.page.name}:{block.line}")


def ended(words: list[str], folder: Path, where: str) -> None:
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert done.returncode == 0, f"{where}\n{done.stdout}\n{done.stderr}"
