# What gslts::reloc is built with: parts of OpenCV, Ceres and PCL.
include(GsltsOpenCV)

gslts_external(opencv_reloc
  PACKAGE OpenCV HEADER opencv2/calib3d.hpp SUFFIXES opencv4
  LIBRARIES opencv_calib3d opencv_features2d opencv_flann)
target_link_libraries(gslts_opencv_reloc INTERFACE gslts_opencv)

# Its CMake package looks for all of SuiteSparse, which only the building of Ceres needs.
gslts_external(ceres PACKAGE Ceres HEADER ceres/ceres.h LIBRARIES ceres)
if(NOT GSLTS_STATIC)
  gslts_external(glog HEADER glog/logging.h LIBRARIES glog)  # Built alone, Ceres has its own.
  target_link_libraries(gslts_ceres INTERFACE gslts_glog)
endif()

# Its templates alone are used, with those of FLANN. Its CMake package names VTK. Its headers lie in a
# folder of its version.
include(GsltsFlann)
gslts_external(pcl
  HEADER pcl/registration/gicp.h SUFFIXES pcl-1.15 pcl-1.14 pcl-1.13 pcl-1.12)
target_link_libraries(gslts_pcl INTERFACE gslts_flann)
