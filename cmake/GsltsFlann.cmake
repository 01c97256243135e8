# gslts_flann: FLANN's exact k-d tree, which is all in its headers; these also name LZ4, with which
# FLANN would save an index.
add_library(gslts_flann INTERFACE)
set_target_properties(gslts_flann PROPERTIES EXPORT_NAME flann)
find_path(GSLTS_FLANN_INCLUDE_DIR flann/flann.hpp REQUIRED)
find_library(GSLTS_LZ4 lz4 REQUIRED)
target_include_directories(gslts_flann SYSTEM INTERFACE
  $<BUILD_INTERFACE:${GSLTS_FLANN_INCLUDE_DIR}>)
# By name, so that the installed package does not hold the paths of this machine.
target_link_libraries(gslts_flann INTERFACE lz4)
