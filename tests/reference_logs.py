"""Reference logs: short runs kept with their outputs, so that a change that alters outputs is seen.

Each log in ``tests/reference`` holds the scenario that it was flown by. `scripts/renew-reference` flies all
of them anew, tells how they differ from those kept, and puts them in their place.
"""

from __future__ import annotations

import json
import platform
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click
from llvmlite import binding

from hil import __version__
from hil.judge.replay_verdict import why_not_same
from hil.lockstep.run import run_lockstep
from hil.log.metadata import scenario_of
from hil.log.reader import Log, read_log
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire.message_types import Message
from hil.wire.messages import encode, typename_of
from hil.wire.topics import LOG, topics_of
from tests.log_differences import Sent, by_topic, differences

FOLDER = Path(__file__).resolve().parent / "reference"
WRITTEN_ON = FOLDER / "reference.json"

SHORT = ("run.duration_s=2.0", "run.evaluate_from_s=1.0", "mocap.rate_hz=50")

FLIGHTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "plain-ekf": (
        "turtlebot3",
        (*SHORT, "estimator.certify=true"),
    ),
    "rough-ukf": (
        "turtlebot3",
        (
            *SHORT,
            "run.seed=7",
            "estimator.kind=ukf",
            "estimator.front_end=body",
            "mocap.loss=0.05",
            "mocap.jitter_s=0.02",
            'mocap.faults=[{kind="step", at_s=1.0, duration_s=0.1, offset=[0.05, 0.0]}]',
        ),
    ),
    "sides-imm": (
        "changing-sides",
        (
            *SHORT,
            "run.seed=3",
            "formation.change_sides_at_s=[1.0]",
            "controller.law=faded",
            "estimator.kind=imm",
            "estimator.own_motion=fused",
            "estimator.clock=estimated",
        ),
    ),
}
"""Scenario and overrides of every reference log, by its name."""


def path_of(name: str) -> Path:
    return FOLDER / f"{name}.mcap"


def scenario_for(name: str) -> Scenario:
    """Scenario that the log of this name is flown by when it is renewed."""
    base, overrides = FLIGHTS[name]
    return load_scenario(base, overrides)


def hardware() -> dict[str, str]:
    """What the last bits of outputs depend on besides our code: processor and mathematical library."""
    return {
        "machine": platform.machine(),
        "cpu": _cpu_model(),
        "compiled_for": str(binding.get_host_cpu_name()),
        "libc": " ".join(platform.libc_ver()),
    }


def written_on() -> dict[str, str]:
    """What :func:`hardware` gave, and our version, where the logs were written."""
    written: dict[str, str] = json.loads(WRITTEN_ON.read_text(encoding="utf-8"))
    return written


def same_hardware() -> bool:
    """Whether outputs must be those of the logs to the bit here."""
    written = written_on()
    return all(written.get(key) == value for key, value in hardware().items())


def flown_anew(log: Log, folder: Path, *, exactly: bool) -> list[str]:
    """How all messages of a log differ from those of its own scenario, flown again in lockstep."""
    scenario = scenario_of(log)
    assert scenario is not None
    run_lockstep(scenario, folder / log.path.name)
    return differences(_sent(log), _sent(read_log(folder / log.path.name)), exactly=exactly)


def replayed(log: Log, *, exactly: bool) -> list[str]:
    """How outputs of the nodes differ from those in a log when they are given the log's inputs again."""
    played = replay(log)
    names = topics_of(played.scenario)
    outputs: dict[str, Sequence[Message]] = {
        names.estimate: played.estimates,
        names.command: played.commands,
        names.certified: played.certified,
    }
    was = {topic: sent for topic, sent in _sent(log).items() if topic in outputs}
    now = {topic: _in_place_of(series, outputs[topic]) for topic, series in was.items()}
    lines = differences(was, now, exactly=exactly, since_ns=log.start_ns)
    if exactly and not lines and played.mismatched:
        lines = [why_not_same(log, played)]
    return lines


def renew() -> None:
    """Fly all reference logs anew, tell how they differ from those kept, and keep the new ones."""
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as room:
        for name in FLIGHTS:
            kept, new = path_of(name), Path(room) / f"{name}.mcap"
            run_lockstep(scenario_for(name), new)
            lines = ["new"]
            if kept.exists():
                lines = differences(_sent(read_log(kept)), _sent(read_log(new)), exactly=True) or ["the same"]
            for line in lines:
                click.echo(f"{name}: {line}")
            kept.write_bytes(new.read_bytes())
    written = {"abreast": __version__, **hardware()}
    WRITTEN_ON.write_text(json.dumps(written, indent=2) + "\n", encoding="utf-8")


def _in_place_of(recorded: Sequence[Sent], outputs: Sequence[Message]) -> list[Sent]:
    """Outputs of a replay, each at the time of the recorded one that it takes the place of."""
    times = [sent.at_ns for sent in recorded]
    times += [recorded[-1].at_ns] * (len(outputs) - len(recorded))
    return [
        Sent(typename_of(message), encode(message), at_ns)
        for message, at_ns in zip(outputs, times, strict=False)
    ]


def _sent(log: Log) -> dict[str, list[Sent]]:
    """Messages of the run; what the log says of itself has our version in it."""
    return by_topic(record for record in log.records() if record.topic != LOG)


def _cpu_model() -> str:
    """Name that the processor gives itself, as Linux tells it; elsewhere what Python knows of it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


if __name__ == "__main__":
    renew()
