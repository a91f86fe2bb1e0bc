"""The columns of the aligned table: everything about an estimate in one row."""

from __future__ import annotations

from estimation.tracking.estimate import QUANTITIES
from hil.log.table_column import TableColumn
from hil.replay.estimate_columns import DEVIATIONS, ESTIMATE_COLUMNS

SHAPE = ("rho", "alpha2", *QUANTITIES)
"""Shape of the pair, its rates and the leader's motion: what is estimated."""

TRUE_POSES = ("leader_x", "leader_y", "leader_theta", "follower_x", "follower_y", "follower_theta")

ALIGNED_COLUMNS = (
    TableColumn("follower", "", "name of the follower whose estimate it is"),
    TableColumn("time_ns", "ns", "capture time for which the estimate holds, since 1970, exact"),
    ESTIMATE_COLUMNS["t"],
    TableColumn("t_run", "s", "the same since the leader set off; in an imported log the source's own time"),
    *(ESTIMATE_COLUMNS[name] for name in SHAPE),
    TableColumn("v2", "m/s", "the follower's own speed that the estimate rests on"),
    TableColumn("u2", "rad/s", "the follower's own turn rate that the estimate rests on"),
    *(ESTIMATE_COLUMNS[name] for name in DEVIATIONS),
    ESTIMATE_COLUMNS["bound_v1"],
    ESTIMATE_COLUMNS["bound_alpha1"],
    TableColumn("bound_h", "rad/s", "bound on the error of h, the law's feedback term"),
    TableColumn("radius_v1", "m/s", "certified radius around v1, where estimator.certify asks for it"),
    TableColumn("radius_alpha1", "rad", "certified radius around alpha1"),
    TableColumn("certificate_failed", "", "the assumption that keeps the radii from being certified"),
    TableColumn("nis", "", "normalised innovation squared of the newest measurement"),
    ESTIMATE_COLUMNS["status"],
    TableColumn("reason", "", "why the status is not tracking"),
    TableColumn("judged", "", "whether the summary's figures, as estimation.rmse, are made of this estimate"),
    TableColumn("true_rho", "m", "true rho at t"),
    TableColumn("true_alpha2", "rad", "true alpha2 at t"),
    TableColumn("true_rho_dot", "m/s", "true rho_dot at t"),
    TableColumn("true_alpha2_dot", "rad/s", "true alpha2_dot at t"),
    TableColumn("true_v1", "m/s", "true v1 at t"),
    TableColumn("true_alpha1", "rad", "true alpha1 at t"),
    TableColumn("true_u1", "rad/s", "true u1 at t"),
    TableColumn("true_v2", "m/s", "true speed of the follower at t"),
    TableColumn("true_u2", "rad/s", "true turn rate of the follower at t"),
    TableColumn("true_leader_x", "m", "true x of the leader at t"),
    TableColumn("true_leader_y", "m", "true y of the leader at t"),
    TableColumn("true_leader_theta", "rad", "true heading of the leader at t"),
    TableColumn("true_follower_x", "m", "true x of the follower at t"),
    TableColumn("true_follower_y", "m", "true y of the follower at t"),
    TableColumn("true_follower_theta", "rad", "true heading of the follower at t"),
    TableColumn("error_rho", "m", "rho minus true_rho"),
    TableColumn("error_alpha2", "rad", "alpha2 minus true_alpha2, wrapped"),
    TableColumn("error_rho_dot", "m/s", "rho_dot minus true_rho_dot"),
    TableColumn("error_alpha2_dot", "rad/s", "alpha2_dot minus true_alpha2_dot"),
    TableColumn("error_v1", "m/s", "v1 minus true_v1"),
    TableColumn("error_alpha1", "rad", "alpha1 minus true_alpha1, wrapped"),
    TableColumn("error_u1", "rad/s", "u1 minus true_u1"),
    TableColumn("command_v2", "m/s", "speed in force at t: of the last command issued by then"),
    TableColumn("command_u2", "rad/s", "turn rate in force at t"),
    TableColumn("command_v2_wanted", "m/s", "what the law wanted, before limits and stops"),
    TableColumn("command_u2_wanted", "rad/s", "what the law wanted, before limits and stops"),
    TableColumn("command_saturated", "", "1 where a limit changed the command in force, else 0"),
    TableColumn("command_stop", "", "why the robot was stopped at t, empty while it drove"),
    TableColumn("command_age", "s", "t minus the time at which the command in force was issued"),
    TableColumn("delay_measured", "s", "t minus the capture of the newest measurement behind the estimate"),
    TableColumn("delay_computed", "s", "when the estimate was made, minus t: transport and computing"),
    TableColumn("delay_commanded", "s", "when the first command on this capture was issued, minus t"),
    TableColumn("refused", "", "inputs that the estimator had refused by its last report before t"),
    TableColumn("refused_by_cause", "", "the same by cause, such as stale 3, gate 2"),
)
"""Columns of the aligned table, in its order. What is not known is NaN, of texts empty; in CSV empty."""
