"""A lab for one try: robots and their judge, guards, and daemons by a supervisor or by hand."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hil.faults.fault import Setting
from hil.faults.link import Link, NotHereError, cabled, no_link, relayed
from hil.faults.notes import Notes, read_lines
from hil.faults.processes import Processes
from hil.live.process_table import pids_with
from hil.scenario.files import load_scenario, scenario_text
from hil.scenario.guarded import with_guards
from hil.scenario.start import start_poses
from hil.wire.session import reserved_endpoint

SCENARIO, ROBOTS = "turtlebot3", ("leader", "follower")
RUN = "run"
"""What the supervisor is called among the processes of a try."""

DRIVES_V = 0.03
"""Speed [m/s] from which on a robot is seen to drive."""

# Of a leader of two speeds the verdict proves less, which takes seconds of CPU after each run.
_PROGRAM = "{ kind = 'table', t = [0.0, 10.0], v = [0.08, 0.081], u = [0.3, 0.3] }"
_OVERRIDES = ["run.evaluate_from_s=0.5", f"leader.program={_PROGRAM}"]
START_S = 900.0
"""For robots to drive [s]: the first start of all on a machine compiles for minutes."""

_LOOK_S = 0.05


class Lab:
    """The processes of a try, what was seen of the robots so far, and the link that may be changed."""

    def __init__(self, folder: Path, setting: Setting, processes: Processes, link: Link) -> None:
        self.folder, self.setting, self.processes, self.link = folder, setting, processes, link
        self.notes = Notes()
        self._read_to = 0

    @property
    def log(self) -> Path:
        """The log of the try."""
        return self.folder / "run" / "run.mcap"

    def look(self) -> Notes:
        """What was seen until now."""
        self.processes.look()
        path = self.folder / "notes"
        if path.exists():
            with path.open(encoding="utf-8") as lines:
                lines.seek(self._read_to)
                text = lines.read()
            whole = text[: text.rfind("\n") + 1]
            self._read_to += len(whole.encode())
            read_lines(whole.splitlines(keepends=True), self.notes)
        return self.notes

    def watch(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Look on for a while, or until something is so: whether it became so."""
        end_s = time.monotonic() + seconds
        while not (so := until()) and time.monotonic() < end_s:
            time.sleep(_LOOK_S)
            self.look()
        return so

    def await_driving(self) -> bool:
        """Look on until both robots drive: whether they came to."""

        def drive() -> bool:
            seen = [self.look().of(robot).rolled for robot in ROBOTS]
            return all(each and each[-1].v > DRIVES_V for each in seen) or not self.is_running()

        return self.watch(START_S, drive) and self.is_running()

    def is_running(self) -> bool:
        """Whether the run goes on; a lab by hand always does."""
        run = self.processes.running.get(RUN)
        return run is None or run.poll() is None

    def pid(self, role: str) -> int:
        """The process of a role: one that we started, or a daemon of the run. Raises :class:`KeyError`."""
        name = RUN if role == "supervisor" and RUN in self.processes.running else role
        if (own := self.processes.running.get(name)) is not None:
            return own.pid
        for pid, words in pids_with(str(self.folder / "run" / "scenario.toml")).items():
            if role in words:
                return pid
        raise KeyError(role)


@contextmanager
def running_lab(folder: Path, setting: Setting, ros: int | None = None) -> Iterator[Lab]:
    """A lab that comes up; whatever of it is left when the block ends is killed.

    ``ros``: a ROS domain in which drivers hear; None for on the wire. There both robots are behind a cable.
    Raises :class:`NotHereError` for what this machine does not have.
    """
    if ros is not None and setting.how == "emulated":
        raise NotHereError("emulated robots have no driver in ROS")
    folder.mkdir(parents=True)
    with ExitStack() as held:
        if setting.disk_mb:
            held.enter_context(_small_disk(folder / "run", setting.disk_mb))
        processes = Processes(folder)
        links = {"none": no_link, "relay": lambda: relayed(processes), "netns": cabled}
        link = held.enter_context(links[setting.link]())
        held.callback(processes.close)
        lab = Lab(folder, setting, processes, link)
        own = folder / "scenario.toml"
        chosen = with_guards(load_scenario(SCENARIO, [*_OVERRIDES, f"wire.domain={ros or 0}"]))
        own.write_text(scenario_text(chosen), encoding="utf-8")
        nears = {"leader": held.enter_context(reserved_endpoint()), "follower": link.near}
        if setting.how == "emulated":
            nears = dict.fromkeys(ROBOTS, link.router)
        _start_daemons(lab, own)
        places = [
            word
            for name, pose in zip(ROBOTS, start_poses(chosen), strict=True)
            for word in ("--robot", name, nears[name], *map(repr, map(float, pose)))
        ]
        shows = [] if setting.how == "emulated" else ["--shows"]
        notes = str(folder / "notes")
        in_ros = ["--ros", str(ros)] if ros is not None else []
        words = "hil.faults.observer", link.router, notes, *places, *shows, *in_ros
        processes.start("observer", "-m", *words, before=link.before if in_ros else ())
        if setting.how != "emulated":
            _start_guards(lab, own, nears, in_ros=bool(in_ros))
        yield lab


def _start_guards(lab: Lab, scenario: Path, nears: dict[str, str], *, in_ros: bool) -> None:
    for robot, near in nears.items():
        away = robot == "follower" or (in_ros and lab.link.before)
        far, before = (lab.link.far, lab.link.before) if away else (lab.link.router, ())
        side = ("--ros",) if in_ros else ("--listen", near)
        words = "guard", str(scenario), "--robot", robot, "--connect", far, *side
        lab.processes.start(f"guard-{robot}", "-m", "hil", *words, before=before)


def _start_daemons(lab: Lab, scenario: Path) -> None:
    setting, router = lab.setting, lab.link.router
    start = lab.processes.start
    if setting.how != "hand":
        real = ["--real", "--countdown", "0"] if setting.how == "run" else []
        apart = ["--apart"] if setting.apart else []
        where = ["--listen", router, "--out", str(lab.folder / "run")]
        duration = ["--duration", str(setting.duration_s)]
        start(RUN, "-m", "hil", "run", str(scenario), *real, *apart, *where, *duration, *setting.options)
        return
    start("supervisor", "-m", "hil", "router", "--listen", router)
    (lab.folder / "run").mkdir(exist_ok=True)
    start("recorder", "-m", "hil", "recorder", str(scenario), "--connect", router, "--out", str(lab.log))
    for role in ("estimator", "controller") if setting.apart else ("follower",):
        module = ["hil.faults.shifted_clock", str(setting.clock_s)] if setting.clock_s else ["hil"]
        start(role, "-m", *module, role, str(scenario), "--connect", router)
    needs = "estimator,controller,recorder,guard/leader,guard/follower"
    words = "--connect", router, "--countdown", "0", "--needs", needs
    start("leader", "-m", "hil", "leader", str(scenario), *words)


@contextmanager
def _small_disk(folder: Path, megabytes: int) -> Iterator[None]:
    folder.mkdir()
    size = f"size={megabytes}m"
    command = ["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(folder)]
    mounting = subprocess.run(command, capture_output=True, text=True, check=False)
    if mounting.returncode:
        raise NotHereError(f"a small disk cannot be mounted: {' '.join(mounting.stderr.split())}")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)
