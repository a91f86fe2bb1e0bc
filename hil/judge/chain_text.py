"""What a person reads of a chain at the end of a run or a replay: a line for each follower.

The last column is the latency from the capture of a frame to the command that rests on it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from hil.judge.certified import certified_violations
from hil.judge.made_by import made_by
from hil.judge.summary_text import BAD, GOOD, PLAIN, extended_violations, parity_line, warnings_of
from hil.log.report_json import result_console

_COLUMNS = ("follower", r"rho \[m]", "settled", "v1 RMSE", "alpha1", "bounds", "p50, p99")


def print_chain(summary: Mapping[str, Any], console: Console | None = None) -> None:
    """Print the summary of a chain, ``parity`` included, where results are read or on another console."""
    console = console or result_console()
    head = Table.grid(padding=(0, 2))
    for name, finding, style in _head_lines(summary):
        head.add_row(Text(name, style="bold"), Text(finding, style=style))
    console.print(head)
    table = Table(*_COLUMNS, box=None, padding=(0, 2, 0, 0))
    for pair in summary["pairs"]:
        table.add_row(*(Text(text, style=style) for text, style in chain_cells(pair)))
    console.print(table)
    for pair in summary["pairs"]:
        for warning in warnings_of(pair):
            console.print(
                Text.assemble(("! ", "bold yellow"), f"{pair['follower']}: {warning}"), soft_wrap=True
            )


def _head_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    who = ", ".join(made_by(summary))
    seed = f", seed {summary['seed']}" if "seed" in summary else ""
    title = f"{summary['scenario']}, {summary['mode']}, {summary['duration_s']:.1f} s ({who}{seed})"
    yield "run", f"{title}, {summary['agents']} agents", PLAIN
    if "recovered" in summary:
        lost = [pair["follower"] for pair in summary["pairs"] if "settle_s" not in pair]
        text = f"not at their station at the end: {', '.join(lost)}" if lost else "all at their station"
        yield "chain", text, BAD if lost else GOOD
    yield from parity_line(summary)
    if "log" in summary:
        log = summary["log"]
        yield "log", f"{log['path']} ({log['messages']} messages, {log['bytes'] / 1e6:.1f} MB)", PLAIN


def chain_cells(pair: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Text and style of each cell of a follower's row, empty where nothing is known."""
    yield pair["follower"], "bold"
    formation = pair.get("formation", {})
    yield (f"{pair['rho_min']:.3f} to {pair['rho_max']:.3f}" if "rho_min" in pair else ""), PLAIN
    yield (f"from {pair['settle_s']:.1f} s" if "settle_s" in pair else "no" if formation else ""), PLAIN
    rmse = pair["estimation"].get("rmse", {})
    yield (f"{1e3 * rmse['v1']:.1f} mm/s" if "v1" in rmse else ""), PLAIN
    yield (f"{math.degrees(rmse['alpha1']):.2f} deg" if "alpha1" in rmse else ""), PLAIN
    broken = sum((extended_violations(pair) | certified_violations(pair)).values())
    known = "violations" in pair["bounds"]
    yield (f"{broken} broken" if broken else "kept" if known else ""), BAD if broken else GOOD
    latency = pair.get("latency_ms", {}).get("capture_to_command")
    yield (f"{latency['p50']:.0f}, {latency['p99']:.0f} ms" if latency else ""), PLAIN
