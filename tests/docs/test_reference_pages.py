"""The pages of topics and of summaries: all that there is stands in them, and nothing that there is not."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from hil.command_line import main
from hil.replay.estimate_columns import ESTIMATE_COLUMNS
from hil.wire.message_types import OWN_TYPES
from hil.wire.messages import typename_of
from hil.wire.topics import Topics

ROOT = Path(__file__).resolve().parent.parent.parent
TOPICS = (ROOT / "docs" / "topics.md").read_text(encoding="utf-8")
SUMMARY = (ROOT / "docs" / "summary.md").read_text(encoding="utf-8")

ELSEWHERE = {
    "law.failed",
    "law.failure",
    "truth",
    "window.from_s",
    "window.to_s",
    "stopped_by",
    "orders_refused",
    "certified.failed.ASSUMPTION",
    "fed.why",
    "pairs.saturated_from_s",
    "certificate.formation_any_speed.FIGURE",
    "certificate.formation_with_alpha2.FIGURE",
    "own_motion.time_constant_s",
    "own_motion.time_constant_s_sd",
}
"""Keys of summaries of runs in which something goes wrong, or is of another kind."""

SHORT = ("--set", "run.evaluate_from_s=2", "--json")
LAW = """
def own(shape, leader, gains):
    return leader.v1, 0.0
"""


def rows(text: str, head: str) -> list[list[str]]:
    """Cells of all tables whose first column has this name."""
    tables = re.findall(rf"^\| {head} \|.*\n\| ---.*\n((?:\|.*\n)+)", text, re.MULTILINE)
    return [
        [cell.strip() for cell in line.strip("|").split(" | ")]
        for table in tables
        for line in table.splitlines()
    ]


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def test_every_topic_stands_in_its_page_with_its_type() -> None:
    told = {names(topic)[0]: names(kind)[0] for topic, kind, *_ in rows(TOPICS, "topic")}
    there = Topics("<leader>", "<follower>", stamped=True, guarded=True).types
    of_robots = {topic.replace("<leader>", "<robot>").replace("<follower>", "<robot>") for topic in there}
    for topic, kind in there.items():
        alias = topic.replace("<leader>", "<robot>").replace("<follower>", "<robot>")
        assert told.get(topic, told.get(alias)) == kind, topic
    assert told.keys() <= there.keys() | of_robots


def test_every_message_of_our_own_stands_there() -> None:
    ours = [kind.__name__ for kind in OWN_TYPES if typename_of(kind).startswith("abreast_msgs")]
    assert ours
    assert {f"### {name}" for name in ours} <= set(TOPICS.splitlines())


def test_the_columns_of_estimates_stand_in_their_order() -> None:
    assert [name for row in rows(SUMMARY, "column") for name in names(row[0])] == list(ESTIMATE_COLUMNS)


def paths(value: Any, at: str = "") -> Iterator[str]:
    """Dotted paths of all that a summary tells; lists of objects count as one."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from paths(item, f"{at}.{key}" if at else key)
    elif at == "pairs":
        yield at
        for pair in value:
            yield from paths(pair, at)
    else:
        yield at


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Every key of a certified run, a replay that verifies, a run by an own law, and a chain."""
    folder = tmp_path_factory.mktemp("summaries")
    (folder / "own_law.py").write_text(LAW, encoding="utf-8")
    law = ("--law", f"{folder / 'own_law.py'}:own")
    calls = {
        "certified": ("run", "--lockstep", "--duration", "12", "--certify", *SHORT),
        "law": ("run", "--lockstep", "--duration", "4", *law, *SHORT),
        "chain": ("run", "chain5-turtlebot3", "--lockstep", "--duration", "12", *SHORT),
        "replay": ("replay", str(folder / "certified" / "run.mcap"), "--verify", "--json"),
    }
    found: set[str] = set()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, words in calls.items():
            with pytest.raises(SystemExit) as left:
                main([*words, "--out", name])
            assert left.value.code == 0
            summary = json.loads((folder / name / "summary.json").read_text(encoding="utf-8"))
            found |= set(paths(summary))
            if name != "replay":
                found |= {"lockstep.wall_s", "lockstep.times_real_time"}
    return found


def told_keys() -> list[str]:
    return [name for row in rows(SUMMARY, "key") for name in names(row[0])]


def pattern(key: str) -> str:
    """What a key of the page matches: a word in capitals stands for any name."""
    return re.sub(r"(?<=\\\.)[A-Z_]{4,}(?=$|\\\.)", r"[^.]+", re.escape(key))


def without_pairs(path: str) -> str:
    """A part of a pair is told as that of a run, unless it is a pair's alone."""
    return path.removeprefix("pairs.")


def test_every_key_of_a_summary_stands_in_its_page(seen: set[str]) -> None:
    known = re.compile("|".join(pattern(key) for key in told_keys()))
    of_pairs = ("leader", "follower")
    strangers = {
        path
        for path in seen
        if not known.fullmatch(path)
        and not known.fullmatch(without_pairs(path))
        and without_pairs(path) not in of_pairs
    }
    assert not strangers


def test_every_key_of_the_page_is_one(seen: set[str]) -> None:
    keys = told_keys()
    assert len(set(keys)) == len(keys)
    missing = {key for key in keys if not any(re.fullmatch(pattern(key), path) for path in seen)}
    assert missing <= ELSEWHERE
    modules = [path for room in ("hil", "estimation") for path in (ROOT / room).rglob("*.py")]
    source = "".join(path.read_text(encoding="utf-8") for path in modules)
    for key in ELSEWHERE:
        last = [part for part in key.split(".") if not part.isupper()][-1].removesuffix("_sd")
        assert re.search(rf"\b{last}\b", source), key
