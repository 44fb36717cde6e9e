"""Messages of a bag decoded, by definitions of the bag, of the user or of a ROS distribution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from haptic_teleop_control.recording.expansion import Damaged

_RULE = "=" * 80 + "\n"


class BagTypes:
    """Decodes messages. What the bag itself says of a type comes first, then ``extra``, then ROS 2 Kilted."""

    def __init__(self, extra: Mapping[str, Any]) -> None:
        self._extra = dict(extra)
        self._default = get_typestore(Stores.ROS2_KILTED)
        if self._extra:
            self._default.register(self._extra)
        self._stores: dict[str, Typestore | None] = {}

    def learn(self, kind: str, encoding: str, text: str) -> None:
        """Take in how the bag defines a type: ``encoding`` is "ros2msg", "ros2idl" or "omgidl"; both empty
        where the bag does not define it. Damaged when that makes no sense."""
        if kind not in self._stores:
            self._stores[kind] = self._store(kind, encoding, text)

    def known(self, kind: str) -> bool:
        """Whether messages of a type that was learned can be decoded."""
        return self._stores[kind] is not None

    def decode(self, kind: str, data: bytes, ros1: bool) -> Any:
        """The message of a type that is known. Damaged when it is none."""
        store = self._stores[kind]
        assert store is not None
        try:
            return store.deserialize_ros1(data, kind) if ros1 else store.deserialize_cdr(data, kind)
        except Exception as error:  # the decoders let struct, index, Unicode and assertion errors through
            raise Damaged(f"a message of type {kind} cannot be decoded") from error

    def _store(self, kind: str, encoding: str, text: str) -> Typestore | None:
        if not text:
            return self._default if kind in self._default.fielddefs else None
        store = get_typestore(Stores.EMPTY)
        try:
            defined = get_types_from_msg(text, kind) if encoding == "ros2msg" else _from_idl(text)
            store.register(defined)
            store.register({name: one for name, one in self._extra.items() if name not in store.fielddefs})
        except Exception as error:  # the parser's own errors have no common base
            raise Damaged(f"its definition of {kind} cannot be understood ({error})") from error
        return store if kind in store.fielddefs else None


def _from_idl(text: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if not text.startswith(f"{_RULE}IDL: "):
        return dict(get_types_from_idl(text))
    for part in text.split(_RULE)[1:]:
        found.update(get_types_from_idl(part.partition("\n")[2]))
    return found
