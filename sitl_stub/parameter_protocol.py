"""The parameter protocol, for reading: ground stations ask for the list before they show a vehicle."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message


def parameter_values(
    message: MAVLink_message, parameters: dict[str, float]
) -> list[MAVLink_message]:
    """The PARAM_VALUE answers to a request for the list or for one parameter.

    A PARAM_SET is answered with the value as it stays: the parameters describe the aircraft flown.
    A parameter that does not exist is not answered.
    """
    names = sorted(parameters)
    if message.get_type() == "PARAM_REQUEST_LIST":
        wanted = names
    elif message.get_type() == "PARAM_REQUEST_READ" and message.param_index >= 0:
        wanted = names[message.param_index : message.param_index + 1]
    else:
        wanted = [name for name in names if name == message.param_id]
    return [
        mavlink.MAVLink_param_value_message(
            name.encode("ascii"),
            parameters[name],
            mavlink.MAV_PARAM_TYPE_REAL32,
            len(names),
            names.index(name),
        )
        for name in wanted
    ]
