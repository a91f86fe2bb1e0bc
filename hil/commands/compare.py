"""``abreast compare``: runs, logs or sweeps beside each other, and which was better."""

from __future__ import annotations

from pathlib import Path

import click

from hil.commands.outputs import OutputFolder
from hil.errors import CheckFailedError, UsageError
from hil.extras import left_out_if_missing
from hil.log.report_json import print_json, results_apart, say, write_json
from hil.log.written_aside import write_text_aside
from hil.reports.judged_log import made_folder


@click.command("compare")
@click.argument("paths", nargs=-1, required=True, metavar="A B ...", type=click.Path(path_type=Path))
@click.option(
    "--fail-if",
    "conditions",
    multiple=True,
    metavar="EXPR",
    help='Exit 1 if this holds of any but A, like "estimation.rmse.v1 > 1.1": the ratio to A\'s.',
)
@click.option("--out", type=OutputFolder(), metavar="DIR", help="Folder for compare.html and compare.json.")
@click.option("--json", "as_json", is_flag=True, help="Print the comparison as one JSON object on stdout.")
@results_apart()
def command(paths: tuple[Path, ...], conditions: tuple[str, ...], out: Path | None, as_json: bool) -> None:
    """Compare what B and others did with what A did: conditions, metrics with their spread, courses.

    Each is the folder of a run, of many runs, of a sweep or of judged logs, or a log. --fail-if takes NAME,
    ratio(NAME), change(NAME) or value(NAME) of a metric, a sign and a number; see docs/compare.md.
    """
    if len(paths) < 2:
        raise UsageError(f"{paths[0]}: nothing to compare it with; give two or more")
    from hil.compare.comparison import compared
    from hil.compare.comparison_text import comparison_text
    from hil.compare.conditions import failures_of, parsed_condition
    from hil.compare.gathering import groups_of
    from hil.compare.noise_table import noise_rows

    parsed = [parsed_condition(text) for text in conditions]
    groups = groups_of(paths)
    comparison = compared(groups, failures_of(parsed, groups))
    where = "with --json" if out is None else f"in {out / 'compare.html'}"
    say(comparison_text(comparison, noise_rows(comparison), where))
    if out is not None:
        write_json(comparison.as_json(), made_folder(out) / "compare.json")
        with left_out_if_missing("compare.html"):
            from hil.compare.compare_page import compare_page

            page = out / "compare.html"
            write_text_aside(page, compare_page(comparison))
            say(f"look at {page}")
    if as_json:
        print_json(comparison.as_json())
    if comparison.failures:
        raise CheckFailedError("; ".join(failure.text for failure in comparison.failures))
