"""numpy's bits on each processor.

numpy computes sines and cosines with AVX-512 where the processor has it, and their last bit differs then. With AVX-512
off they are the same bits on every x86-64 processor.
"""

from __future__ import annotations

import os

__all__ = ["AVX_512", "WITHOUT_AVX_512", "is_without_avx_512"]

AVX_512 = "X86_V4 AVX512_ICL AVX512_SPR AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL"
"""Names of AVX-512 in the releases of numpy; unknown ones are ignored."""

WITHOUT_AVX_512 = {"NPY_DISABLE_CPU_FEATURES": AVX_512}
"""Variables of the environment that numpy reads when it is imported."""


def is_without_avx_512() -> bool:
    """Return whether this process was started so."""
    return os.environ.get("NPY_DISABLE_CPU_FEATURES") == AVX_512
