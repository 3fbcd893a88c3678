"""Message types as defined in the bag itself."""

from __future__ import annotations

from mcap.records import Schema
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from slosh_bag.definitions import ENCODINGS, read_types
from slosh_bag.errors import SloshBagError


class BagTypes:
    """The message types of a bag; each definition is parsed when it is first used.

    Only the bag's own definitions count: an installed package may be of another version.
    """

    def __init__(self) -> None:
        self._typestore: Typestore = get_typestore(Stores.EMPTY)
        self._schemas: dict[str, Schema] = {}
        self._ambiguous: set[str] = set()
        self._known: set[str] = set()

    def add(self, schema: Schema) -> None:
        """Stores the definition of a message type, which an MCAP schema contains."""
        known = self._schemas.setdefault(schema.name, schema)
        if (known.data, known.encoding) != (schema.data, schema.encoding):
            self._ambiguous.add(schema.name)

    def is_ambiguous(self, message_type: str) -> bool:
        """Returns whether the bag has several definitions of a message type that differ."""
        return message_type in self._ambiguous

    def schema(self, message_type: str) -> Schema:
        """Returns the bag's schema of a message type.

        Raises:
            SloshBagError: the bag has none, or several that differ.
        """
        if message_type not in self._schemas:
            raise SloshBagError(f"the bag has no definition of {message_type!r}")
        if message_type in self._ambiguous:
            raise SloshBagError(
                f"the bag has two definitions of {message_type} that differ; `slosh import "
                "rosbag` reads each message by its own and writes them with one"
            )
        return self._schemas[message_type]

    @property
    def learnt(self) -> Typestore:
        """Type store with the definitions of all message types used so far."""
        return self._typestore

    def typestore(self, message_type: str) -> Typestore:
        """Returns a type store that contains a message type and its nested types.

        Raises:
            SloshBagError: as `schema`, or the definition cannot be read.
        """
        # A cut file tells its definitions one after the other: the second may come later.
        if message_type not in self._known or message_type in self._ambiguous:
            schema = self.schema(message_type)
            if schema.encoding not in ENCODINGS:
                raise SloshBagError(
                    f"{message_type} is defined in {schema.encoding!r}; only "
                    f"{' and '.join(ENCODINGS)} can be read"
                )
            try:
                types = read_types(schema.encoding, schema.data.decode(), message_type)
                self._typestore.register(types)
            except (TypesysError, ValueError, LookupError, SyntaxError, RecursionError) as error:
                reason = (str(error).splitlines() or ["it cannot be read"])[0]
                raise SloshBagError(f"the definition of {message_type}: {reason}") from None
            if message_type not in self._typestore.fielddefs:
                raise SloshBagError(f"the definition of {message_type} does not define it")
            self._known.add(message_type)
        return self._typestore
