"""What stands at the end of each command's help: a few calls of it that do something worth doing."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "run": (
        "abreast run --set mocap.loss=0.05 --set mocap.jitter_s=0.02",
        "abreast run --lockstep --estimator ukf --seed 7 --json",
        """abreast run --set 'mocap.faults=[{kind="dropout", at_s=18, duration_s=1}]'""",
        "abreast run --set "
        """'robot.odometry_faults=[{kind="scale", at_s=18, duration_s=5, factor=0.5}]'""",
        "abreast run my_lab.toml --real --listen tcp/0.0.0.0:7447",
    ),
    "replay": (
        "abreast replay runs/mine/run.mcap --verify",
        "abreast replay runs/mine/run.mcap --estimator smoother --out smoothed",
        "abreast replay recording.mcap --map topics.toml --csv estimates.csv",
    ),
    "compare": (
        "abreast compare runs/before runs/after",
        'abreast compare before.mcap after.mcap --fail-if "estimation.rmse.v1 > 1.1" --out compared',
    ),
    "export": (
        "abreast export runs/mine/run.mcap --to tables",
        "abreast export runs/mine/run.mcap --to tables --format csv --overwrite",
        "abreast export runs/mine/run.mcap --to scene --format foxglove",
    ),
    "live": (
        "abreast live my_lab.toml --connect tcp/192.0.2.10:7447",
        "abreast live --live-port 7480",
    ),
    "simulate": (
        "abreast simulate fig2-independent --out fig2",
        "abreast simulate turtlebot3 --stability",
        "abreast simulate flock --duration 60 --json",
    ),
    "bounds": ("abreast bounds", "abreast bounds my_lab.toml --set leader.k_u=0.5 --json"),
    "sweep": (
        "abreast sweep --runs 20 --estimators ekf,ukf",
        "abreast sweep noise --grid sigma_position=0.001,0.003 --law faded --out faded",
        "abreast sweep my_sweep.toml --keep worst --out sweep",
    ),
    "gains": ("abreast gains my_lab.toml", "abreast gains turtlebot3 --set mocap.latency_s=0.1 --json"),
    "scenario list": ("abreast scenario list", "abreast scenario list --json"),
    "scenario show": (
        "abreast scenario show turtlebot3",
        "abreast scenario show turtlebot3 --set mocap.loss=0.05 > my_lab.toml",
    ),
    "scenario new": (
        "abreast scenario new my_lab.toml",
        "abreast scenario new chain.toml --from chain5-turtlebot3",
    ),
    "import csv": (
        'abreast import csv take.csv --leader "RB 1" --follower "RB 2"',
        "abreast import csv mine.csv --map turtlebot3_lidar_optitrack --out mine.mcap",
    ),
    "import tum": (
        "abreast import tum leader.txt follower.txt",
        "abreast import tum leader.txt follower.txt --out pair.mcap",
    ),
    "import mrclam": (
        "abreast import mrclam MRCLAM7 --leader 1 --follower 2 --out pair.mcap",
        "abreast import mrclam MRCLAM7 --leader 1 --follower 2 --sightings camera --out seen.mcap",
    ),
    "calibrate": (
        "abreast calibrate runs/mine/run.mcap",
        "abreast calibrate mine.mcap --from 5 --to 65 --json",
    ),
    "recover": (
        "abreast recover run.mcap --out whole.mcap",
        "abreast recover run.mcap --out whole.mcap --json",
    ),
    "doctor": (
        "abreast doctor my_lab.toml --connect tcp/192.0.2.10:7447",
        "abreast doctor my_lab.toml --drive follower",
    ),
    "status": ("abreast status my_lab.toml", "abreast status --once --needs estimator,controller"),
    "stop": ("abreast stop", 'abreast stop "a cable is in the way" --scenario my_lab.toml'),
    "arm": ("abreast arm", "abreast arm follower --scenario my_lab.toml"),
    "guard": (
        "abreast guard my_lab.toml --robot follower --connect tcp/192.0.2.10:7447",
        "abreast guard my_lab.toml --robot follower --write follower.guard",
    ),
    "emulator": ("abreast emulator turtlebot3", "abreast emulator turtlebot3 --natnet"),
    "follower": (
        "abreast follower my_lab.toml --connect tcp/192.0.2.10:7447",
        "abreast follower my_lab.toml --needs recorder",
        "abreast follower my_lab.toml --certify --secure keys",
    ),
    "estimator": ("abreast estimator my_lab.toml", "abreast estimator my_lab.toml --set estimator.kind=ukf"),
    "controller": (
        "abreast controller my_lab.toml",
        "abreast controller my_lab.toml --set controller.v_max=0.15",
    ),
    "leader": ("abreast leader my_lab.toml --countdown 10", "abreast leader my_lab.toml --by-hand"),
    "recorder": (
        "abreast recorder my_lab.toml --out run.mcap",
        "abreast recorder my_lab.toml --out run.mcap --duration 60",
    ),
    "router": ("abreast router", "abreast router --listen tls/0.0.0.0:7448 --secure keys"),
    "faults": (
        "abreast faults --list",
        "abreast faults --only kill --tries 3 --out faults",
    ),
    "soak": ("abreast soak", "abreast soak my_lab.toml --duration 600 --apart"),
    "secure init": (
        "abreast secure init keys --host 192.0.2.10",
        "abreast secure init keys --scenario my_lab.toml --days 365 --force",
    ),
    "bridge natnet": (
        "abreast bridge natnet my_lab.toml --server 192.0.2.5",
        "abreast bridge natnet my_lab.toml --server 192.0.2.5 --multicast --up y",
    ),
    "bridge mocap": (
        "abreast bridge mocap my_lab.toml --type vicon --server 192.0.2.5",
        "abreast bridge mocap my_lab.toml --type qualisys --server 192.0.2.5 --up z",
    ),
    "bridge foxglove": (
        "abreast bridge foxglove my_lab.toml",
        "abreast bridge foxglove my_lab.toml --connect tcp/192.0.2.10:7447",
    ),
    "bridge ros2": (
        "abreast bridge ros2 my_lab.toml",
        "abreast bridge ros2 my_lab.toml --set wire.domain=30",
    ),
    "completion": (
        'eval "$(abreast completion bash)"',
        'eval "$(abreast completion zsh)"',
        "abreast completion fish > ~/.config/fish/completions/abreast.fish",
    ),
}
"""Examples by the words of their command."""
