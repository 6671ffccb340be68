"""Messages that go by themselves."""

import time

from app.state import ViewerState


def test_errors_stay_where_news_go():
    state = ViewerState()
    state.say("saved")
    state.say("broken", is_error=True)
    later = time.monotonic() + 2.0 * ViewerState.MESSAGE_SECONDS
    state.drop_old_messages(later)
    assert [message.text for message in state.messages] == ["broken"]


def test_next_expiry_is_the_earliest():
    state = ViewerState()
    assert state.next_expiry() is None
    state.say("broken", is_error=True)
    state.say("saved")
    assert state.next_expiry() == state.messages[1].until
