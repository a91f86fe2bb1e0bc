"""What all sections of a scenario are made of: kinds of values, and the base of a section."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0.0)]
Rate = Annotated[float, Meta(ge=0.01, le=10_000.0)]
NonNegative = Annotated[float, Meta(ge=0.0)]
Span = Annotated[float, Meta(ge=0.0, le=1e5)]
Probability = Annotated[float, Meta(ge=0.0, lt=1.0)]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
BodyName = Annotated[str, Meta(min_length=1, max_length=200)] | Annotated[int, Meta(ge=0)]
Namespace = Annotated[str, Meta(pattern=r"^([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")]
PoseTriple = tuple[float, float, float]
Offset = Annotated[float, Meta(ge=-2.0, le=2.0)]
Yaw = Annotated[float, Meta(ge=-math.pi, le=math.pi)]
MountTriple = tuple[Offset, Offset, Yaw]


class Section(Struct, frozen=True, forbid_unknown_fields=True):
    """Base of all sections: immutable, and an unknown key is an error."""
