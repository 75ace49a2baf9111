"""Pictures of MuJoCo's simulations, without a window and without a display."""

from __future__ import annotations

import atexit
import copy
import importlib
import os
import sys
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import DependencyNotInstalled, Error

from curiosity_gym.core import Frame
from curiosity_gym.extras import import_extra
from curiosity_gym.forks import keep_in_children
from curiosity_gym.simulation import MujocoSimulation

if TYPE_CHECKING:
    import mujoco

FURTHER_GEOMS = 1000  # that a picture may show beside the model's own


class MujocoViewer:
    """Draws frames of a width and height (pixels) of simulations of one model.

    It raises Gymnasium's errors without OpenGL, and in a fork of a process that has drawn.
    """

    def __init__(self, model: mujoco.MjModel, *, width: int, height: int) -> None:
        (self._mujoco,) = import_extra("locomotion", "mujoco")
        # Its own: a buffer that has grown makes no other task of the one whose model it is.
        self._model = model = copy.copy(model)
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._data = self._mujoco.MjData(model)
        self._option = self._mujoco.MjvOption()
        self._camera = self._mujoco.MjvCamera()
        if model.ncam:
            self._camera.type = self._mujoco.mjtCamera.mjCAMERA_FIXED
            self._camera.fixedcamid = 0
        self._viewport = self._mujoco.MjrRect(0, 0, width, height)
        self._scene = self._mujoco.MjvScene(model, model.ngeom + FURTHER_GEOMS)
        self._gl = _gl_context(width, height)
        self._gl.make_current()
        font = self._mujoco.mjtFontScale.mjFONTSCALE_100
        self._renderer = self._mujoco.MjrContext(model, font.value)
        buffer = self._mujoco.mjtFramebuffer.mjFB_OFFSCREEN
        self._mujoco.mjr_setBuffer(buffer.value, self._renderer)
        self.close = weakref.finalize(self, _free, self._gl, self._renderer, os.getpid())
        keep_in_children(self, self._gl, self._renderer)
        # Registered after EGL's own farewell, and so called before it.
        atexit.register(self.close)

    def draw(self, simulation: MujocoSimulation, index: int = 0) -> Frame:
        """A frame (height, width, 3) of simulation `index`."""
        _check_process()
        simulation.write_data(index, self._data)
        self._gl.make_current()
        category = self._mujoco.mjtCatBit.mjCAT_ALL.value
        seen = self._model, self._data, self._option, None, self._camera, category
        self._mujoco.mjv_updateScene(*seen, self._scene)
        self._mujoco.mjr_render(self._viewport, self._scene, self._renderer)
        frame = np.empty((self._viewport.height, self._viewport.width, 3), dtype=np.uint8)
        self._mujoco.mjr_readPixels(frame, None, self._viewport, self._renderer)
        return np.ascontiguousarray(frame[::-1])  # OpenGL's first row is the lowest


def _free(gl: Any, renderer: Any, process: int) -> None:
    if process == os.getpid():  # a forked child has inherited what it cannot free
        gl.make_current()
        renderer.free()
        gl.free()


_processes: set[int] = set()  # those that have drawn


def _check_process() -> None:
    if _processes - {os.getpid()}:
        # OpenGL waits for threads that stayed in the parent.
        raise Error(
            "Rendering in a process forked from one that has rendered would hang: start the "
            'processes with another method, such as context="spawn".'
        )


def _gl_context(width: int, height: int) -> Any:
    """An OpenGL context of the library that `MUJOCO_GL` names, or else of the first that works."""
    _check_process()
    chosen, is_linux = os.environ.get("MUJOCO_GL"), sys.platform == "linux"
    names = [chosen] if chosen else [*(("egl", "osmesa") if is_linux else ()), "glfw"]
    reasons = []
    for name in names:
        try:
            context = _open(name, width, height)
        except Exception as error:  # of many kinds, without a library or a device
            reasons.append(f"{name}: {error}")
        else:
            _processes.add(os.getpid())
            return context
    raise DependencyNotInstalled(
        "Rendering needs OpenGL: install EGL or OSMesa (on Debian libegl1 and libgl1-mesa-dri, or "
        "libosmesa6), or set MUJOCO_GL to egl, osmesa or, with a display, glfw "
        f"({'; '.join(reasons)})."
    )


def _open(name: str, width: int, height: int) -> Any:
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if name == "glfw" and sys.platform == "linux" and not has_display:
        raise RuntimeError("no display")  # MuJoCo aborts of it only later
    return importlib.import_module(f"mujoco.{name}").GLContext(width, height)
