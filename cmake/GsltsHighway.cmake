# gslts_highway: SIMD by Google Highway, for private use by the kernels.
add_library(gslts_highway INTERFACE)
set_target_properties(gslts_highway PROPERTIES EXPORT_NAME highway)

if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  # The instruction set is chosen at run time, by code in the library.
  find_package(hwy CONFIG REQUIRED)
  target_link_libraries(gslts_highway INTERFACE hwy::hwy)
  # AVX-512 as of Ice Lake adds nothing that the kernels use, but time to compile.
  target_compile_definitions(gslts_highway INTERFACE HWY_DISABLED_TARGETS=HWY_AVX3_DL)
  set(GSLTS_FIND_HIGHWAY "find_dependency(hwy CONFIG)")
else()
  # One instruction set is compiled (NEON on arm64), nothing is chosen, and the headers suffice.
  find_path(GSLTS_HIGHWAY_INCLUDE_DIR hwy/highway.h REQUIRED)
  target_include_directories(gslts_highway SYSTEM INTERFACE
    $<BUILD_INTERFACE:${GSLTS_HIGHWAY_INCLUDE_DIR}>)
  # The second definition keeps Highway from compiling the kernels with ARM's crypto extension, which
  # not every processor has and which they do not use.
  target_compile_definitions(gslts_highway INTERFACE
    HWY_COMPILE_ONLY_STATIC TOOLCHAIN_MISS_SYS_AUXV_H)
  set(GSLTS_FIND_HIGHWAY "")
endif()
