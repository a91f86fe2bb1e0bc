"""How findings stand among the values of a node's diagnostics."""

from __future__ import annotations

PREFIX = "finding."
"""What the keys of findings begin with."""
