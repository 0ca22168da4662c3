"""Names of the array types used in annotations: the name states the element type, the docstring the shape."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Complex64 = NDArray[np.complex64]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]
Byte = NDArray[np.uint8]
Image = Byte
"""A camera image: (rows, columns) grey or (rows, columns, 3) colour."""


def runs_of(mask: Bool) -> list[slice]:
    """Return the runs of neighbouring true cells of a mask (N,)."""
    edge = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return [slice(int(first), int(end)) for first, end in zip(edge[::2], edge[1::2], strict=True)]


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a C-contiguous view or copy that cannot be written to: kernels are compiled for this kind."""
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view
