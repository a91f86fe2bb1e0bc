"""Where the live page is served, on the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from hil.commands.whole_numbers import Whole
from hil.errors import UsageError

if TYPE_CHECKING:
    from hil.live_page.page_process import PageProcess
    from hil.wire.session import Endpoints


class PagePlace(NamedTuple):
    """Address and port of the page, None for the usual ones."""

    address: str | None
    port: int | None


def page_options() -> list[click.Parameter]:
    """``--live-port`` and ``--live-address``."""
    port = Whole(1, 65535)
    return [
        click.Option(["--live-port"], type=port, metavar="N", help="Port of the page [7480, or a free one]."),
        click.Option(
            ["--live-address"],
            metavar="ADDR",
            help="Where the page is served [127.0.0.1]; 0.0.0.0 for the whole network.",
        ),
    ]


def page_place(options: dict[str, Any]) -> PagePlace | None:
    """Where the page of a run is wanted, by its options, which are taken out; None for nowhere.

    Raises :class:`UsageError` where they cannot be met.
    """
    page, address, port = options.pop("page"), options.pop("live_address"), options.pop("live_port")
    if not page:
        given = {"--live-port": port, "--live-address": address}
        if option := next((each for each, value in given.items() if value is not None), ""):
            raise UsageError(f"{option}: says where the live page is served; give --live too")
        return None
    if options["lockstep"]:
        raise UsageError("--live: a run in lockstep is over before it is seen; leave one of both out")
    return PagePlace(address, port)


@contextmanager
def shown_page(place: PagePlace, endpoints: Endpoints, say: Callable[[str], None]) -> Iterator[PageProcess]:
    """The page of a run on endpoints, whose address is said."""
    from hil.live_page.page_process import page_process
    from hil.live_page.serving import LOOPBACK, address_of, bound, is_open, new_token

    token = new_token()
    with bound(place.address or LOOPBACK, place.port) as listening:
        address = address_of(listening, "" if is_open(listening, endpoints) else token)
        with page_process(listening, token, say) as page:
            say(f"the run is shown at {address}")
            yield page
