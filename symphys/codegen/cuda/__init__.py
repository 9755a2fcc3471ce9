"""The kernels of programs on a GPU: CUDA C++ from the same graphs, built by NVRTC, launched by CuPy."""

from symphys.codegen.cuda.device import Device
from symphys.codegen.cuda.gpu import find_gpu
from symphys.codegen.cuda.kernel import DeviceKernel, compile_on

__all__ = ["Device", "DeviceKernel", "compile_on", "find_gpu"]
