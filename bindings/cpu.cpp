// A module that can be imported only where the others run. It is compiled for any processor, and
// needs no other package: NumPy may have its own word about an old processor.
#include <Python.h>

namespace {

const char* missing_feature() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("sse4.2")) return "SSE4.2";
  if (!__builtin_cpu_supports("pclmul")) return "PCLMULQDQ";
  if (!__builtin_cpu_supports("aes")) return "AES";
#endif
  return nullptr;
}

PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_cpu", nullptr, 0, nullptr, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__cpu() {
  if (const char* feature = missing_feature()) {
    return PyErr_Format(PyExc_ImportError,
                        "the processor must be x86-64 with SSE4.2, PCLMULQDQ and AES (Intel of "
                        "2010, AMD of 2011 or newer): this one has no %s",
                        feature);
  }
  return PyModule_Create(&definition);
}
