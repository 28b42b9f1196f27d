"""Products of tall tables by BLAS that leave the interpreter to the other thread.

The routines of `scipy.linalg.blas` are held by the interpreter's lock: of two threads that factor, each waits for the other.
Those that SciPy offers to Cython (`scipy.linalg.cython_blas`) are the same, and called by address they are not.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from scara_ident.arrays import Array

_ONE = ctypes.byref(ctypes.c_double(1.0))


def solve_rows(upper: Array, table: Array) -> None:
    """Solve ``x @ upper = row`` for every row, in place.

    Parameters
    ----------
    upper : ndarray, shape (k, k)
        Upper triangular, in Fortran's order.
    table : ndarray, shape (k, N)
        The rows, each a column of it, in C's order.
    """
    size, count = (ctypes.byref(ctypes.c_int(number)) for number in table.shape)
    _of("dtrsm")(b"R", b"U", b"N", b"N", count, size, _ONE, _at(upper), size, _at(table), count)


def add_products(table: Array, gram: Array) -> None:
    """Add ``table @ table.T`` to the upper half of a matrix, in place.

    Parameters
    ----------
    table : ndarray, shape (k, N)
        In C's order.
    gram : ndarray, shape (k, k)
        In Fortran's order.
    """
    size, count = (ctypes.byref(ctypes.c_int(number)) for number in table.shape)
    _of("dsyrk")(b"U", b"T", size, count, _ONE, _at(table), count, _ONE, _at(gram), size)


def _at(array: Array) -> ctypes.c_void_p:
    assert array.dtype == np.float64
    return ctypes.c_void_p(array.ctypes.data)


@cache
def _of(name: str) -> Callable[..., Any]:
    """Return a routine by the address that its capsule holds; numbers are passed by reference, as Fortran has it."""
    from scipy.linalg import cython_blas

    capsule = cython_blas.__pyx_capi__[name]
    named, held = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    named.restype, named.argtypes = ctypes.c_char_p, [ctypes.py_object]
    held.restype, held.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    return ctypes.CFUNCTYPE(None)(held(capsule, named(capsule)))
