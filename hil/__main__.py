"""``python -m hil``: the same as the console script ``abreast``."""

from hil.command_line import main

main()
