"""Columns of tables of estimates: their names, units and what they mean, for every table that has them."""

from __future__ import annotations

from estimation.tracking.estimate import QUANTITIES
from hil.log.table_column import TableColumn

ESTIMATE_COLUMNS = {
    column.name: column
    for column in (
        TableColumn("t", "s", "capture time for which the estimate holds, since 1970"),
        TableColumn("rho", "m", "distance between the robots"),
        TableColumn("alpha2", "rad", "bearing of the leader from the follower's heading, counter-clockwise"),
        TableColumn("rho_dot", "m/s", "rate of rho"),
        TableColumn("alpha2_dot", "rad/s", "rate of alpha2"),
        TableColumn("v1", "m/s", "the leader's speed"),
        TableColumn("alpha1", "rad", "bearing of the follower from the leader's heading, counter-clockwise"),
        TableColumn("u1", "rad/s", "the leader's turn rate"),
        TableColumn("sd_rho_dot", "m/s", "standard deviation of rho_dot"),
        TableColumn("sd_alpha2_dot", "rad/s", "standard deviation of alpha2_dot"),
        TableColumn("sd_v1", "m/s", "standard deviation of v1"),
        TableColumn("sd_alpha1", "rad", "standard deviation of alpha1"),
        TableColumn("sd_u1", "rad/s", "standard deviation of u1"),
        TableColumn("bound_v1", "m/s", "bound on the error of v1"),
        TableColumn("bound_alpha1", "rad", "bound on the error of alpha1"),
        TableColumn("status", "", "initialising, tracking, coasting, rejecting or lost"),
    )
}
"""Columns of the CSV of estimates by their names, in its order."""

DEVIATIONS = tuple(f"sd_{name}" for name in QUANTITIES)
"""Columns of standard deviations, in the order of the covariance."""
