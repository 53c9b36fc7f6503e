"""Stop between the worlds and the algorithms: what happened, kept to be recalled.

In: transitions as they happened, in raw units. Out: batches drawn at random, of one step or of n.
Next: `detpg.algorithms` that learn from recalled batches.
"""

from detpg.memory.ring import Memory, cut, empty, num_bytes, recall, remember

__all__ = ["Memory", "cut", "empty", "num_bytes", "recall", "remember"]
