"""Run a program with Debian's torch: `python with_debian_torch.py PROGRAM [ARGUMENT...]`.

Debian 12 has torch 1.13 for the processor alone (56 MB; a wheel of torch from PyPI takes 4.6 GB). It was compiled for
numpy 1, while we need numpy 2, so arrays and tensors pass by DLPack, which both know. All arithmetic is torch's own.
"""

from __future__ import annotations

import runpy
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

warnings.filterwarnings("ignore", message="Failed to initialize NumPy")
import torch  # noqa: E402 - warns when it is imported


def _taking_arrays(make: Callable[..., Any]) -> Callable[..., Any]:
    """Return a maker of tensors that takes arrays of numpy, too."""

    def wrapped(data: Any, *args: Any, **options: Any) -> Any:  # noqa: ANN401
        if isinstance(data, np.ndarray):
            data = torch.from_dlpack(np.require(data, requirements=["C", "W"]))
        return make(data, *args, **options)

    return wrapped


torch.as_tensor = _taking_arrays(torch.as_tensor)
torch.tensor = _taking_arrays(torch.tensor)
torch.from_numpy = torch.from_dlpack
torch.Tensor.numpy = lambda self: np.from_dlpack(self.detach())

if __name__ == "__main__":
    sys.argv = sys.argv[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
