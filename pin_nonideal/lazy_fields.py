"""Objects whose fields are made when the first of them is asked for, which short runs may never be."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any, TypeVar

from .types import Table

Made = TypeVar("Made", bound="MadeLater")
MAKER = "_make"
_one_at_a_time = RLock()  # of threads that ask; making the fields of one object may ask for another's


class _Plain:
    """What gives objects a table of fields."""


_own: Callable[[Any], Table] = vars(_Plain)["__dict__"].__get__


class MadeLater(_Plain):
    """Fields that come from a function, which is called once one of them is read.

    A field must not be an attribute of the class as well, which would be found first.
    """

    @classmethod
    def later(cls: type[Made], make: Callable[[], Table], **known: Any) -> Made:
        """An object whose fields `make` gives.

        Args:
            make: a function without arguments, called once.
            known: fields that are there at once.
        """
        made = cls.__new__(cls)
        _own(made).update(known, **{MAKER: make})
        return made

    def __getattr__(self, name: str) -> Any:
        # Only what is not there comes here.
        fields = self._fields()
        if name in fields:
            return fields[name]
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)

    def _fields(self) -> Table:
        own = _own(self)
        if MAKER in own:
            with _one_at_a_time:
                if MAKER in own:
                    own.update({**own[MAKER](), **own})
                    del own[MAKER]
        return own

    # What looks into an object, such as `vars`, finds all of its fields.
    __dict__ = property(_fields)
