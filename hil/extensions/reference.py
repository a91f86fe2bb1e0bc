"""References to what others wrote: ``file.py:name``, ``package.module:name``, or the name of an entry point.

A reference is found, and its source digested, without importing anything, so that a log's own law can be
told from another one of its name before a line of it runs.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.machinery
import importlib.util
import inspect
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from hil.errors import UsageError

_DIGITS = 16
_NAMES = 12
"""How many names of a module to tell of."""


@dataclass(frozen=True, slots=True)
class Found:
    """A reference whose source was found: its ``text``, its kind as errors call it, and where it is.

    ``path``: its file, None for one that was brought by a program. ``module``, ``name``: within Python.
    """

    text: str
    noun: str
    path: Path | None
    module: str
    name: str

    def digest(self) -> str:
        """What tells its source from any other: of the file alone, not of what that imports."""
        try:
            source = _BROUGHT[self.text].source if self.path is None else self.path.read_bytes()
        except OSError as error:
            raise UsageError(
                f"{self.noun} {self.text}: {self.path} cannot be read ({error.strerror})"
            ) from None
        return hashlib.sha256(source).hexdigest()[:_DIGITS]


@dataclass(frozen=True, slots=True)
class _Brought:
    function: Callable[..., Any]
    source: bytes


_BROUGHT: dict[str, _Brought] = {}
_BROUGHT_FROM_FILES: dict[str, _Brought] = {}
"""Functions of files that are not run again for them while they stay as they are: of a script, say."""


def brought(function: Callable[..., Any]) -> str:
    """Reference to a function that a program or a notebook has at hand; it is good in this process alone.

    One that can be found in a file or a module by its name is referred to by that, for other processes too.
    """
    name = getattr(function, "__qualname__", type(function).__name__)
    module = sys.modules.get(getattr(function, "__module__", None) or "")
    file = getattr(module, "__file__", None)
    if file and file.endswith(".py") and getattr(module, name, None) is function:
        text = f"{Path(file).absolute()}:{name}"
        with contextlib.suppress(OSError):
            _BROUGHT_FROM_FILES[text] = _Brought(function, Path(file).read_bytes())
        return text
    try:
        source = inspect.getsource(function).encode()
    except (OSError, TypeError):
        source = repr(function).encode()
    text = f"program:{name.rpartition('.')[2].strip('<>')}"
    _BROUGHT[text] = _Brought(function, source)
    return text


def is_reference(text: str) -> bool:
    """Whether a text is a reference, not the name of something that abreast has."""
    return ":" in text


def short(text: str) -> str:
    """A reference without the folders of its file."""
    place, _, name = text.rpartition(":")
    return f"{Path(place).name}:{name}" if _is_file(place) else text


def told(error: BaseException) -> str:
    """What somebody's code raised, in one line: its kind, and the first line of what it says, if any."""
    says = str(error).splitlines()[:1]
    return ": ".join([type(error).__name__, *says])


def settled(text: str, noun: str, group: str, folder: Path) -> str:
    """Reference that means the same anywhere: absolute path of a file, ``module:name`` of an entry point.

    Any other text stays as it is. ``folder``: from where the paths of files count. Raises
    :class:`UsageError` for a reference without a name behind its colon.
    """
    if not is_reference(text):
        # A fiftieth of a second, for those who ask for an entry point.
        import importlib.metadata

        points = importlib.metadata.entry_points(group=group, name=text)
        return next((point.value for point in points), text)
    place, _, name = text.rpartition(":")
    if not (place and name.isidentifier()):
        raise UsageError(f"{noun} {text!r}: expected file.py:name or package.module:name")
    return f"{(folder / Path(place).expanduser()).absolute()}:{name}" if _is_file(place) else text


def found(text: str, noun: str) -> Found:
    """Where a settled reference leads. Raises :class:`UsageError` if there is no such file or module."""
    place, _, name = text.rpartition(":")
    if text in _BROUGHT:
        return Found(text, noun, None, place, name)
    if _is_file(place):
        path = Path(place)
        if not path.is_file():
            raise UsageError(f"{noun} {text}: there is no file {path}; give the path of one that is there")
        return Found(text, noun, path, _module_name(place, path), name)
    path_of_module = _module_file(place)
    if path_of_module is None:
        raise UsageError(
            f"{noun} {text}: there is no module {place}; install its package, or give file.py:name"
        )
    return Found(text, noun, path_of_module, place, name)


def loaded(reference: Found) -> Any:
    """What a reference names: its file is run, or its module imported.

    Raises :class:`UsageError` in one line if that fails, or there is nothing of that name that can be called.
    """
    if reference.path is None:
        return _BROUGHT[reference.text].function
    at_hand = _BROUGHT_FROM_FILES.get(reference.text)
    if at_hand is not None and hashlib.sha256(at_hand.source).hexdigest()[:_DIGITS] == reference.digest():
        return at_hand.function
    noun = reference.noun
    try:
        module = _module_of(reference)
        thing = getattr(module, reference.name, None)
    except (Exception, SystemExit) as error:  # whatever somebody's file may raise
        raise UsageError(
            f"{noun} {reference.text}: cannot be loaded ({told(error)}); correct the file"
        ) from None
    if not callable(thing):
        names = [name for name in vars(module) if not name.startswith("_")]
        there = ", ".join([*names[:_NAMES], *(["..."] if names[_NAMES:] else [])]) or "nothing"
        what = "nothing" if thing is None else f"no function but {type(thing).__name__}"
        raise UsageError(f"{noun} {reference.text}: {reference.name} is {what} there; names in it: {there}")
    return thing


def _module_name(place: str, path: Path) -> str:
    """Name for the module of a file as it is now: one that was edited since is another."""
    try:
        source = path.read_bytes()
    except OSError:
        source = b""  # told by who loads it
    return f"_abreast_{hashlib.sha256(place.encode() + source).hexdigest()[:_DIGITS]}"


def _module_of(reference: Found) -> ModuleType:
    if reference.path is None or not _is_file(reference.text.rpartition(":")[0]):
        return importlib.import_module(reference.module)
    if reference.module in sys.modules:
        return sys.modules[reference.module]
    spec = importlib.util.spec_from_file_location(reference.module, reference.path)
    if spec is None or spec.loader is None:
        raise ImportError("is no Python file")
    module = importlib.util.module_from_spec(spec)
    # Its neighbours are found as they are for a script, and it itself by whoever pickles what it defines.
    folder = str(reference.path.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    sys.modules[reference.module] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[reference.module]
        raise
    return module


def _is_file(place: str) -> bool:
    return place.endswith(".py")


def _spec(name: str, path: Sequence[str] | None) -> importlib.machinery.ModuleSpec | None:
    """What Python would import by a name, by whoever finds it: packages may be installed to be edited."""
    found = (finder.find_spec(name, path) for finder in sys.meta_path if hasattr(finder, "find_spec"))
    return next((spec for spec in found if spec is not None), None)


def _module_file(name: str) -> Path | None:
    """File of a module, by looking along the path without importing its packages."""
    path = None
    for k, _ in enumerate(parts := name.split("."), 1):
        spec = _spec(".".join(parts[:k]), path)
        if spec is None:
            return None
        path = spec.submodule_search_locations
    return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None
