"""What judges leave to compiled code. Importing this module compiles it."""

from __future__ import annotations

from formation.kernel import entry
from formation.records import Matrix, Rows, load
from hil.judge.epochs import ClockDesk, sorted_into_epochs
from hil.judge.orbit_steps import OrbitDesk, orbit_integrated
from hil.judge.true_shapes import shapes_filled


@entry
def sort_into_epochs(desks: Rows[ClockDesk]) -> None:
    """Sort arrivals by the epochs of the capture's clock."""
    sorted_into_epochs(load(ClockDesk, desks, 0))


@entry
def integrate_orbit(desks: Rows[OrbitDesk]) -> None:
    """Integrate the noise-free orbit of a pair."""
    orbit_integrated(load(OrbitDesk, desks, 0))


@entry
def fill_shapes(columns: Matrix) -> None:
    """See :func:`hil.judge.true_shapes.shapes_filled`."""
    shapes_filled(columns)
