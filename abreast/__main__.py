"""The console script ``abreast``, and ``python -m abreast``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from abreast._hidden import HiddenPackageError, refuse_hidden


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit; with code 2 if another package hides one of abreast's."""
    try:
        refuse_hidden()
    except HiddenPackageError as error:
        sys.stderr.write(f"abreast: {error}\n")
        sys.exit(2)
    from hil.command_line import main as command_line

    command_line(arguments)


if __name__ == "__main__":
    main()
