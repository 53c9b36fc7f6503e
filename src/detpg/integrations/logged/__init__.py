"""Logged data: what another behaviour did, read to be learnt from with `detpg.replaying`.

In: a Parquet file, a folder of them, or a Minari data set. Out: `detpg.replaying.Logged`.
Next: `detpg.replaying.learn_from`.
"""

from detpg.integrations.logged.reading import read
from detpg.integrations.logged.writing import write
from detpg.replaying import Logged

__all__ = ["Logged", "read", "write"]
