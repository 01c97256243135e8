# gslts_opencv: the parts of OpenCV that the libraries use. Debian ships OpenCVConfig.cmake in
# libopencv-dev only, which drags all of OpenCV in.
add_library(gslts_opencv INTERFACE)
set_target_properties(gslts_opencv PROPERTIES EXPORT_NAME opencv)
find_path(GSLTS_OPENCV_INCLUDE_DIR opencv2/imgproc.hpp PATH_SUFFIXES opencv4 REQUIRED)
target_include_directories(gslts_opencv SYSTEM INTERFACE
  $<BUILD_INTERFACE:${GSLTS_OPENCV_INCLUDE_DIR}>)
foreach(part imgproc core)
  find_library(GSLTS_OPENCV_${part} opencv_${part} REQUIRED)
  # By name, so that the installed package does not hold the paths of this machine.
  target_link_libraries(gslts_opencv INTERFACE opencv_${part})
endforeach()
