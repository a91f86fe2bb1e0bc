"""The one exception tree of abreast."""

import signal


class AbreastError(Exception):
    """Root of all errors that abreast raises on purpose; its text is one line for the user."""

    exit_code = 1


class UsageError(AbreastError):
    """A mistake in what the user gave; the text says what to do. Exit code 2.

    >>> import abreast
    >>> try:
    ...     abreast.load_scenario("turtelbot3")
    ... except abreast.UsageError as error:
    ...     print(error)
    scenario 'turtelbot3': no such name and no such file; did you mean 'turtlebot3'?
    """

    exit_code = 2


class CheckFailedError(AbreastError):
    """A check that was asked for failed, or a run broke down. Exit code 1.

    >>> import abreast
    >>> deaf = abreast.load_scenario("turtlebot3", {"mocap.loss": 0.99999})
    >>> try:
    ...     abreast.run_lockstep(deaf)
    ... except abreast.CheckFailedError as error:
    ...     print(error)
    the start barrier did not open within 10 s of simulated time; a follower gets no frames ...
    """


class InterruptedRunError(AbreastError):
    """A run was ended by a signal before its time. Exit code 130 for Ctrl-C in its terminal, else 1."""

    def __init__(self, text: str, number: int) -> None:
        super().__init__(text)
        self.exit_code = 130 if number == signal.SIGINT else 1
