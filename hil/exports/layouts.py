"""Layouts of viewers that are shipped, with the topics of a lab in the place of the usual ones."""

from __future__ import annotations

import re
from pathlib import Path

from hil.errors import UsageError
from hil.log.written_aside import write_text_aside
from hil.scenario.checked_toml import data_folder
from hil.scenario.links import Link
from hil.wire.topics import link_topics

LAYOUTS = ("foxglove.json", "plotjuggler.xml")
"""What is shipped: for Foxglove and Lichtblick, and for PlotJuggler."""

_FOLLOWERS = re.compile(r"/follower/(leader_estimate|command|odom)\b")


def write_layouts(folder: Path, link: Link | None = None) -> list[Path]:
    """Write the layouts into a folder, for the topics of a follower; their paths.

    Raises :class:`UsageError` if they cannot be written.
    """
    written = []
    for name in LAYOUTS:
        text = (data_folder() / "layouts" / name).read_text(encoding="utf-8")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_text_aside(folder / name, text if link is None else _for_link(text, link))
        except OSError as error:
            raise UsageError(
                f"{folder / name}: cannot be written ({error.strerror or error}); give another folder"
            ) from None
        written.append(folder / name)
    return written


def _for_link(text: str, link: Link) -> str:
    names = link_topics(link)
    namespace = names.estimate.removesuffix("leader_estimate")
    text = _FOLLOWERS.sub(lambda found: f"/{namespace}{found[1]}", text)
    text = text.replace('"followTf": "follower"', f'"followTf": "{link.follower}"')
    return re.sub(r'(?<=[">])/truth\b', f"/{names.truth}", text) if names.truth != "truth" else text
