"""Where compiled entries are kept, and the stamp by which an old one is told from a new one.

The stamp of an entry is a hash of every file that its module imports from this project, directly or not: an
edit anywhere below it recompiles, an edit elsewhere does not.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import os
import pickle
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys

_ROOT = Path(__file__).resolve().parent.parent
_HOUSE = "formation|controllers|estimation|hil|abreast"
_IMPORTS = re.compile(rf"^[ \t]*from ((?:{_HOUSE})[\w.]*) import (?:\(([^)]*)\)|([^\n]*))", re.MULTILINE)
_PLAIN_IMPORTS = re.compile(rf"^[ \t]*import ((?:{_HOUSE})[\w.]*)", re.MULTILINE)
_COMPILERS = (
    "formation.compiler",
    "formation.compiled_calls",
    "formation.compiled_records",
    "formation.kernel_linking",
    __name__,
)


@functools.cache
def cache_folder() -> Path | None:
    """First place that can be written to and is the user's own; None without one: every process compiles."""
    for place in _places():
        with contextlib.suppress(OSError):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            if place.stat().st_uid == os.getuid():
                with tempfile.TemporaryFile(dir=place):
                    return place
    return None


def _places() -> Iterator[Path]:
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(given)
    yield Path(__file__).resolve().parent / "__pycache__"
    with contextlib.suppress(RuntimeError):
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "abreast"
    yield Path(tempfile.gettempdir()) / f"abreast-{os.getuid()}"


@contextlib.contextmanager
def one_at_a_time(module: str) -> Iterator[None]:
    """Among all processes that share a cache: who comes second finds what the first compiled of a module."""
    folder = cache_folder()
    if folder is None:
        yield
        return
    with (folder / f"{module}.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def cache_of(function: Callable[..., Any]) -> Any:
    """Cache of a function's compiled form; None where there is no place for one."""
    return None if cache_folder() is None else _Cache(function)


def stamp_of(module: str) -> str:
    """Hash of a module's file and of all that it imports from this project, directly or not."""
    waiting, seen = [module, *_COMPILERS], set[str]()
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += _imports_of(name)
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(seen):
        digest.update(f"{name} {_hash_of(name)}\n".encode())
    return digest.hexdigest()


def _path_of(module: str) -> Path | None:
    path = _ROOT.joinpath(*module.split("."))
    for found in (path.with_suffix(".py"), path / "__init__.py"):
        if found.is_file():
            return found
    loaded = getattr(sys.modules.get(module), "__file__", None)
    return Path(loaded) if loaded else None


@functools.cache
def _text_of(module: str) -> str:
    path = _path_of(module)
    return path.read_text(encoding="utf-8") if path else ""


@functools.cache
def _hash_of(module: str) -> str:
    return hashlib.blake2b(_text_of(module).encode(), digest_size=16).hexdigest()


@functools.cache
def _imports_of(module: str) -> tuple[str, ...]:
    """Modules of this project that a module imports anywhere in it."""
    text = _text_of(module)
    found = set(_PLAIN_IMPORTS.findall(text))
    for source, several, one in _IMPORTS.findall(text):
        found.add(source)
        names = re.findall(r"\w+", several or one)
        found |= {
            f"{source}.{name}" for name in names if _ROOT.joinpath(*source.split("."), f"{name}.py").is_file()
        }
    return tuple(sorted(found))


class _Locator(caching._CacheLocator):
    def __init__(self, function: Any, file: str) -> None:
        self._module = function.__module__

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return stamp_of(self._module)

    def get_disambiguator(self) -> str:
        return hashlib.blake2b(f"{self._module} {_path_of(self._module)}".encode(), digest_size=4).hexdigest()

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        return cls(function, file)


class _LoadedLibrary(JITCodeLibrary):
    """Machine code of an entry out of the cache, without the bitcode that only who links it would need."""

    @classmethod
    def of(cls, codegen: Any, name: str, machine_code: bytes) -> _LoadedLibrary:
        """Library that is ready to run, under the name that it had where it was compiled."""
        library = cls(codegen, name)
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """As numba does it, but for the bitcode, which takes longest to read: nobody links an entry."""
        (name, _, (machine_code, _)), description, *rest = payload
        codegen = target_context.codegen()
        library = _LoadedLibrary.of(codegen, name, machine_code)
        codegen._engine._defined_symbols.add(description.llvm_cpython_wrapper_name)
        codegen.unserialize_library = lambda loaded: loaded
        try:
            return CompileResult._rebuild(target_context, library, description, *rest)
        finally:
            del codegen.unserialize_library


class _Cache(caching.FunctionCache):
    _impl_class = _CacheImpl

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """As numba does it, but without all that it teaches itself before it compiles: half a second."""
        rtsys.initialize(target_context)
        try:
            return self._load_overload(signature, target_context)
        except (AttributeError, ImportError, TypeError, EOFError, pickle.UnpicklingError):
            # It names what is gone by now, a record that was renamed say, or was torn: as if there were none.
            self.flush()
            return None
