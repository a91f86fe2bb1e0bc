"""Words and units for the figures of a summary, by their paths in its JSON."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

_DEGREES = degrees(1.0)


@dataclass(frozen=True, slots=True)
class Label:
    """What a figure is, its unit as shown, and what its value in SI units is multiplied by for that."""

    words: str
    unit: str = ""
    scale: float = 1.0


BOUNDED = {
    "v1": Label("v₁", "mm/s", 1e3),
    "alpha1": Label("α₁", "deg", _DEGREES),
    "h": Label("h", "deg/s", _DEGREES),
}
"""What has bounds."""
_ERRORS = {
    "M_rho": Label("ρ̇", "mm/s", 1e3),
    "M_alpha2": Label("α̇₂", "deg/s", _DEGREES),
    "E_rho": Label("ρ", "mm", 1e3),
    "E_alpha2": Label("α₂", "deg", _DEGREES),
    "E_v2": Label("v₂", "mm/s", 1e3),
    "E_u2": Label("u₂", "deg/s", _DEGREES),
}

LABELS: dict[str, dict[str, Label]] = {
    "Estimates": {
        "estimation.evaluated_from_s": Label("judged from", "s"),
        "estimation.untracked": Label("did not say tracking"),
        "estimation.settle_s": Label("tracking after", "s"),
        "estimation.nis_mean": Label("mean NIS (2 expected)"),
        "noise.scale": Label("noise of positions, found over told"),
        "own_motion.delay_s": Label("follower moves after its odometry", "ms", 1e3),
        "own_motion.time_constant_s": Label("lag of the follower's base", "ms", 1e3),
        "own_motion.scale_v": Label("speed of its track over odometry's"),
        "own_motion.scale_u": Label("turn rate of its track over odometry's"),
    },
    "Largest errors seen": {
        "bounds.v_eps": Label("least speed of the leader, v_eps", "mm/s", 1e3),
        "bounds.M_rho": Label("ρ̇, judged samples (M_ρ)", "mm/s", 1e3),
        "bounds.M_alpha2": Label("α̇₂, judged samples (M_α₂)", "deg/s", _DEGREES),
        **{
            f"bounds.largest_errors_seen.{name}": Label(label.words, label.unit, label.scale)
            for name, label in _ERRORS.items()
        },
    },
    "Inputs err as little as assumed, of the samples": {
        **{
            f"bounds.input_errors_hold.{name}": Label(label.words, "%", 100.0)
            for name, label in _ERRORS.items()
        },
        "bounds.input_errors_hold.all": Label("all of them", "%", 100.0),
    },
    "Formation": {
        "formation.rho_min": Label("ρ, least", "m"),
        "formation.rho_max": Label("ρ, largest", "m"),
        "formation.rho_final": Label("ρ at the end", "m"),
        "formation.alpha1_final": Label("α₁ at the end", "deg", _DEGREES),
        "formation.alpha2_final": Label("α₂ at the end", "deg", _DEGREES),
        "formation.equilibrium_deviation_rms.rho": Label("ρ off ρ₀, RMS", "mm", 1e3),
        "formation.equilibrium_deviation_rms.alpha1": Label("α₁ off its station, RMS", "deg", _DEGREES),
        "formation.orbit_deviation_rms.rho": Label("ρ off the noise-free run, RMS", "mm", 1e3),
        "formation.orbit_deviation_rms.alpha1": Label("α₁ off the noise-free run, RMS", "deg", _DEGREES),
    },
    "Certified estimates": {
        "certified.certified": Label("certified"),
        **{
            f"certified.{name}.{key}": Label(words.format(label.words), label.unit * scaled, scale)
            for name, label in BOUNDED.items()
            for key, words, scaled, scale in (
                ("median", "radius of {}, median", True, label.scale),
                ("largest", "radius of {}, largest", True, label.scale),
                ("tightness", "largest error / radius of {}", False, 1.0),
                ("violations", "{} outside its radius", False, 1.0),
            )
        },
    },
    "Commands": {
        "commands.sent": Label("sent"),
        "commands.saturated": Label("at a limit of the robot"),
        "commands.stopped": Label("to stand still, after the first drive"),
    },
    "From capture to command": {
        "latency_ms.capture_to_command.p50": Label("median", "ms"),
        "latency_ms.capture_to_command.p99": Label("99 %", "ms"),
        "latency_ms.capture_to_command.max": Label("largest", "ms"),
        "cycles.count": Label("commands first on a capture"),
        "cycles.late": Label("of them late"),
        "cycles.limit_ms": Label("late is later than", "ms"),
        "cycles.longest_ms": Label("longest wait", "ms"),
    },
    "Frames of the motion capture": {
        "frames.published": Label("published"),
        "frames.received": Label("received"),
        "frames.used": Label("used"),
        "frames.lost": Label("lost"),
        "frames.late": Label("late"),
        "frames.rejected": Label("refused, odometry included"),
    },
    "Clock of the motion capture": {
        "clock.offset_ms": Label("ahead of ours, at the most", "ms"),
        "clock.drift_ppm": Label("drift", "ppm"),
        "clock.jitter_ms.p50": Label("jitter, median", "ms"),
        "clock.jitter_ms.p99": Label("jitter, 99 %", "ms"),
        "clock.jitter_ms.max": Label("jitter, largest", "ms"),
        "clock.jumps": Label("jumps"),
    },
}
"""Labels by the caption of their table, and by path."""

CLAIMS = {
    "rates": "Rates of ρ and α₂",
    "estimates": "Estimates of the leader",
    "h": "How far h errs",
    "alpha2_ultimate": "α₂ in the long run",
    "formation": "Formation",
    "formation_any_speed": "Formation at any speed of the leader",
    "formation_with_errors": "Formation with wrong estimates",
    "formation_with_alpha2": "Formation with wrong estimates and α₂ moving",
    "formation_independent_noise": "The same where noise averages out",
    "k_u_star": "Turn rate up to which Prop. 3 holds, k_u*",
}
"""Claims of a certificate by their keys."""

FIGURES = {
    "M_rho": Label("ρ̇ errs by at most", "mm/s", 1e3),
    "M_alpha2": Label("α̇₂ errs by at most", "deg/s", _DEGREES),
    "closed_form": Label("by the formula", "mm/s", 1e3),
    "eps": Label("where positions err by at most", "mm", 1e3),
    "acceleration": Label("and the leader accelerates by at most", "m/s²"),
    "M_v1": Label("v₁ errs by at most", "mm/s", 1e3),
    "M_v1_filter": Label("by the filter that flies", "mm/s", 1e3),
    "M_alpha1": Label("α₁ errs by at most", "deg", _DEGREES),
    "sound": Label("at most", "deg/s", _DEGREES),
    "paper": Label("by the paper's form, which is no bound,", "deg/s", _DEGREES),
    "value": Label("within", "deg", _DEGREES),
    "rho_min": Label("ρ from", "m"),
    "rho_max": Label("to", "m"),
    "alpha1_min": Label("α₁ from", "deg", _DEGREES),
    "alpha1_max": Label("to", "deg", _DEGREES),
    "alpha2_within": Label("α₂ within", "deg", _DEGREES),
    "W": Label("with the leader's velocity off by up to", "mm/s", 1e3),
    "lower": Label("from", "deg/s", _DEGREES),
    "upper": Label("to", "deg/s", _DEGREES),
}
"""Figures of a claim by their keys."""
