"""What can go wrong outside the core. Every message is one line, and ends the command with exit status 2."""

from __future__ import annotations


class UsageError(Exception):
    """The command line cannot be understood, or asks for what cannot be."""


class OutputError(Exception):
    """A file cannot be written."""


class WindowError(Exception):
    """No window can be opened here."""
