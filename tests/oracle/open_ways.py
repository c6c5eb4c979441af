"""Shortest ways over open cells, exactly: by what corners and places see of each other."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import dijkstra


def visible(opened, a, b):
    """[N] bool: the straight way from a to b [N, 2] (x, y) leads over open cells only.

    Cells are closed squares of side 1: a way along an edge needs one of the two cells beside it, a
    way through a corner none in particular.
    """
    rows, columns = opened.shape
    lines = np.arange(max(rows, columns) + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cuts = (lines[None, :, None] - a[:, None]) / (b - a)[:, None]
    cuts = np.where(np.isfinite(cuts), np.clip(cuts, 0, 1), 0).reshape(len(a), -1)
    cuts = np.sort(np.concatenate([cuts, np.zeros((len(a), 1)), np.ones((len(a), 1))], axis=1))
    share = 0.5 * (cuts[:, 1:] + cuts[:, :-1])
    middle = a[:, None] + share[..., None] * (b - a)[:, None]
    padded = np.pad(opened, 1)
    clear = np.zeros(share.shape, dtype=bool)
    for dx in (-1e-9, 1e-9):
        for dy in (-1e-9, 1e-9):
            i = np.clip(np.floor(middle[..., 0] + dx), -1, columns).astype(int) + 1
            j = np.clip(np.floor(middle[..., 1] + dy), -1, rows).astype(int) + 1
            clear |= padded[j, i]
    return (clear | (np.diff(cuts) < 1e-9)).all(axis=1)


def lengths(opened, starts, ends):
    """[n, m] length of the shortest way over open cells from each start [n, 2] to each end [m, 2];
    inf: there is none."""
    padded = np.pad(opened, 1)
    around = padded[1:, 1:] + 0 + padded[:-1, 1:] + padded[1:, :-1] + padded[:-1, :-1]
    # a shortest way turns only where something is barred
    corners = np.argwhere((around > 0) & (around < 4))[:, ::-1].astype(float)
    nodes = np.concatenate([starts, ends, corners])
    p, q = np.triu_indices(len(nodes), 1)
    seen = visible(opened, nodes[p], nodes[q])
    apart = np.full((len(nodes), len(nodes)), np.inf)
    apart[p[seen], q[seen]] = np.linalg.norm(nodes[p[seen]] - nodes[q[seen]], axis=1)
    apart = np.minimum(apart, apart.T)
    # a length of 0 would count as no way
    apart = np.where(apart == 0, 1e-12, np.where(np.isinf(apart), 0, apart))
    found = dijkstra(apart, directed=False, indices=np.arange(len(starts)))
    return found[:, len(starts) : len(starts) + len(ends)]
