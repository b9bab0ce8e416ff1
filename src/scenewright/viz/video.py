"""A scene in motion: an MP4, encoded by ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import IO, cast

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.viz.animation import AnimatedScene, Pixels, choose_frame_times

FPS = 25
DPI = 160


def film_scene(
    path: str | Path,
    *,
    scene: SceneRecord,
    proof: Proof | None,
    intersection: IntersectionMap,
    whole: bool = False,
) -> None:
    """Write a scene as an MP4 (H.264): in slow motion round each event, ending soon after the last.

    Args:
        whole: show the scene to its end.

    Raises:
        InputError: there is no ffmpeg, it fails, or the file cannot be written.
    """
    program = find_ffmpeg()
    times = choose_frame_times(scene, fps=FPS, whole=whole)
    animated = AnimatedScene(scene, proof, intersection, dpi=DPI)
    data = _encode(program, (animated.render_frame(float(t)) for t in times))
    write_atomically(path, data)


def find_ffmpeg() -> str:
    """The encoder: that of the package imageio-ffmpeg, else the machine's own.

    Raises:
        InputError: there is neither.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        ffmpeg = shutil.which("ffmpeg")
        if ffmpeg is None:
            raise InputError(
                "an MP4 needs ffmpeg; pip install 'scenewright[video]' installs it"
            ) from None
        return ffmpeg
    return str(imageio_ffmpeg.get_ffmpeg_exe())


def _encode(program: str, frames: Iterator[Pixels]) -> bytes:
    """The frames as an MP4 with its index first, for progressive playback."""
    first = next(frames)
    height, width = (size - size % 2 for size in first.shape[:2])  # yuv420p needs even sizes
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "scene.mp4"
        command = [
            program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", str(FPS), "-i", "-", "-an", "-c:v", "libx264",
            "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-y", str(part),
        ]  # fmt: skip
        # Feed a program on its stdin; InputError with the last line of its stderr if it fails.
        chunks = (frame[:height, :width].tobytes() for frame in chain([first], frames))
        with tempfile.TemporaryFile() as errors:
            try:
                with (
                    subprocess.Popen(command, stdin=subprocess.PIPE, stderr=errors) as encoder,
                    suppress(BrokenPipeError),
                    cast(IO[bytes], encoder.stdin) as sink,
                ):
                    for chunk in chunks:
                        sink.write(chunk)
            except OSError as error:
                raise InputError(f"cannot run {command[0]}: {error.strerror or error}") from error
            errors.seek(0)
            said = errors.read().decode(errors="replace").strip().splitlines()
        if encoder.returncode:
            raise InputError(f"ffmpeg failed: {said[-1] if said else encoder.returncode}")
        return part.read_bytes()
