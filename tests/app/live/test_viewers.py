"""What viewers of a station are notified of, and when."""

from handscope.app.live.viewers import Viewers


def test_a_ticks_news_goes_with_the_next_pose_and_alone_where_none_comes() -> None:
    viewers, notices = Viewers(), []
    viewers.add(lambda: notices.append(1))
    viewers.notify_at_tick(None)
    assert len(notices) == 1  # there was no pose yet
    viewers.notify_at_tick("a pose")
    assert len(notices) == 1
    viewers.notify_at_tick("a newer pose")
    assert len(notices) == 1
    viewers.notify_at_tick("a newer pose")  # poses have stopped
    assert len(notices) == 2
