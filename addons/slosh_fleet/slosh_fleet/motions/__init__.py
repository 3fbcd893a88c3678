"""Store of the motions of many recordings, as Parquet files for queries over months."""

from typing import Final

PLACE: Final = "out/motions"
"""Default folder of the stored motions."""
