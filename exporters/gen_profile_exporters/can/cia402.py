"""The state machine of CiA 402-2: states as statuswords tell them, and the controlwords between them."""

from enum import Enum, IntEnum

CIA_402 = 402  # low word of 1000h, the device profile
VOLTAGE = 1 << 4
REMOTE = 1 << 9
LIMIT_ACTIVE = 1 << 11
FOLLOWS = 1 << 12  # csp: the drive follows the command; ip: interpolation is active
FOLLOWING_ERROR = 1 << 13
IP_ENABLE = 1 << 4  # of the controlword


class State(Enum):
    """Of a drive: its words, and the statusword's bits under the mask of those that matter."""

    NOT_READY = ("not ready to switch on", 0b000_0000, 0b100_1111)
    SWITCH_ON_DISABLED = ("switch on disabled", 0b100_0000, 0b100_1111)
    READY = ("ready to switch on", 0b010_0001, 0b110_1111)
    SWITCHED_ON = ("switched on", 0b010_0011, 0b110_1111)
    ENABLED = ("operation enabled", 0b010_0111, 0b110_1111)
    QUICK_STOP = ("quick stop active", 0b000_0111, 0b110_1111)
    FAULT_REACTION = ("fault reaction active", 0b000_1111, 0b100_1111)
    FAULT = ("fault", 0b000_1000, 0b100_1111)
    UNKNOWN = ("unknown", 1, 0)  # of a statusword that none of these matches; nothing follows from it

    def __init__(self, words: str, bits: int, mask: int) -> None:
        self.words = words
        self.bits = bits
        self.mask = mask


class Controlword(IntEnum):
    """Commands to a drive."""

    DISABLE_VOLTAGE = 0x00
    QUICK_STOP = 0x02
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    ENABLE = 0x0F
    FAULT_RESET = 0x80


MODES = {"ip": 7, "csp": 8, "csv": 9}  # 6060h
# in which a drive moves its axis, or may
MOVING = frozenset({State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION, State.UNKNOWN})
FAULTS = frozenset({State.FAULT_REACTION, State.FAULT})


def state_of(statusword: int) -> State:
    """Read the state."""
    matching = (state for state in State if statusword & state.mask == state.bits)
    return next(matching, State.UNKNOWN)
