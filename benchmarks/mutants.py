"""How strong the tests of a module are: the share of its mutants that they notice.

    scripts/mutants estimation/bounds/certificate.py [more modules] [--sample 40 --seed 1] [--least 0.8]
                    [--tests FILE ...] [--also FILE ...] [--list] [--interpreted] [--jobs N]

Each mutant (see :mod:`benchmarks.mutations`) runs in a copy of the checkout, first against the module's own
tests, ``tests/<its path>/test_<its name>.py`` or all tests of that folder where there is no such file, then
against one further file that runs the module among others. It is killed when a test fails, or takes far
longer than without the change. Survivors are printed with their diff; some change nothing that can be seen.

Exits with 1 if a module's share is below ``--least``, with 2 if its tests fail without any change.
``--interpreted`` runs kernels without the compiler, quicker where tests are small.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.mutations import Mutant, mutants

ROOT = Path(__file__).resolve().parent.parent

FURTHER = {
    "formation": "test_laws.py",
    "controllers": "test_controller.py",
    "estimation": "test_estimator.py",
    "hil": "test_rerun.py",
}
"""Per package, the test file that runs its modules among others; looked for wherever it lies."""

HEAVY = ["numpy", "numba", "scipy.optimize", "hypothesis", "msgspec", "pytest", "rosbags.typesys"]
"""What most tests import; done once, and not for every mutant."""

PATIENCE, SHORTEST_S = 4.0, 20.0
LARGEST_BYTES = 6 << 30
"""Memory of a mutant: one that never ends must not take all."""
_QUIET = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # for what is imported beforehand

_forks = multiprocessing.get_context("forkserver")


@dataclass(frozen=True)
class Score:
    """What became of the mutants of a module."""

    module: str
    survivors: tuple[Mutant, ...]
    count: int

    @property
    def share(self) -> float:
        """Share of the mutants that were killed."""
        return 1.0 - len(self.survivors) / self.count if self.count else 1.0


class Copies:
    """Copies of the checkout for several mutants at a time, and how long the tests may take in them."""

    def __init__(self, folder: Path, count: int) -> None:
        self._free: SimpleQueue[Path] = SimpleQueue()
        for number in range(count):
            tree = folder / f"tree{number}"
            _copy(tree)
            self._free.put(tree)

    def killer(self, module: str, text: str, files: Sequence[str], limits: Sequence[float]) -> str | None:
        """First of the test files that fails on a module's text; None if all pass."""
        tree = self._free.get()
        target = tree / module
        before = target.read_text(encoding="utf-8")
        try:
            _put(target, text)
            for file, limit in zip(files, limits, strict=True):
                if _tests_fail(tree, file, limit):
                    return file
            return None
        finally:
            _put(target, before)
            self._free.put(tree)


def own_tests(module: str) -> list[str]:
    """The tests of a module by the rule that they mirror it."""
    path = Path(module)
    mirrored = Path("tests") / path.parent / f"test_{path.stem}.py"
    return [str(mirrored if (ROOT / mirrored).is_file() else mirrored.parent)]


def further_tests(module: str) -> list[str]:
    """The file of :data:`FURTHER` for a module."""
    name = FURTHER[Path(module).parts[0]]
    return [str(path.relative_to(ROOT)) for path in sorted((ROOT / "tests").rglob(name))[:1]]


def score(module: str, chosen: Sequence[Mutant], files: Sequence[str], copies: Copies, jobs: int) -> Score:
    """Run the tests against all chosen mutants. Exits the program if they fail without any."""
    text = (ROOT / module).read_text(encoding="utf-8")
    limits = []
    for file in files:
        begun = time.monotonic()
        if copies.killer(module, text, [file], [3600.0]) is not None:
            print(f"{module}: {file} fails without any change; mend that first", file=sys.stderr)
            sys.exit(2)
        limits.append(max(SHORTEST_S, PATIENCE * (time.monotonic() - begun)))
    with ThreadPoolExecutor(jobs) as pool:
        killers = list(pool.map(lambda each: copies.killer(module, each.text, files, limits), chosen))
    survivors = tuple(each for each, killer in zip(chosen, killers, strict=True) if killer is None)
    return Score(module, survivors, len(chosen))


def main() -> int:
    arguments = _arguments()
    modules = [
        each.replace(".", "/") + ".py" if not each.endswith(".py") else each for each in arguments.module
    ]
    if arguments.interpreted:
        os.environ["ABREAST_INTERPRETED"] = "1"
    _forks.set_forkserver_preload(HEAVY)
    scores = []
    with tempfile.TemporaryDirectory(prefix="mutants") as folder:
        copies = None if arguments.list else Copies(Path(folder), arguments.jobs)
        for module in modules:
            chosen = _chosen(mutants((ROOT / module).read_text(encoding="utf-8")), arguments)
            if copies is None:
                _show(module, chosen)
                continue
            files = [*(arguments.tests or own_tests(module)), *(arguments.also or further_tests(module))]
            scores.append(score(module, chosen, list(dict.fromkeys(files)), copies, arguments.jobs))
            _show(module, scores[-1].survivors)
            print(f"{module}: {_figures(scores[-1:])}", flush=True)
    if len(scores) > 1:
        print(f"all: {_figures(scores)}")
    return int(any(each.share < arguments.least for each in scores))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Share of a module's mutants that its tests notice.")
    parser.add_argument("module", nargs="+", help="path or dotted name")
    parser.add_argument("--sample", type=int, help="so many mutants of each module, drawn at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--least", type=float, default=0.8, help="share that each module must reach")
    parser.add_argument("--tests", nargs="+", help="instead of the module's own tests")
    parser.add_argument("--also", nargs="+", help="instead of the package's further test file")
    parser.add_argument("--list", action="store_true", help="show the mutants and run nothing")
    parser.add_argument("--interpreted", action="store_true", help="run kernels without the compiler")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    return parser.parse_args()


def _chosen(of: Sequence[Mutant], arguments: argparse.Namespace) -> list[Mutant]:
    if arguments.sample is None or arguments.sample >= len(of):
        return list(of)
    drawn = random.Random(arguments.seed).sample(range(len(of)), arguments.sample)
    return [of[place] for place in sorted(drawn)]


def _show(module: str, those: Iterable[Mutant]) -> None:
    for each in those:
        print(f"{module}:{each.line} {each.kind}")
        for line in each.diff:
            print(f"    {line}")


def _figures(scores: Sequence[Score]) -> str:
    count, alive = sum(each.count for each in scores), sum(len(each.survivors) for each in scores)
    return f"{count - alive} of {count} killed, {1.0 - alive / max(count, 1):.2f}"


def _copy(tree: Path) -> None:
    """What is under version control or would be, as it stands in the checkout."""
    for name in _listed():
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)


def _listed() -> Iterator[str]:
    command = ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    yield from filter(
        None, subprocess.run(command, check=True, capture_output=True).stdout.decode().split("\0")
    )


def _put(target: Path, text: str) -> None:
    """Write a module so that no cache takes it for another of its texts, which may have the same length."""
    target.write_text(text, encoding="utf-8")
    stamp = time.time_ns()
    os.utime(target, ns=(stamp, stamp))
    for stale in (target.parent / "__pycache__").glob(f"{target.stem}.*"):
        stale.unlink(missing_ok=True)


def _tests_fail(tree: Path, file: str, limit: float) -> bool:
    """Whether a test fails, or all of them are not through within a limit [s]."""
    child = _forks.Process(target=_run_tests, args=(str(tree), file))
    child.start()
    child.join(limit)
    late = child.is_alive()
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid or 0, signal.SIGKILL)
    child.join()
    return late or child.exitcode != 0


def _run_tests(tree: str, file: str) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (LARGEST_BYTES, LARGEST_BYTES))
    os.chdir(tree)
    sys.path[:] = [tree, *(path for path in sys.path if path != str(ROOT))]
    os.environ["PYTHONPATH"] = tree
    for name in [name for name in sys.modules if name.partition(".")[0] == "benchmarks"]:
        del sys.modules[name]
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(nowhere, number)
    import pytest

    sys.exit(int(pytest.main(["-x", "-n0", "-p", "no:cacheprovider", *_QUIET, "--rootdir", tree, file])))


if __name__ == "__main__":
    sys.exit(main())
