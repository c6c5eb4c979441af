"""Distance from every cell to the nearest marked cell, by the quickest exact way at hand."""

from __future__ import annotations

import functools

import numpy as np

NO_SEED = np.float32(1e6)
"""Distance [cells] where nothing is marked anywhere."""


def distance_to_zeros(mask: np.ndarray) -> np.ndarray:
    """Distance from each cell's centre to the centre of the nearest cell that is 0.

    Args:
        mask: [J, I] uint8.

    Returns:
        [J, I] float32 [cells], exact to 1e-3; `NO_SEED` where no cell is 0.
    """
    if mask.all():
        return np.full(mask.shape, NO_SEED, dtype=np.float32)
    cv2 = _opencv()
    if cv2 is not None:
        # only the precise mask is exact: 3x3 and 5x5 over-estimate by several cells
        distance = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        # its last bit differs from call to call; the square is a whole number
        distance *= distance
        np.rint(distance, out=distance)
        return np.sqrt(distance, out=distance)
    return distance_without_opencv(mask)


def distance_between_cells(mask: np.ndarray) -> np.ndarray:
    """Least distance from any point of a cell to any point of the nearest cell that is 0.

    Two squares whose centres are (dx, dy) cells apart are (max(|dx| - 1, 0), max(|dy| - 1, 0))
    apart: the distance between centres once every marked cell has grown by its eight neighbours.

    Args:
        mask: [J, I] uint8.

    Returns:
        [J, I] float32 [cells], exact to 1e-3; `NO_SEED` where no cell is 0.
    """
    grown = mask.copy()
    np.minimum(grown[:, 1:], mask[:, :-1], out=grown[:, 1:])
    np.minimum(grown[:, :-1], mask[:, 1:], out=grown[:, :-1])
    rows = grown.copy()
    np.minimum(grown[1:], rows[:-1], out=grown[1:])
    np.minimum(grown[:-1], rows[1:], out=grown[:-1])
    return distance_to_zeros(grown)


def distance_without_opencv(mask: np.ndarray) -> np.ndarray:
    """The same by Taichi kernels alone; [J, I] float32 [cells]."""
    from passpmp_ti.kernels.distance import column_distance, row_distance

    column = np.empty(mask.shape, dtype=np.int32)
    distance = np.empty(mask.shape, dtype=np.float32)
    column_distance(mask, column)
    row_distance(column, distance)
    return distance


@functools.cache
def _opencv():
    try:
        import cv2
    except ImportError:
        return None
    return cv2
