"""The table of keys."""

from collections import Counter

import pytest

from app.commands import BINDINGS, Command, find_command


def test_no_key_means_two_things():
    keys = Counter((key, binding.ctrl) for binding in BINDINGS for key in binding.keys)
    assert max(keys.values()) == 1


def test_every_command_has_one_binding():
    assert Counter(binding.command for binding in BINDINGS) == Counter(Command)


@pytest.mark.parametrize(
    ("key", "ctrl", "command"),
    [
        ("NUMBER_1", False, Command.FRONT),
        ("NUMBER_3", False, Command.RIGHT),
        ("NUMPAD_7", False, Command.TOP),
        ("HOME", False, Command.FIT),
        ("R", False, Command.FIT),
        ("O", True, Command.OPEN),
        ("S", False, Command.SCREENSHOT),
        ("F12", False, Command.SCREENSHOT),
        ("H", False, Command.HELP),
    ],
)
def test_promised_keys(key, ctrl, command):
    assert find_command(key, ctrl) is command


def test_other_keys_mean_nothing():
    assert find_command("O", False) is None
    assert find_command("", False) is None
