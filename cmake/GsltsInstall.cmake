# Installs the libraries so that find_package(gslts COMPONENTS ...) finds them.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

get_property(libraries GLOBAL PROPERTY GSLTS_LIBRARIES)
set(GSLTS_COMPONENTS "")
foreach(library IN LISTS libraries)
  get_target_property(component ${library} EXPORT_NAME)
  list(APPEND GSLTS_COMPONENTS ${component})
endforeach()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/gslts)
# These are in the export because a static library names even its private dependencies.
get_property(externals GLOBAL PROPERTY GSLTS_EXTERNALS)
install(TARGETS ${libraries} ${externals} gslts_highway EXPORT gsltsTargets FILE_SET HEADERS)
install(EXPORT gsltsTargets NAMESPACE gslts:: DESTINATION ${package_dir})

configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/gsltsConfig.cmake.in ${PROJECT_BINARY_DIR}/gsltsConfig.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/gsltsConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/gsltsConfig.cmake ${PROJECT_BINARY_DIR}/gsltsConfigVersion.cmake
  DESTINATION ${package_dir})
