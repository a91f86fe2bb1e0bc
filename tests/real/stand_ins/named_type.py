"""Message classes for rclpy by nothing but a name, where no package of theirs can be had: for bytes only.

What rclpy and Fast DDS want to know of a type is taken from that of ``std_msgs/msg/String``, with another
name in it. Such a class can be published as bytes and heard raw, and shows in the ROS graph by its name.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path
from typing import Any

_FAST, _INTROSPECTION = "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"
_kept: list[Any] = []


class _TypeSupport(ctypes.Structure):
    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("find", ctypes.c_void_p),
        ("more", ctypes.c_void_p * 3),
    )


class _Callbacks(ctypes.Structure):
    _fields_ = (("namespace", ctypes.c_char_p), ("name", ctypes.c_char_p), ("more", ctypes.c_void_p * 5))


_Find = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)


def named_type(package: str, name: str) -> Any:
    """A message class of this name."""
    import std_msgs.msg  # noqa: F401, it loads what the libraries below rest on

    model = _TypeSupport.from_address(_of_string(_FAST))
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(model.data or 0))
    callbacks.namespace, callbacks.name = f"{package}::msg".encode(), name.encode()
    support = _TypeSupport.from_buffer_copy(model)
    support.data = ctypes.addressof(callbacks)

    def find(own: int, wanted: bytes) -> int | None:
        if wanted == _FAST.encode():
            return own
        return _of_string(_INTROSPECTION) if wanted == _INTROSPECTION.encode() else None

    finder = _Find(find)
    support.find = ctypes.cast(finder, ctypes.c_void_p)
    _kept.append((callbacks, support, finder))
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype = ctypes.py_object
    capsule.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    unused = dict.fromkeys(
        ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE"), 0
    )
    held = {"_TYPE_SUPPORT": capsule(ctypes.addressof(support), None, None), **unused}
    return type(f"Metaclass_{name}", (type,), held)(name, (), {})


def _of_string(kind: str) -> int:
    found = next(Path(sys.prefix).rglob(f"libstd_msgs__{kind}.so"))
    handle = getattr(
        ctypes.CDLL(str(found)), f"{kind}__get_message_type_support_handle__std_msgs__msg__String"
    )
    handle.restype = ctypes.c_void_p
    return int(handle())
