"""Estimators of one's own, by reference."""

from __future__ import annotations

from estimation.filters.belief import Model
from estimation.filters.estimator import Estimator
from hil.errors import UsageError
from hil.extensions.reference import found, loaded

GROUP = "abreast.estimators"
"""Entry points by which packages bring estimators."""
NOUN = "estimator.kind"

_NEEDED = ("start", "predict", "update", "step")


def own_estimator(text: str, model: Model) -> Estimator:
    """Estimator that the factory of a settled reference makes of a model.

    Raises :class:`UsageError` as :func:`hil.extensions.reference.found` and
    :func:`~hil.extensions.reference.loaded`, or if the factory makes none.
    """
    factory = loaded(found(text, NOUN))
    try:
        made = factory(model)
    except Exception as error:  # whatever somebody's factory may raise
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        raise UsageError(f"{NOUN} {text}: its factory failed ({what}); correct it") from None
    missing = [name for name in _NEEDED if not callable(getattr(made, name, None))]
    if missing:
        raise UsageError(
            f"{NOUN} {text}: its factory gave {type(made).__name__}, expected an Estimator; "
            f"it lacks {', '.join(missing)}: derive it from abreast.Estimator"
        )
    if getattr(made, "model", None) is None:
        made.model = model
    return made  # type: ignore[no-any-return]
