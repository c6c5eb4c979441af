"""The devices of a robot's file: how they are reached, and those that are emulated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from hardware.config import DriveConfig
from hardware.emulated_process import BASE, EmulatedConfig, EmulatedProcess
from hardware.scip_settings import ScipSettings


@contextmanager
def devices(config: DriveConfig) -> Iterator[tuple[list[ScipSettings], str, dict[str, Any]]]:
    """Settings of the range finders, what makes the base, and what that is called with. Those that
    are emulated live while this is open.

    Raises:
        RuntimeError: emulated ones do not start.
    """
    if config.emulated is None:
        real = [lidar.scip for lidar in config.lidars if lidar.scip is not None]
        yield real, config.base.made_by.build, config.base_options()
        return
    process = EmulatedProcess(
        EmulatedConfig(
            directory=config.directory,
            scenario=config.emulated.scenario,
            seed=config.emulated.seed,
            mounts=tuple(lidar.mount for lidar in config.lidars),
            # errors are cut at three deviations: what is declared holds
            noise=min(lidar.range_noise for lidar in config.lidars) / 3.0,
            limits=config.limits,
        )
    )
    try:
        emulated = [
            ScipSettings(host="127.0.0.1", port=port, range_max=lidar.range_max)
            for port, lidar in zip(process.ports, config.lidars, strict=True)
        ]
        address = str(config.directory / BASE)
        yield (
            emulated, "hardware.base_link:build", {"address": address, **asdict(config.limits)},
        )  # fmt: skip
    finally:
        process.close()
