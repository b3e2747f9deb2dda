"""The same bits on every x86-64 processor with FMA: without the kernels that only some of them have.

Without FMA the C library's own sines and powers round otherwise, and some motions differ by 1e-10 m.
"""

import os
import platform
from importlib.metadata import version

COMMON_KERNELS = "Prescott"  # of OpenBLAS, which no x86-64 processor lacks
# of NumPy's sines and powers, which some lack; their names in NumPy 2.4, before which they were others
RARE_KERNELS = "X86_V4 AVX512_ICL AVX512_SPR"
NAMED_SO_FROM = (2, 4)
RARE_KERNELS_BEFORE = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"


def choose_common_kernels() -> None:
    """Let NumPy and SciPy, which must not be loaded yet, compute as they would anywhere else.

    The matrices are so small that quicker kernels save nothing. `NPY_DISABLE_CPU_FEATURES`, where it is
    stated, stays: a NumPy that was built for AVX-512 alone takes no other.
    """
    if platform.machine().lower() in ("x86_64", "amd64"):
        major, minor = map(int, version("numpy").split(".")[:2])
        rare = RARE_KERNELS if (major, minor) >= NAMED_SO_FROM else RARE_KERNELS_BEFORE
        os.environ["OPENBLAS_CORETYPE"] = COMMON_KERNELS
        os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", rare)
