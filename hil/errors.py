"""The one exception tree of abreast."""


class AbreastError(Exception):
    """Root of all errors that abreast raises on purpose; its text is one line for the user."""

    exit_code = 1


class UsageError(AbreastError):
    """A mistake in what the user gave; the text says what to do. Exit code 2."""

    exit_code = 2


class CheckFailedError(AbreastError):
    """A check that was asked for failed, or a run broke down. Exit code 1."""
