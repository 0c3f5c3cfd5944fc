"""LinuxCNC's own kinematics modules, called beside a stub of its HAL: pins are numbers that a test sets by name."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

MODULES = Path("/usr/lib/linuxcnc/modules")
STUB = r"""
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static struct { char name[64]; void *value; } pins[512];
static int count;
static void keep(const char *format, va_list names, void *value) {
    vsnprintf(pins[count].name, 64, format, names);
    pins[count++].value = value;
}
void *stub_pin(const char *name) {
    for (int i = 0; i < count; i++) if (!strcmp(pins[i].name, name)) return pins[i].value;
    return 0;
}
void stub_clear(void) { count = 0; }
int hal_init(const char *name) { return 1; }
int hal_exit(int id) { return 0; }
int hal_ready(int id) { return 0; }
void *hal_malloc(long size) { return calloc(1, size); }
void rtapi_print(const char *format, ...) {}
void rtapi_print_msg(int level, const char *format, ...) {}
#define PIN(name) int name(int way, void **pin, int id, const char *format, ...) { \
    va_list names; va_start(names, format); *pin = calloc(1, 8); keep(format, names, *pin); va_end(names); return 0; }
PIN(hal_pin_float_newf)
PIN(hal_pin_s32_newf)
PIN(hal_pin_u32_newf)
PIN(hal_pin_bit_newf)
int hal_param_float_newf(int way, double *value, int id, const char *format, ...) {
    va_list names; va_start(names, format); keep(format, names, value); va_end(names); return 0; }
int hal_pin_bit_new(const char *name, int way, void **pin, int id) { *pin = calloc(1, 8); return 0; }
int hal_pin_s32_new(const char *name, int way, void **pin, int id) { *pin = calloc(1, 8); return 0; }
"""


class Module:
    """One kinematics module with its pins set; joints and poses in its own units, mm and degrees."""

    def __init__(self, name: str, pins: dict[str, float], folder: Path) -> None:
        if not (MODULES / f"{name}.so").exists() or not shutil.which("gcc"):
            pytest.skip("needs linuxcnc-uspace and gcc")
        stub = folder / "hal_stub.so"
        if not stub.exists():
            (folder / "hal_stub.c").write_text(STUB)
            subprocess.run(["gcc", "-shared", "-fPIC", "-w", "-o", stub, folder / "hal_stub.c"], check=True)
        hal = ctypes.CDLL(str(stub), ctypes.RTLD_GLOBAL)
        hal.stub_pin.restype = ctypes.POINTER(ctypes.c_double)
        hal.stub_clear()
        self.module = ctypes.CDLL(
            shutil.copy(MODULES / f"{name}.so", folder / f"{name}{len(list(folder.iterdir()))}.so")
        )
        assert self.module.rtapi_app_main() == 0
        for pin, value in pins.items():
            place = hal.stub_pin(pin.encode())
            assert place, pin
            place[0] = value

    def inverse(self, pose: np.ndarray, joints: int) -> np.ndarray:
        """Joints of a pose x, y, z, a, b, c."""
        values, flags = (ctypes.c_double * 16)(), (ctypes.c_ulong * 4)()
        given = (ctypes.c_double * 9)(*pose)
        assert self.module.kinematicsInverse(given, values, flags, flags) == 0
        return np.array(values[:joints])

    def forward(self, joints: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
        """Pose x, y, z, a, b, c of joints, from a pose nearby where the module iterates."""
        values, flags = (ctypes.c_double * 16)(*joints), (ctypes.c_ulong * 4)()
        pose = (ctypes.c_double * 9)(*(np.zeros(6) if near is None else near))
        assert self.module.kinematicsForward(values, pose, flags, flags) == 0
        return np.array(pose[:6])
