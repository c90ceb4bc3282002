# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of something as large as a vehicle in the middle of its run, for a tenth of what it takes to get there."""

import ctypes
import gc
import io
import pickle
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from struct import Struct
from types import CellType, CodeType, FunctionType
from typing import Any, Final, Generic, TypeVar, cast

from librt.vecs import vec

from ap_core.param_info import ParamInfo

_HEAD: Final = object.__basicsize__
_allocate: Final = ctypes.pythonapi.PyType_GenericAlloc
_allocate.argtypes, _allocate.restype = (ctypes.py_object, ctypes.c_ssize_t), ctypes.py_object
_incref: Final = ctypes.pythonapi.Py_IncRef
_incref.argtypes, _incref.restype = (ctypes.py_object,), None

T = TypeVar("T")

_PACKAGES: Final = ("ap_core", "ap_visualodom", "ekf_stub", "mav_handlers", "viso")
_PLAIN: Final = (type(None), int, float, str, bytes)
_VEC: Final = type(vec[float]([]))


class Copies(Generic[T]):
    """Something as it is now, of which any number of copies can be made.

    A copy behaves as the original would have: it has a state of its own, and functions that work on that. Constants of
    this project's modules, which are compared by identity, and functions without a state are common to all.

    Args:
        original: what to copy; it may go on, the copies stay as they are.

    Raises:
        TypeError: there is something in it that cannot be copied, such as an open file.
    """

    def __init__(self, original: T) -> None:
        data = io.BytesIO()
        writer = _Writer(data)
        writer.dump(original)
        self._data = data.getvalue()
        self._common = writer.common

    def make(self) -> T:
        """Return another copy."""
        return cast(T, _Reader(io.BytesIO(self._data), self._common).load())


class _Writer(pickle.Pickler):
    """Writes everything but ``common``, which it collects, and takes functions with a state apart."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        modules = list(sys.modules.items())
        ours = [vars(module) for name, module in modules if name.partition(".")[0] in _PACKAGES]
        values = (value for names in ours for value in names.values() if not isinstance(value, _PLAIN))
        self._constants = {*map(id, values), *(id(vars(module)) for _, module in modules)}
        self._numbers: dict[int, int] = {}
        self.common: list[object] = []

    def persistent_id(self, obj: object) -> int | None:
        is_common = (
            obj.__closure__ is None
            if isinstance(obj, FunctionType)
            else isinstance(obj, (CodeType, Struct, ParamInfo, _Template)) or id(obj) in self._constants
        )
        if not is_common:
            return None
        number = self._numbers.setdefault(id(obj), len(self.common))
        if number == len(self.common):
            self.common.append(obj)
        return number

    def reducer_override(self, obj: object) -> Any:
        if isinstance(obj, FunctionType):
            return _function, (obj.__code__, obj.__globals__, obj.__name__, obj.__defaults__, obj.__closure__)
        if isinstance(obj, CellType):
            # Filled later, for a function may be in what it works on.
            return _cell, (), obj.cell_contents, None, None, _fill
        if type(obj) is _VEC:
            return _vec, (list(obj),)
        if attributes := getattr(type(obj), "__mypyc_attrs__", ()):
            state = {name: getattr(obj, name) for name in attributes if hasattr(obj, name)}
            return _blank, (_Template(obj),), state, None, None, _set_attributes
        if is_dataclass(type(obj)) and not hasattr(obj, "__dict__"):
            # The way of dataclasses themselves takes three times as long.
            values = tuple(getattr(obj, name) for name in _names(type(obj)))
            return object.__new__, (type(obj),), values, None, None, _set_fields
        return NotImplemented


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, common: list[object]) -> None:
        super().__init__(file)
        self._common = common

    def persistent_load(self, pid: int) -> object:
        return self._common[pid]


def _function(*parts: Any) -> Callable[..., object]:
    return FunctionType(*parts)


def _cell() -> CellType:
    return CellType()


def _vec(numbers: list[float]) -> "vec[float]":
    return vec[float](numbers)


class _Template:
    """An object of a compiled class, which others are made after."""

    def __init__(self, original: object) -> None:
        self.original = original


def _blank(template: _Template) -> object:
    """Return an object of a compiled class that has what another one has, for the moment.

    Compiled classes make no object without a call of ``__init__``, whose arguments nobody knows any more.
    """
    original = template.original
    cls = type(original)
    made: object = _allocate(cls, 0)
    for part in gc.get_referents(original):
        _incref(part)
    ctypes.memmove(id(made) + _HEAD, id(original) + _HEAD, cls.__basicsize__ - _HEAD)
    return made


def _set_attributes(obj: object, state: dict[str, object]) -> None:
    for name in cast(Any, type(obj)).__mypyc_attrs__:
        if name in state:
            setattr(obj, name, state[name])
        elif hasattr(obj, name):
            delattr(obj, name)


def _fill(cell: CellType, contents: object) -> None:
    cell.cell_contents = contents


def _field_names(cls: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(cls))


_names: Final[Callable[[Any], tuple[str, ...]]] = cache(_field_names)


def _set_fields(obj: object, values: tuple[object, ...]) -> None:
    for name, value in zip(_names(type(obj)), values, strict=True):
        object.__setattr__(obj, name, value)
