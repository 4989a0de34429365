"""Objects whose fields are computed on first access."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any, TypeVar

from pin_nonideal.types import Table

Made = TypeVar("Made", bound="LazyFields")
FACTORY = "_make"
_one_at_a_time = RLock()  # reentrant, since the fields of one object may need those of another


class _DictBase:
    """Base class that provides the instance dictionary."""


_own: Callable[[Any], Table] = vars(_DictBase)["__dict__"].__get__


class LazyFields(_DictBase):
    """Base class of objects whose fields are computed by a function on first access.

    A field must not be a class attribute as well, since Python finds class attributes first.
    """

    @classmethod
    def later(cls: type[Made], make: Callable[[], Table], **known: Any) -> Made:
        """Return an object whose fields are computed by `make`.

        Args:
            make: a function without arguments, called once.
            known: fields that are available at once.
        """
        instance = cls.__new__(cls)
        _own(instance).update(known, **{FACTORY: make})
        return instance

    def __getattr__(self, name: str) -> Any:
        # Python calls this method for missing attributes only.
        fields = self._fields()
        if name in fields:
            return fields[name]
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)

    def _fields(self) -> Table:
        lazy = _own(self)
        if FACTORY in lazy:
            with _one_at_a_time:
                if FACTORY in lazy:
                    lazy.update({**lazy[FACTORY](), **lazy})
                    del lazy[FACTORY]
        return lazy

    # `vars` and similar functions return all fields.
    __dict__ = property(_fields)
