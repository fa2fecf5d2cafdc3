"""Fast programs for functions of small arrays.

Robot dynamics is thousands of additions and multiplications of single numbers, written
as products of small matrices. XLA on a CPU runs such a program operation by operation,
or fuses it and computes shared values again and again. A function under `kernel` keeps
its readable definition; on a CPU it is expanded into scalar operations (`_expand`), in
which zeros and ones that are known while tracing disappear and equal values are shared
(`_graph`), and given to XLA as one kernel without recomputation (`_emit`). `_primitive`
makes it behave under `jit`, `vmap`, `jvp`, `grad` and inside loops. Elsewhere (GPU,
export, untested versions of jaxlib) the definition runs as it is written.
"""

from ._decorator import kernel as kernel, written_out as written_out
from ._emit import kernels_supported as kernels_supported
from ._graph import NotScalarError as NotScalarError
from ._program import Program as Program
