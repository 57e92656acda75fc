"""One drone as the world knows it: which process it is, what it was asked, what it has answered. No input or output.

Two processes may hold the login of one drone. The first that says Hello is the drone. Another one knocks: as soon as the first is
heard again, the other is refused; where the first stays silent for `TAKEOVER_S`, it is taken for dead, and the other for the
drone that came back, knowing nothing. A process that is known to be only stopped is never taken for dead.
"""

import math

from protocols.wire import messages

TAKEOVER_S = 3.0
# Ticks, and bytes, that a drone may leave unanswered before it is sent no more: a full pipe would block the world.
BACKLOG = 20
_BACKLOG_BYTES = 100_000
_WAITS = 5  # and so many Waits
_AGAIN_S = 0.9  # between two times that it is sent the same Tick


class Peer:
    """The world's end of one drone.

    Attributes:
        process: the one that is the drone; None before the first, and after one that the mission has ended.
        ready: it answers ticks. boot: how often it was restarted. asked, answered: the last tick it was sent, and answered.
        question: the last Tick it was sent, packed.
    """

    def __init__(self) -> None:
        self.process: int | None = None
        self.ready = False
        self.boot = 0
        self.asked = self.answered = -1
        self.question = b""
        self._rival: int | None = None
        self._rival_since = 0.0
        self._unheard_bytes = self._waits = self._again_bytes = 0
        self._told_at = 0.0
        self._asked_at = -math.inf

    def restart(self) -> None:
        """Its process has ended, and a new one will come, or has come."""
        self.boot += 1
        self.process, self.ready, self._rival = None, False, None
        self._unheard_bytes = self._waits = self._again_bytes = 0
        self._asked_at = -math.inf

    def knock(self, process: int, now_s: float, paused: bool) -> bool:
        """A process says Hello; whether it is the drone. ``paused``: the drone's process is known to be stopped."""
        if self.process not in (None, process):
            if self._rival != process:
                self._rival, self._rival_since = process, now_s
            if paused or now_s - self._rival_since < TAKEOVER_S:
                return False
            self.restart()
        self.process = process
        return True

    def heard(self) -> int | None:
        """The drone was heard: the process that knocked meanwhile and is to be refused, if one did."""
        self._unheard_bytes = self._waits = 0
        rival, self._rival = self._rival, None
        return rival

    def ask(self, tick: int, question: bytes, now_s: float) -> None:
        """It is sent the packed Tick ``question``."""
        self.asked, self.question = tick, question
        self._asked_at = self._told_at = now_s
        self._again_bytes = 0
        self._unheard_bytes += len(question)

    def ask_again(self, now_s: float) -> bool:
        """Whether to send it the last Tick once more: it is there and owes an answer, so the one or the other was lost. Now and
        then, and not if that might fill the pipe of one that only says that it is there.
        """
        owes = self.asked > self.answered and now_s - self._asked_at >= _AGAIN_S
        if not owes or self._again_bytes > _BACKLOG_BYTES:
            return False
        self._again_bytes += len(self.question)
        self._asked_at = self._told_at = now_s
        return True

    @property
    def backlogged(self) -> bool:
        """Whether one more Tick might fill its pipe."""
        return self.asked - self.answered > BACKLOG or self._unheard_bytes > _BACKLOG_BYTES

    def wait(self, now_s: float) -> bool:
        """Whether to tell it now that the world is alive; at most now and then, and not if that might fill its pipe."""
        if self.process is None or now_s - self._told_at < messages.WAIT_EVERY_S or self._waits >= _WAITS:
            return False
        self._told_at = now_s
        self._waits += 1
        return True
