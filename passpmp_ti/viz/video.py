"""Videos that browsers play, written frame by frame."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO, Protocol

import cv2
import numpy as np

from passpmp_ti import door

H264 = (
    "-c:v",
    "libx264",
    "-preset",
    "veryfast",
    "-crf",
    "23",
    "-pix_fmt",
    "yuv420p",
    "-movflags",
    "+faststart",
)


def ffmpeg() -> str | None:
    """Path of an ffmpeg program: the one imageio-ffmpeg brings, or the system's; else None."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return shutil.which("ffmpeg")


class VideoWriter:
    """Streams frames into a file, as a context manager.

    H.264 in MP4 by ffmpeg; VP8 in WebM by OpenCV where there is no ffmpeg. `path` tells which.
    """

    def __init__(self, path: str | Path, size: tuple[int, int], fps: float) -> None:
        """Open a video.

        Args:
            path: of the file; its suffix is replaced by that of the format.
            size: (width, height) of every frame [px], both even.
            fps: frames a second.

        Raises:
            ValueError: an odd or empty size, or fps that is not > 0.
            RuntimeError: neither ffmpeg nor OpenCV can write a video here.
        """
        width, height = size
        if width < 2 or height < 2 or width % 2 or height % 2:
            raise ValueError(f"VideoWriter.size must be even and > 0 [px]; got {size!r}")
        self.size = (int(width), int(height))
        self.fps = door.finite("VideoWriter", "fps", fps, above=0.0, unit="1/s")
        self.frames = 0
        """Written so far."""
        program = ffmpeg()
        path = Path(path)
        self._sink: _Sink
        if program is not None:
            self.path = path.with_suffix(".mp4")
            self._sink = _Pipe(program, self.path, self.size, self.fps)
        else:
            self.path = path.with_suffix(".webm")
            self._sink = _WebM(self.path, self.size, self.fps)

    def write(self, frame: np.ndarray) -> None:
        """Append a frame [H, W, 3] uint8 (red, green, blue).

        Raises:
            ValueError: a frame of another shape or type.
            RuntimeError: the encoder gave up; its own words follow.
        """
        wanted = (self.size[1], self.size[0], 3)
        if frame.shape != wanted or frame.dtype != np.uint8:
            raise ValueError(
                f"VideoWriter.write: frames are uint8 {wanted}; got {frame.dtype} {frame.shape}"
            )
        self._sink.write(np.ascontiguousarray(frame))
        self.frames += 1

    def close(self) -> None:
        """Finish the file.

        Raises:
            RuntimeError: the encoder failed; its own words follow.
        """
        self._sink.close()

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _Sink(Protocol):
    def write(self, frame: np.ndarray) -> None: ...

    def close(self) -> None: ...


class _Pipe:
    def __init__(self, program: str, path: Path, size: tuple[int, int], fps: float) -> None:
        raw = (
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-s",
            f"{size[0]}x{size[1]}",
            "-r",
            f"{fps:g}",
            "-i",
            "-",
        )
        command = [program, "-y", "-loglevel", "error", *raw, "-an", *H264, str(path)]
        # a file, not a pipe: nobody reads it while frames are written
        self._words: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        # a group of its own: Ctrl-C ends the drive, and the video is still finished
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._words,
            start_new_session=True,
        )

    def write(self, frame: np.ndarray) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(frame.data)
        except BrokenPipeError:
            self._process.wait()
            raise RuntimeError(f"ffmpeg stopped: {self._said()}") from None

    def close(self) -> None:
        if self._words.closed:
            return
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # the exit status tells
            self._process.stdin.close()
        status = self._process.wait()
        said = self._said()
        self._words.close()
        if status != 0:
            raise RuntimeError(f"ffmpeg ended with status {status}: {said}")

    def _said(self) -> str:
        self._words.seek(0)
        return self._words.read().decode(errors="replace").strip()[-500:]


class _WebM:
    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        code = cv2.VideoWriter.fourcc(*"VP80")
        self._writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, fps, size)
        if not self._writer.isOpened():
            raise RuntimeError(
                "no way to write a video here: install imageio-ffmpeg, or leave the video out"
            )

    def write(self, frame: np.ndarray) -> None:
        self._writer.write(frame[:, :, ::-1])

    def close(self) -> None:
        self._writer.release()
