"""Ask the model of the future directly: who could be where, when, and how fast is still safe."""

from __future__ import annotations

import numpy as np

import passpmp_ti as pti


def sweep() -> pti.Scan:
    """From the middle of a corridor 4 m wide along x; its walls are known to stay.

    Beams along the corridor meet nothing within range: beyond, anything may wait.
    """
    bearings = -np.pi + np.arange(1440) * np.pi / 720
    with np.errstate(divide="ignore"):
        ranges = 2.0 / np.abs(np.sin(bearings))
    return pti.Scan(
        ranges, bearings[0], np.pi / 720, range_max=8.0, pose=(0, 0, 0), stamp=100.0,
        moving=np.zeros(1440, dtype=bool),
    )  # fmt: skip


def picture(layer: np.ndarray, cells: int) -> list[str]:
    """A layer as lines of text, one character for `cells` x `cells` cells, y upwards."""
    rows, columns = (n // cells for n in layer.shape)
    blocks = layer[: rows * cells, : columns * cells].reshape(rows, cells, columns, cells)
    taken = blocks.any(axis=(1, 3))
    free = np.flatnonzero(~taken.all(axis=1))
    shown = taken[max(free.min() - 1, 0) : free.max() + 2] if len(free) else taken[:1]
    return ["".join("#" if c else "." for c in row) for row in shown[::-1]]


def main() -> None:
    pti.init()
    robot = pti.DifferentialDrive()
    settings = pti.Settings.for_robot(robot, object_speed=1.5, layer_length=0.5)
    future = pti.FutureModel.from_scan(sweep(), robot, settings)

    print("Could anything touch a robot whose centre is at (x, 0), that long after the scan?")
    xs, waits = np.array([0.0, 2.0, 4.0, 6.0]), np.array([0.1, 1.0, 2.0, 3.0, 4.0, 5.0])
    print("          " + "".join(f"{w:6.1f} s" for w in waits))
    for x in xs:
        points = np.column_stack([np.full(len(waits), x), np.zeros(len(waits))])
        answers = future.occupied(points, future.stamp + waits)
        print(f"x = {x:3.0f} m " + "".join("     yes" if a else "      no" for a in answers))

    print("\nFastest speed along the corridor that is p-safe 0.1 s after the scan:")
    speeds = np.arange(0.0, robot.wheel_speed, 0.05)
    for x in xs:
        states = np.zeros((len(speeds), 5))
        states[:, 0] = x
        states[:, 3:5] = speeds[:, None]
        safe = future.passively_safe(states, np.full(len(speeds), future.stamp + 0.1))
        print(f"x = {x:3.0f} m: {speeds[safe].max():.2f} m/s")

    layers = future.layers()
    share = 1 - layers[:, future.seen].mean(axis=1)
    print(f"\n{len(layers)} layers of {settings.layer_length:g} s; free share of what was seen:")
    print(" ".join(f"{100 * s:.0f}%" for s in share))
    for index in (0, 4):
        print(f"\nLayer {index} ('#': a robot centred there could be touched):")
        print("\n".join(picture(layers[index], 8)))


if __name__ == "__main__":
    main()
