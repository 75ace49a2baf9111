"""A viewer that is made when the first picture is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar


class Viewer(Protocol):
    """Something that draws an environment."""

    def close(self) -> object:
        """Free windows and drawing contexts."""
        ...


V = TypeVar("V", bound=Viewer)


class LazyViewer(Generic[V]):
    """A viewer that is made when it is needed, and is left behind by pickles and copies.

    Args:
        make: Makes the viewer.
    """

    def __init__(self, make: Callable[[], V]) -> None:
        self._make = make
        self._viewer: V | None = None

    def get(self) -> V:
        """The viewer."""
        if self._viewer is None:
            self._viewer = self._make()
        return self._viewer

    def close(self) -> None:
        """Free the viewer, if there is one; the next `get` makes another."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def __getstate__(self) -> dict[str, Any]:
        """Pickle without the viewer, which belongs to its process."""
        return {**self.__dict__, "_viewer": None}
