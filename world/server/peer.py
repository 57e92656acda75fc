"""One drone as the world knows it: which process it is, what it was asked, what it has answered. No input or output.

Two processes may hold the login of one drone. The first that says Hello is the drone. Another one knocks: as soon as the first is
heard again, the other is refused; where the first stays silent for `TAKEOVER_S`, it is taken for dead, and the other for the
drone that came back, knowing nothing. A process that is known to be only stopped is never taken for dead.
"""

import math

from protocols.wire import messages

TAKEOVER_S = 3.0
# Ticks, and bytes, that a drone may leave unread before it is sent no more: a full pipe would block the world. What it has read
# its answers prove. One that says it is there, or comes back, has perhaps lost what it was sent: it is granted some more, once.
BACKLOG = 20
_BACKLOG_BYTES, _GRANTED_BYTES = 100_000, 40_000
_OVERHEAD_BYTES = 800  # of any message, in a pipe
_WAITS = 5  # Waits that a drone may leave unanswered
_AGAIN_S = 0.9  # between two times that it is sent the same Tick
# A drone need say little but its answers. What it says beyond them runs off at this rate, and no more of it may have gathered.
EXCESS_PER_S, FLOOD = 100.0, 1000.0
FLOODS = f"it floods the world: more than {FLOOD:.0f} messages that nobody asked for"


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
        # By tick that it owes an answer to: the proof, and the bytes sent by then.
        self._open: dict[int, tuple[int, int]] = {}
        self._sent_bytes = self._read_bytes = self._waits = 0
        self._granted = False
        self._excess = self._excess_at = 0.0
        self._turned_away = 0
        self._told_at = 0.0
        self._asked_at = -math.inf

    def restart(self) -> None:
        """Its process has ended, and a new one will come, which owes no answers."""
        self._begin_anew()
        self._read_bytes = self._sent_bytes
        self.excuse()

    def _begin_anew(self) -> None:
        self.boot += 1
        self.process, self.ready, self._rival = None, False, None
        self._waits, self._asked_at = 0, -math.inf
        self._grant()

    def knock(self, process: int, now_s: float, paused: bool) -> bool:
        """A process says Hello; whether it is the drone. ``paused``: the drone's process is known to be stopped."""
        if self.process not in (None, process):
            if self._rival != process:
                self._rival, self._rival_since = process, now_s
            if paused or now_s - self._rival_since < TAKEOVER_S:
                return False
            self._begin_anew()
        self.process = process
        return True

    def heard(self) -> int | None:
        """The drone was heard: the process that knocked meanwhile and is to be refused, if one did."""
        self._waits = 0
        rival, self._rival = self._rival, None
        return rival

    def ask(self, tick: int, proof: int, question: bytes, now_s: float, piped: bool = True) -> None:
        """It is sent the packed Tick ``question``, which holds this ``proof``; ``piped``: down its pipe, not in datagrams."""
        self.asked, self.question = tick, question
        self._asked_at = self._told_at = now_s
        if piped:
            self._sent_bytes += len(question) + _OVERHEAD_BYTES
        self._open[tick] = proof, self._sent_bytes

    def tell(self, size: int) -> None:
        """It is sent a message of ``size`` bytes."""
        self._sent_bytes += size + _OVERHEAD_BYTES

    def owes(self, tick: int) -> bool:
        """Whether it was asked this, and has not answered yet, and nobody has knocked meanwhile."""
        return tick in self._open and self._rival is None

    def answer(self, tick: int, proof: int) -> bool:
        """It answers: whether to a Tick that it has read, and has not answered yet."""
        asked = self._open.get(tick)
        if asked is None or asked[0] != proof:
            return False
        if asked[1] > self._read_bytes:
            self._read_bytes = asked[1]
        self._granted, self._waits, self.answered = False, 0, tick
        if len(self._open) == 1:
            self._open.clear()
        else:
            self._open = {later: said for later, said in self._open.items() if later > tick}
        return True

    def arrive(self) -> None:
        """It says that it is there."""
        self.ready = True
        self._grant()

    def excuse(self) -> None:
        """It owes no answers any more."""
        self.asked = self.answered
        self._open.clear()

    def _grant(self) -> None:
        if not self._granted:
            self._granted = True
            most = _BACKLOG_BYTES - _GRANTED_BYTES
            self._read_bytes = max(self._read_bytes, self._sent_bytes - most)

    def ask_again(self, now_s: float) -> bool:
        """Whether to send it the last Tick once more: it is there and owes an answer, so the one or the other was lost. Now and
        then, and not if that might fill its pipe.
        """
        owes = self.asked > self.answered and now_s - self._asked_at >= _AGAIN_S
        if not owes or not self.room(len(self.question)):
            return False
        self.tell(len(self.question))
        self._asked_at = self._told_at = now_s
        return True

    def room(self, size: int) -> bool:
        """Whether its pipe has room for a message of ``size`` bytes; always, if it has read all."""
        unread = self._sent_bytes - self._read_bytes
        return unread == 0 or unread + size + _OVERHEAD_BYTES <= _BACKLOG_BYTES

    @property
    def backlogged(self) -> bool:
        """Whether it owes so many answers that it is asked no more."""
        return len(self._open) > BACKLOG

    def says(self, now_s: float, messages_: float = 1.0) -> None:
        """It has sent so many messages that nobody asked for."""
        self._excess = max(0.0, self._excess - EXCESS_PER_S * (now_s - self._excess_at)) + messages_
        self._excess_at = now_s

    def turned_away(self, total: int, now_s: float) -> None:
        """So many of its messages were not taken in so far. Of what gathered in a pause of the world only a part counts."""
        self.says(now_s, min(total - self._turned_away, FLOOD / 4))
        self._turned_away = total

    @property
    def floods(self) -> bool:
        """Whether it says so much that it must be stopped."""
        return self._excess > FLOOD

    def wait(self, now_s: float) -> bool:
        """Whether to tell it now that the world is alive; at most now and then, and not if that might fill its pipe."""
        if self.process is None or now_s - self._told_at < messages.WAIT_EVERY_S or self._waits >= _WAITS:
            return False
        self._told_at = now_s
        self._waits += 1
        return True
