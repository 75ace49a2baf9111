"""Pictures of a control task, without a window and without a display."""

from __future__ import annotations

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled

from curiosity_gym.control.simulation import Simulation
from curiosity_gym.extras import import_extra

if TYPE_CHECKING:
    import mujoco

MAX_GEOMS = 1000


class ControlViewer:
    """Draws simulations of one model, from its first camera.

    Args:
        model: The model.
        width: Of a frame, in pixels.
        height: Likewise.

    Raises:
        gymnasium.error.DependencyNotInstalled: If there is no OpenGL to draw with.
    """

    def __init__(self, model: mujoco.MjModel, *, width: int, height: int) -> None:
        (self._mujoco,) = import_extra("control", "mujoco")
        self._model = model
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._data = self._mujoco.MjData(model)
        self._option = self._mujoco.MjvOption()
        self._camera = self._mujoco.MjvCamera()
        self._camera.type = self._mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = 0
        self._viewport = self._mujoco.MjrRect(0, 0, width, height)
        self._scene = self._mujoco.MjvScene(model, MAX_GEOMS)
        self._gl = _gl_context(width, height)
        self._gl.make_current()
        font = self._mujoco.mjtFontScale.mjFONTSCALE_100
        self._renderer = self._mujoco.MjrContext(model, font.value)
        buffer = self._mujoco.mjtFramebuffer.mjFB_OFFSCREEN
        self._mujoco.mjr_setBuffer(buffer.value, self._renderer)

    def draw(self, simulation: Simulation, index: int = 0) -> npt.NDArray[np.uint8]:
        """A frame (height, width, 3) of simulation `index`."""
        simulation.write_data(index, self._data)
        self._gl.make_current()
        self._mujoco.mjv_updateScene(
            self._model,
            self._data,
            self._option,
            None,
            self._camera,
            self._mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        self._mujoco.mjr_render(self._viewport, self._scene, self._renderer)
        frame = np.empty((self._viewport.height, self._viewport.width, 3), dtype=np.uint8)
        self._mujoco.mjr_readPixels(frame, None, self._viewport, self._renderer)
        return np.ascontiguousarray(frame[::-1])  # OpenGL's first row is the lowest

    def close(self) -> None:
        """Free what OpenGL holds, which must be gone before the interpreter is."""
        self._gl.make_current()
        self._renderer.free()
        self._gl.free()


def _gl_context(width: int, height: int) -> Any:
    """An OpenGL context of the library that `MUJOCO_GL` names, or else of the first that works."""
    headless = ("egl", "osmesa") if sys.platform == "linux" else ()
    names = (os.environ["MUJOCO_GL"],) if os.environ.get("MUJOCO_GL") else (*headless, "glfw")
    for name in names:
        # What they raise without a library or a device is of many kinds.
        try:
            if name != "glfw" or sys.platform != "linux" or _has_display():
                return importlib.import_module(f"mujoco.{name}").GLContext(width, height)
        except Exception as error:
            reason = f"{name}: {error}"
    raise DependencyNotInstalled(
        "Rendering needs OpenGL: install EGL or OSMesa (on Debian libegl1 and libgl1-mesa-dri, or "
        f"libosmesa6), or set MUJOCO_GL to egl, osmesa or glfw ({reason})."
    )


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
