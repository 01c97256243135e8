include_guard()

# The parts of OpenCV that every library may use. Debian ships OpenCVConfig.cmake in libopencv-dev
# only, which drags all of OpenCV in.
gslts_external(opencv
  PACKAGE OpenCV HEADER opencv2/imgproc.hpp SUFFIXES opencv4
  LIBRARIES opencv_imgproc opencv_core)
