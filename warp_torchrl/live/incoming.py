"""Messages that a browser may send: four kinds with known fields, and values that fit their control.

viser sets a control to whatever a browser sends for it, and other browsers are shown that. So a message is checked
before viser reads it; what is refused changes nothing.
"""

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import viser
from viser import _messages as sent
from viser.infra._messages import get_type_hints_cached, wire_field_names

from warp_torchrl.live.crew import Refused
from warp_torchrl.system.foreign_text import plain_text

_KINDS = (sent.ViewerCameraMessage, sent.GuiUpdateMessage, sent.CommandTriggerMessage, sent.SceneNodeClickMessage)
_LONGEST = 200  # text of a message [characters]
_SHOWN = 40  # of a value that is refused
_FARTHEST = 1e9  # number of a camera or a click


class Misfit(Refused):
    """A value that does not fit its control.

    Args:
        line: Error message.
        control: The control, which keeps its value.
    """

    def __init__(self, line: str, control: Any) -> None:
        super().__init__(line)
        self.control = control


def _shape(kind: type[Any]) -> type[msgspec.Struct]:
    """Return the exact form of a message of viser."""
    hints = get_type_hints_cached(kind)
    fields = [(name, hints[name]) for name in wire_field_names(kind)]
    return msgspec.defstruct(kind.__name__, fields, tag=kind.__name__, forbid_unknown_fields=True)


_SHAPES = {kind: _shape(kind) for kind in _KINDS}
_WIRE: Any = msgspec.msgpack.Decoder(_SHAPES[_KINDS[0]] | _SHAPES[_KINDS[1]] | _SHAPES[_KINDS[2]] | _SHAPES[_KINDS[3]])


def check(message: bytes, gui: viser.GuiApi | None) -> None:
    """Check a message of a browser.

    Args:
        message: As it came.
        gui: The browser's controls; None before it has any.

    Raises:
        Refused: If it is none that a page of this server sends.
        Misfit: If its value is none of its control's.
    """
    try:
        read = _WIRE.decode(message)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        raise Refused(f"a message cannot be read: {plain_text(str(error), _LONGEST)}") from None
    if isinstance(read, _SHAPES[sent.GuiUpdateMessage]):
        _check_update(read, gui)
        return
    for value in _values(msgspec.structs.astuple(read)):
        if isinstance(value, str) and len(value) > _LONGEST:
            raise Refused(f"a message has a text of {len(value)} characters, at most {_LONGEST} are read")
        if isinstance(value, int | float) and not abs(value) <= _FARTHEST:
            raise Refused(f"a message has the number {value}, and none may be over {_FARTHEST:g}")


def put_back(control: Any) -> None:
    """Send a control's value to the browser again, which replaces the value that the browser shows."""
    if not isinstance(control, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
        control._queue_update("value", control.value)


def _check_update(read: Any, gui: viser.GuiApi | None) -> None:
    control = None if gui is None else gui._gui_input_handle_from_uuid.get(read.uuid)
    if control is None:
        raise Refused("this control is not there any more")
    if set(read.updates) != {"value"}:
        raise Refused("a message changes more of a control than its value")
    check_value(control, read.updates["value"])


def check_value(control: Any, value: object) -> None:
    """Check a value that a browser sends for a control.

    Raises:
        Misfit: If the control cannot have it.
    """
    name = control.label or "a button"
    if control.disabled:
        raise Misfit(f"{name} cannot be changed now", control)
    match control:
        case viser.GuiButtonHandle():
            fits, rule = value is True, "can be pressed alone"
        case viser.GuiCheckboxHandle():
            fits, rule = isinstance(value, bool), "must be on or off"
        case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
            fits, rule = value in control.options, f"must be one of {', '.join(control.options)}"
        case viser.GuiSliderHandle() | viser.GuiNumberHandle():
            fits = _is_number(value, control.value, control.min, control.max)
            rule = f"must be {_kind(control.value)} in {control.min}..{control.max}"
        case viser.GuiVector2Handle():
            lows, highs = control.min, control.max
            fits = (
                isinstance(value, list) and len(value) == 2 and all(map(_is_number, value, control.value, lows, highs))
            )
            rule = f"must be two numbers in {lows[0]:g}..{highs[0]:g} and {lows[1]:g}..{highs[1]:g}"
        case _:
            fits, rule = False, "cannot be changed by a browser"
    if not fits:
        raise Misfit(plain_text(f"{name} {rule}, got {plain_text(str(value), _SHOWN)}"), control)


def _is_number(value: object, present: float, low: float, high: float) -> bool:
    """Return whether a value is a number in its range, and whole where the present one is."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return low <= value <= high and (not isinstance(present, int) or math.floor(value) == value)


def _kind(present: float) -> str:
    return "a whole number" if isinstance(present, int) else "a number"


def _values(value: object) -> Iterator[object]:
    """Return all values in nested tuples."""
    if isinstance(value, tuple | list):
        for each in value:
            yield from _values(each)
    else:
        yield value
