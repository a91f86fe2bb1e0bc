"""The noise of measurements at a step of the estimator: taken as it is known, and learned from what comes."""

from __future__ import annotations

from estimation.consistency.noise_estimate import (
    Moment,
    NoiseEstimate,
    is_another,
    noise_with_frame,
    noise_with_sighting,
)
from estimation.consistency.process_estimate import unlearned
from estimation.models.measurement import PoseNoise
from estimation.tracking.manoeuvre import steady
from estimation.tracking.track_point import DUPLICATE, LATE
from estimation.tracking.tracker import newest
from formation.kernel import kernel
from formation.records import Rows, load, store, within
from formation.ring import place
from hil.nodes.estimator_records import Known, Memory, Rules, Taken


@kernel
def learn_noise(
    knowns: Rows[Known], memory: Memory, rules: Rules, moment: Moment, gated: bool, begins: bool
) -> None:
    """Learn of the noise from a frame in its order; ``gated``: whether it was not believed.

    ``begins``: whether with this frame it begins to be learned how the leader drives.
    """
    noises = within(Known, knowns, 0, "noise")
    before = load(NoiseEstimate, noises, 0)
    store(noises, 0, noise_with_frame(before, moment, gated, rules.noise_learning))
    after = load(NoiseEstimate, noises, 0)
    if is_another(after):
        _go_on_with_other_noise(knowns, memory, rules)
    elif begins:
        # All that is learned from now on rests on the noise as it is known now.
        store(noises, 0, after._replace(basis=after.scale.position))


@kernel(inline=False)
def _go_on_with_other_noise(knowns: Rows[Known], memory: Memory, rules: Rules) -> None:
    """Go on where the noise turns out to be another one than all rests on that was learned before.

    How the leader drives was weighed against that, and of a larger noise the belief is less certain. A track
    that has settled is not waited for again.
    """
    known = load(Known, knowns, 0)
    points, ring, noise = memory.points, known.track, known.noise
    if ring.length > 0 and noise.scale.position > noise.basis:
        by, point = noise.scale.position / noise.basis, newest(points, ring)
        wider = rules.filter.widened(point.belief, by * by)
        # Innovations that leaned to one side were noise.
        point = point._replace(belief=wider, manoeuvre=steady())
        store(points, place(ring, points, ring.length - 1), point)
    process = unlearned(known.process, memory.bank, rules.process_learning)
    noise = noise._replace(basis=noise.scale.position)
    store(knowns, 0, known._replace(noise=noise, process=process))


@kernel
def with_sight_noise(taken: Taken, knowns: Rows[Known], memory: Memory, rules: Rules) -> Taken:
    """What became of a sighting; what one that came in order tells of the sensor's noise is taken in."""
    unused = taken.verdict == DUPLICATE or taken.verdict == LATE
    if not rules.noise_learning.learns or taken.late or unused:
        return taken
    known = load(Known, knowns, 0)
    learned = noise_with_sighting(known.noise, newest(memory.points, known.track))
    store(within(Known, knowns, 0, "noise"), 0, learned)
    return taken


@kernel
def with_noise(rules: Rules, noise: PoseNoise) -> Rules:
    """Rules by which poses have this noise."""
    return rules._replace(noise=noise, own_noise=rules.own_noise._replace(pose=noise))
