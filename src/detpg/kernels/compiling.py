"""How the pieces of a compiled loop are compiled."""

from numba.extending import register_jitable

# As in C: a product and a sum may be one operation, but sums keep their order, and a number that is
# not finite stays so. Pieces are inlined where they are called; they allocate nothing and count no
# references to their arrays, which the loop holds (docs/decisions/0023).
piece = register_jitable(fastmath={"contract"}, error_model="numpy", forceinline=True, _nrt=False)
