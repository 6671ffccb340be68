import os

import pytest

from hierarchy.file_state import see, state_of


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_that_was_made_a_moment_ago_is_not_read_to_tell_whether_it_changes(tmp_path):
    os.mkfifo(tmp_path / "a.ply")
    for look in (state_of, see):
        with pytest.raises(OSError, match="not a regular file"):
            look(tmp_path / "a.ply")


def test_a_file_that_was_made_a_moment_ago_is_read(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"ply")
    assert len(see(tmp_path / "a.ply").digest) == 64
