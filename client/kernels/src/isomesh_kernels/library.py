"""The compiled library, as kernels.cpp declares it: runs that make one mesh each."""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Optional, Tuple

import numpy

if TYPE_CHECKING:
    from isomesh_client import Raw

_LOOK_MS = 50  # between two looks at a run: so long an interrupt may wait


class _Volume(ctypes.Structure):
    _fields_ = [
        ("samples", ctypes.c_void_p),
        ("type", ctypes.c_char_p),
        ("dims", ctypes.c_uint32 * 3),
        ("origin", ctypes.c_double * 3),
        ("spacing", ctypes.c_double * 3),
        ("direction", ctypes.c_double * 9),
        ("left_out", ctypes.c_uint64),
        ("memory_bytes", ctypes.c_uint64),
        ("is_ct", ctypes.c_int32),
    ]


class _Made(ctypes.Structure):
    _fields_ = [
        ("vertices", ctypes.c_void_p),
        ("triangles", ctypes.c_void_p),
        ("labels", ctypes.c_void_p),
        ("colors", ctypes.c_void_p),
        ("vertex_count", ctypes.c_uint64),
        ("triangle_count", ctypes.c_uint64),
        ("job", ctypes.c_char_p),
        ("error", ctypes.c_char_p),
        ("kind", ctypes.c_char_p),
    ]


def _loaded() -> Any:
    path = Path(__file__).with_name("_kernels.so")
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(
            f"isomesh_kernels cannot load its library: {error}. Install the wheel for this machine, "
            "or the folder python of a build with -D ISOMESH_KERNELS=ON"
        ) from error
    run = ctypes.c_void_p
    volume = ctypes.POINTER(_Volume)
    library.isomesh_order.argtypes, library.isomesh_order.restype = [volume, ctypes.POINTER(ctypes.c_int32 * 3)], None
    library.isomesh_start.argtypes, library.isomesh_start.restype = [volume, ctypes.c_char_p], run
    library.isomesh_wait.argtypes = [run, ctypes.c_int32, ctypes.POINTER(ctypes.c_double)]
    library.isomesh_wait.restype = ctypes.c_bool
    library.isomesh_result.argtypes, library.isomesh_result.restype = [run], _Made
    library.isomesh_free.argtypes, library.isomesh_free.restype = [run], None
    library.isomesh_set_threads.argtypes, library.isomesh_set_threads.restype = [ctypes.c_int32], None
    return library


_library = _loaded()
_used_by: List[int] = []  # the process whose threads make the meshes, once there are any


def _volume_of(raw: Raw) -> Any:
    return _Volume(
        None,
        raw.type.encode(),
        (ctypes.c_uint32 * 3)(*raw.dims),
        (ctypes.c_double * 3)(*raw.origin),
        (ctypes.c_double * 3)(*raw.spacing),
        (ctypes.c_double * 9)(*raw.direction),
    )


def in_order(samples: Any, raw: Raw) -> Tuple[Any, Raw]:
    """A view of the samples in the order in which a server stores volumes: indices grow towards the patient's left, back and
    head, as nearly as the directions allow. So the mesh does not depend on the order of the array's axes."""
    volume, axes = _volume_of(raw), (ctypes.c_int32 * 3)()
    _library.isomesh_order(ctypes.byref(volume), ctypes.byref(axes))
    view = samples.transpose([abs(axis) - 1 for axis in axes])[tuple(slice(None, None, -1 if axis < 0 else 1) for axis in axes)]
    ordered = dataclasses.replace(
        raw,
        dims=tuple(volume.dims),
        origin=tuple(volume.origin),
        spacing=tuple(volume.spacing),
        direction=tuple(volume.direction),
    )
    return view, ordered


class Run:
    """A mesh that is made. ctypes lets other threads of Python run during every call."""

    def __init__(
        self, samples: Any, raw: Raw, left_out: int, is_ct: bool, memory_bytes: int, parameters: Mapping[str, Any]
    ) -> None:
        if _used_by not in ([], [os.getpid()]):
            raise RuntimeError(
                "isomesh_kernels had made a mesh before this process was forked, so its threads are missing here; "
                'start processes with multiprocessing.get_context("spawn")'
            )
        _used_by[:] = [os.getpid()]
        volume = _volume_of(raw)
        volume.samples = samples.ctypes.data
        volume.left_out, volume.memory_bytes, volume.is_ct = left_out, memory_bytes, is_ct
        self._run = _library.isomesh_start(ctypes.byref(volume), json.dumps(parameters).encode())
        if not self._run:
            raise MemoryError("there is no memory or no thread for a mesh")
        # The samples have to stay until the run has ended, however this object ends.
        self._held = [samples]
        self._free = weakref.finalize(self, _freed, self._run, self._held)

    def wait(self, progress: Optional[Callable[[float], object]]) -> _Made:
        """Waits for the end. An interrupt, or an exception of `progress`, cancels the run."""
        share, told = ctypes.c_double(), -1.0
        try:
            while not _library.isomesh_wait(self._run, _LOOK_MS, ctypes.byref(share)):
                if progress is not None and share.value != told:
                    told = share.value
                    progress(told)
        except BaseException:
            self._free()
            raise
        self._held.clear()
        made: _Made = _library.isomesh_result(self._run)
        if made.error is None and progress is not None:
            progress(1.0)
        return made

    def array(self, address: Optional[int], count: int, kind: str, columns: int) -> Any:
        """An array in the memory of the run, which lives as long as the array."""
        shape: Tuple[int, ...] = (count, columns) if columns > 1 else (count,)
        if not count or not address:
            return numpy.empty(shape, kind)
        size = count * columns * numpy.dtype(kind).itemsize
        memory: Any = (ctypes.c_char * size).from_address(address)
        memory.owner = self
        return numpy.frombuffer(memory, kind).reshape(shape)


def _freed(run: int, _held: Any) -> None:
    _library.isomesh_free(run)


def set_threads(threads: int) -> None:
    """How many threads all meshes share. Default: the number of processors. Call it while none is made."""
    if threads < 1:
        raise ValueError(f"threads must be at least 1, not {threads}")
    _library.isomesh_set_threads(threads)


def physical_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
