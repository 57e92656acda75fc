"""What the drones have said: their answers to the tick that is flown, and their frames for as long as they can still arrive."""

import secrets
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import ABSURD_MPS2
from protocols.kernels import bound, by_reference, kernel
from protocols.wire.frames import MAX_FRAME_BYTES
from protocols.wire.messages import MAX_FROM_DRONE, MAX_PROOF, REPLY_AT, REPLY_HEAD, REPLY_MARK, Reply
from protocols.wire.planned import PLAN_BYTES
from protocols.wire.rows import as_bytes, bytes_of, get_number, put_bytes
from protocols.wire.status import AgentStatus
from world.core import Answers, WorldCore
from world.liars import Liars
from world.server.plans import Plans
from world.server.questions import Frames, empty_frames

_HEAD_BYTES = REPLY_HEAD.size


class _Desk(NamedTuple):
    """What `_take_plain` works on.

    given: (6,) as there. data: what was said. numbers: (2,) m/s^2, for its own use, and the same as bytes. command: (N, 2),
    sent_bytes, claim: (N,) and frames: as `Said` has them. plan, planned_at: as `Plans`.
    """

    given: NDArray[np.int64]
    data: NDArray[np.uint8]
    numbers: NDArray[np.float64]
    number_bytes: NDArray[np.uint8]
    command: NDArray[np.float64]
    sent_bytes: NDArray[np.int64]
    claim: NDArray[np.int64]
    frames: Frames
    plan: NDArray[np.uint8]
    planned_at: NDArray[np.int64]


@kernel
def _take_plain(desk: _Desk) -> bool:
    """Take the Reply in ``data`` if all is as usual: ``given`` are the drone's number, how many bytes it has said, and, as they
    are to be, its process, the tick and the proof; last, where frames of this tick lie.

    Returns:
        Whether it was taken. If not, nothing has been done.
    """
    agent, size, process, tick, proof, bucket = (
        desk.given[0], desk.given[1], desk.given[2], desk.given[3], desk.given[4], desk.given[5],
    )  # fmt: skip
    data = desk.data
    if size < _HEAD_BYTES or data[REPLY_AT.mark] != REPLY_MARK:
        return False
    if (
        get_number(data, REPLY_AT.process, 4) != process
        or get_number(data, REPLY_AT.tick, 4) != tick
        or get_number(data, REPLY_AT.proof, 4) != proof
    ):
        return False
    slot, frame = get_number(data, REPLY_AT.slot, 2), get_number(data, REPLY_AT.frame_size, 2)
    plan = get_number(data, REPLY_AT.plan_size, 2)
    usual = (
        get_number(data, REPLY_AT.account_size, 2) == 0
        and frame <= MAX_FRAME_BYTES
        and (plan == 0 or plan == PLAN_BYTES)
        and _HEAD_BYTES + frame + plan == size
    )
    if not usual or slot >= desk.claim.shape[0]:
        return False
    put_bytes(desk.number_bytes, 0, data, REPLY_AT.ax, 16)
    ax, ay = desk.numbers[0], desk.numbers[1]
    if not (abs(ax) <= ABSURD_MPS2 and abs(ay) <= ABSURD_MPS2):
        return False
    desk.command[agent, 0], desk.command[agent, 1] = ax, ay
    desk.claim[agent] = slot
    if frame > 0:
        put_bytes(desk.frames.data[bucket, agent], 0, data, _HEAD_BYTES, frame)
        desk.frames.size[bucket, agent] = desk.sent_bytes[agent] = frame
    if plan > 0:
        put_bytes(desk.plan[agent], 0, data, _HEAD_BYTES + frame, plan)
        desk.planned_at[agent] = tick
    return True


class Said:
    """By the N drones of one world. Who says nothing keeps its command and its slot.

    Attributes:
        command: (N, 2) [m/s^2]. frames: what they sent. plans: what they plan, for those who look on.
    """

    def __init__(self, core: WorldCore) -> None:
        self._agents, self._ring, self._first = core.shape[1], core.ring, 0
        self.frames, self.plans, self._liars = empty_frames(core), Plans(core), Liars(core)
        self.command, self._sent_bytes = np.zeros((self._agents, 2)), np.zeros(self._agents, np.int64)
        self._claim = core.claim[0].astype(np.int64)
        # The same numbers, to be filled one by one.
        self._command_of: memoryview[Any] = self.command.data
        self._sent_bytes_of, self._claim_of = self._sent_bytes.data, self._claim.data
        self._frame_of, self._size_of = bytes_of(self.frames.data), self.frames.size.reshape(-1).data
        self._accounts: list[tuple[int, AgentStatus]] = []
        given, data, numbers = np.zeros(6, np.int64), np.zeros(MAX_FROM_DRONE, np.uint8), np.zeros(2)
        self._given, self._into = given.data, data.data
        desk = _Desk(
            given, data, numbers, as_bytes(numbers), self.command, self._sent_bytes, self._claim, self.frames,
            self.plans.unread, self.plans.made_at,
        )  # fmt: skip
        self._take_plain = bound(_take_plain, by_reference(desk))

    def begin(self, tick: int) -> int:
        """What is said from now on answers to this tick; with the proof that is returned, which nobody can guess."""
        self._first = tick % self._ring * self._agents
        proof = secrets.randbelow(MAX_PROOF)
        self._given[3], self._given[4], self._given[5] = tick, proof, tick % self._ring
        self._accounts.clear()
        self._sent_bytes[:] = 0
        return proof

    def take_plain(self, agent: int, process: int | None, data: bytes) -> bool:
        """Take at once what this drone, flown by this process, says, if it answers to this tick and gives no account; whether it
        does."""
        size = len(data)
        if size > MAX_FROM_DRONE or process is None:
            return False
        given = self._given
        given[0], given[1], given[2] = agent, size, process
        self._into[:size] = data
        return self._take_plain()

    def take(self, agent: int, reply: Reply) -> None:
        """This drone answers."""
        self._command_of[agent, 0], self._command_of[agent, 1] = reply.ax, reply.ay
        self._claim_of[agent] = reply.slot
        if reply.status is not None:
            self._accounts.append((agent, reply.status))
        if reply.plan:
            self.plans.take(agent, reply.tick, reply.plan)
        if reply.frame is not None:
            place, size = self._first + agent, len(reply.frame)
            self._frame_of[place * MAX_FRAME_BYTES : place * MAX_FRAME_BYTES + size] = reply.frame
            self._size_of[place] = self._sent_bytes_of[agent] = size

    def _lie(self) -> None:
        """What liars have said becomes what they are to say."""
        for agent in self._liars.rows:
            place, size = self._first + agent, self._sent_bytes_of[agent]
            if size:
                begin = place * MAX_FRAME_BYTES
                told = self._liars.tell(
                    agent, int(self._given[3]), bytes(self._frame_of[begin : begin + size])
                )
                self._frame_of[begin : begin + len(told)] = told
                self._size_of[place] = self._sent_bytes_of[agent] = len(told)

    def answers(self) -> Answers:
        """All of it."""
        self._lie()
        # Those of one drone as they came: it may catch up.
        in_order = sorted(self._accounts, key=itemgetter(0))
        return Answers(self.command, self._sent_bytes, self._claim, in_order)
