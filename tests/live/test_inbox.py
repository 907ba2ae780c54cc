"""What people ask for waits in turn."""

import threading
import time

from warp_torchrl.live.inbox import MOST_ACTS, Inbox


def done(inbox, end=0.0):
    return [act() for act in inbox.until(end)]


def test_one_person_s_acts_keep_their_order_and_persons_take_turns():
    inbox = Inbox()
    for person, names in ((1, "abc"), (2, "x"), (3, "pq")):
        for name in names:
            assert inbox.put(person, lambda name=name: name)
    assert done(inbox, time.monotonic() + 0.05) == ["a", "x", "p", "b", "q", "c"]


def test_acts_beyond_what_waits_are_left_out_but_not_those_of_others():
    inbox = Inbox()
    kept = [inbox.put(1, lambda: "flood") for _ in range(100)]
    assert kept == [True] * MOST_ACTS + [False] * (100 - MOST_ACTS)
    assert inbox.put(2, lambda: "other")
    assert done(inbox, time.monotonic() + 0.05) == ["flood", "other", *["flood"] * (MOST_ACTS - 1)]
    assert inbox.put(1, lambda: "again")


def test_who_leaves_asks_for_nothing_more():
    inbox = Inbox()
    for _ in range(5):
        inbox.put(1, lambda: "waits")
    inbox.put_alone(1, lambda: "leaves")
    assert done(inbox, time.monotonic() + 0.05) == ["leaves"]


def test_beyond_the_time_each_person_has_one_act_done():
    inbox = Inbox()
    for _ in range(5):
        inbox.put(1, lambda: 1)
        inbox.put(2, lambda: 2)
    assert done(inbox, time.monotonic() - 1.0) == [1, 2] and done(inbox) == [1, 2]


def test_it_waits_for_acts_until_its_time_and_no_longer_once_closed():
    inbox = Inbox()
    timer = threading.Timer(0.05, lambda: inbox.put(1, lambda: "late"))
    timer.start()
    assert done(inbox, time.monotonic() + 0.3) == ["late"]
    threading.Timer(0.05, inbox.close).start()
    began = time.monotonic()
    assert done(inbox, began + 60.0) == [] and time.monotonic() - began < 30.0
