"""Records, reads, plays, imports and exports MCAP bags."""

from typing import TYPE_CHECKING

from slosh_base.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh_bag.reader import BagReader

__all__ = ["BagReader"]

__getattr__ = lazy_names(__name__, {"BagReader": "reader"})
