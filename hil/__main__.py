"""``python -m hil``: the same as the console script ``abreast``."""

from abreast.__main__ import main

main()
