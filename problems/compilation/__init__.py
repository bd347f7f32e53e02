"""Compilation of kernels: a notice if it takes long, interpretation where that is faster, and numba's cache.

Importing this package registers the notice, and the digests by which kernels in the cache are up to date.
"""

from . import cached_kernels as _cached_kernels  # noqa: F401
from . import notice as _notice  # noqa: F401
