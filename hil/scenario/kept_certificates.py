"""Certificates that were worked out before, kept where compiled code is: one takes many seconds.

The name of each is a hash of all that it starts from and of the code that works it out.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from estimation.bounds.assumptions import Assumptions
    from estimation.bounds.certificate import Certificate

_MOST = 200
_CODE = "estimation.bounds.certificate"


def kept_certificate(given: Assumptions) -> Certificate:
    """What :func:`estimation.bounds.certificate.certify` gives, worked out once by a version of its code."""
    from estimation.bounds.certificate import certify

    place = _place(given)
    if place is None:
        return certify(given)
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        return _certificate(json.loads(place.read_text(encoding="utf-8")))
    found = certify(given)
    # Whatever keeps it from being kept, it is there.
    with contextlib.suppress(OSError):
        _keep(place, found)
    return found


def _place(given: Assumptions) -> Path | None:
    from formation.compile_cache import cache_folder, stamp_of

    folder = cache_folder()
    if folder is None:
        return None
    digest = hashlib.blake2b(f"{stamp_of(_CODE)} {given!r}".encode(), digest_size=16).hexdigest()
    return folder / f"certificate-{digest}.json"


def _certificate(told: dict[str, Any]) -> Certificate:
    from estimation.bounds.certificate import Certificate
    from estimation.bounds.formation_claims import Claim

    claims = {
        name: Claim(each["figures"], tuple(each["assumes"]), each["why"])
        for name, each in told["claims"].items()
    }
    return Certificate(velocity_error=told["velocity_error"], **claims)


def _keep(place: Path, found: Certificate) -> None:
    claims = {
        name: {"figures": claim.figures, "assumes": claim.assumes, "why": claim.why}
        for name, claim in found.claims().items()
    }
    text = json.dumps({"velocity_error": found.velocity_error, "claims": claims})
    # Others may look meanwhile: it is whole or not there.
    descriptor, part = tempfile.mkstemp(prefix="certificate-", suffix=".json.part", dir=place.parent)
    try:
        with os.fdopen(descriptor, "w") as file:
            file.write(text)
        os.replace(part, place)
    except OSError:
        os.unlink(part)
        raise
    kept = sorted(place.parent.glob("certificate-*"), key=lambda each: each.stat().st_mtime)
    for old in kept[:-_MOST]:
        old.unlink(missing_ok=True)
