"""Hardware in the loop: messages, emulator, daemons, logs, replay and the command line."""

__version__ = "0.2.0"
