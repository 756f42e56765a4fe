"""The parameter protocol: ground stations load the list before they show a vehicle."""

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.parameters import Parameters, ParameterType

LIST_INTERVAL_US = 20_000
LIST_BURST = 10
"""A list goes out ten parameters at a time, so that datagrams stay short and links breathe."""

HASH_CHECK = "_HASH_CHECK"
"""Of PX4: asks for a checksum instead of the whole list; set, it ends the sending of a list."""

NO_INDEX, NO_PARAMETER = 65_535, -1


class ParameterServer:
    """Answers about one autopilot's parameters, and sends their list by and by."""

    def __init__(self, parameters: Parameters, *, refuses_unknown: bool = False) -> None:
        """Serve parameters.

        Args:
            parameters: of the autopilot.
            refuses_unknown: whether PARAM_ERROR answers for a name that does not exist, and not silence.
        """
        self._parameters = parameters
        self._refuses_unknown = refuses_unknown
        self._waiting: deque[str] = deque()
        self.due_us: int | None = None
        """When the next part of a list goes out; None when none is asked for."""

    def request_list(self, now_us: int) -> list[MAVLink_message]:
        """PARAM_REQUEST_LIST: the first part now, the rest later."""
        self._waiting = deque(self._parameters)
        self.due_us = now_us
        first = [self._hash_check()] if self._parameters.encoding == "bytewise" else []
        return first + self.next_part(now_us)

    def next_part(self, now_us: int) -> list[MAVLink_message]:
        """What is due of the list at this time."""
        if self.due_us is None or now_us < self.due_us:
            return []
        names = [self._waiting.popleft() for _ in range(min(LIST_BURST, len(self._waiting)))]
        self.due_us = now_us + LIST_INTERVAL_US if self._waiting else None
        return [self.value(name) for name in names]

    def read(self, message: MAVLink_message) -> list[MAVLink_message]:
        """PARAM_REQUEST_READ: by index or by name; what does not exist is not answered."""
        names = self._parameters.names
        if message.param_index >= 0:
            return [self.value(name) for name in names[message.param_index :][:1]]
        if message.param_id == HASH_CHECK and self._parameters.encoding == "bytewise":
            return [self._hash_check()]
        if message.param_id in self._parameters:
            return [self.value(message.param_id)]
        return self._refusal(message)

    def write(self, message: MAVLink_message) -> tuple[str | None, list[MAVLink_message]]:
        """PARAM_SET: the name, if it was stored, and the answer, which is the value as it is now."""
        name = message.param_id
        if name == HASH_CHECK and self._parameters.encoding == "bytewise":
            self._waiting.clear()
            self.due_us = None
            return None, []
        if name not in self._parameters:
            return None, self._refusal(message)
        value = self._parameters.decoded(name, message.param_value)
        changed = self._parameters.set(name, value)
        return (name if changed else None), [self.value(name)]

    def value(self, name: str) -> MAVLink_message:
        """PARAM_VALUE of a parameter that exists."""
        parameters = self._parameters
        return mavlink.MAVLink_param_value_message(
            name.encode("ascii"),
            parameters.encoded(name),
            parameters.kind(name),
            len(parameters),
            parameters.names.index(name),
        )

    def _refusal(self, message: MAVLink_message) -> list[MAVLink_message]:
        """What answers for a name that does not exist."""
        if not self._refuses_unknown:
            return []
        return [
            mavlink.MAVLink_param_error_message(
                message.get_srcSystem(),
                message.get_srcComponent(),
                message.param_id.encode("ascii", "replace"),
                NO_PARAMETER,
                mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST,
            )
        ]

    def _hash_check(self) -> MAVLink_message:
        return mavlink.MAVLink_param_value_message(
            HASH_CHECK.encode("ascii"),
            self._parameters.checksum(),
            ParameterType.UINT32,
            len(self._parameters),
            NO_INDEX,
        )
