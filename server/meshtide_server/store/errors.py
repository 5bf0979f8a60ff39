"""What can go wrong with a store.

::

    TransferError
    └── StoreError                 the store did not do what it was asked to
        ├── MissingObjectError     there is no object of that key
        ├── MissingBucketError     there is no such bucket
        ├── DamagedObjectError     the bytes of an object are not those that were put
        ├── ObjectRangeError       the range lies outside of the object (also a ValueError)
        └── InvalidKeyError        the key is not one (also a ValueError)
"""

from __future__ import annotations

from meshtide_codec.errors import TransferError


class StoreError(TransferError):
    """The store did not do what it was asked to; nothing was changed, or the change is whole."""


class MissingObjectError(StoreError):
    """There is no object of that key.

    Args:
        key: what was asked for.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__(f"there is no object {key!r} in the store")


class MissingBucketError(StoreError):
    """There is no such bucket; a store that is a folder makes it when it is opened."""


class DamagedObjectError(StoreError):
    """The bytes of an object are not those that were put."""


class ObjectRangeError(StoreError, ValueError):
    """A range lies outside of its object.

    Args:
        key: the object.
        start: first byte that was asked for.
        end: one past the last byte that was asked for.
        size: of the object in bytes, or None if it was not looked at.
    """

    def __init__(self, key: str, start: int, end: int, size: int | None = None) -> None:
        self.key = key
        of = "" if size is None else f" of {size} bytes"
        super().__init__(f"bytes {start} to {end} are not a range of object {key!r}{of}")


class InvalidKeyError(StoreError, ValueError):
    """A key that no object can have."""
