include(GNUInstallDirs)

# Standard, warnings and floating-point rules that every target of the project shares.
function(gslts_target_defaults target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion)
  # Nobody reads errno or floating-point flags. Signed zeros, NaN and Inf keep their meaning.
  target_compile_options(${target} PRIVATE -fno-math-errno -fno-trapping-math)
  # Results are the same on every processor: the compiler fuses no multiplication with an addition.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  if(GSLTS_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# gslts_library(<name> SOURCES <files> HEADERS <files> [DEPENDS <targets>] [PRIVATE_DEPENDS <targets>])
#
# Declares the static library gslts::<name> of folder cpp/<name>, with the public headers
# <gslts/<name>/...> under include/. Only what is declared can be included.
function(gslts_library name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;HEADERS;DEPENDS;PRIVATE_DEPENDS")
  set(target gslts_${name})
  add_library(${target} STATIC ${arg_SOURCES})
  add_library(gslts::${name} ALIAS ${target})
  target_sources(${target} PUBLIC
    FILE_SET HEADERS BASE_DIRS ${CMAKE_CURRENT_SOURCE_DIR}/include FILES ${arg_HEADERS})
  target_link_libraries(${target} PUBLIC ${arg_DEPENDS} PRIVATE ${arg_PRIVATE_DEPENDS})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} VERIFY_INTERFACE_HEADER_SETS ON)
  gslts_target_defaults(${target})
  set_property(GLOBAL APPEND PROPERTY GSLTS_LIBRARIES ${target})
endfunction()

# gslts_kernels(<name>)
#
# Prepares gslts::<name> for SIMD kernels: Highway compiles each of their files once per instruction
# set, and includes it by its name.
function(gslts_kernels name)
  target_include_directories(gslts_${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    # The oldest x86-64 served is x86-64-v2 with AES (2010); AVX2 and AVX-512 are chosen at run time.
    target_compile_options(gslts_${name} PRIVATE -msse4.2 -mpclmul -maes)
  endif()
endfunction()

# gslts_external(<name> HEADER <file> [SUFFIXES <folders>] [LIBRARIES <names>] [PACKAGE <name>])
#
# Declares gslts_<name>: libraries of others that have no CMake package, or one that names too much.
# With GSLTS_STATIC, those that scripts/wheel-libraries builds are targets of their PACKAGE.
function(gslts_external name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "HEADER;PACKAGE" "SUFFIXES;LIBRARIES")
  set(target gslts_${name})
  string(TOUPPER ${target} prefix)
  add_library(${target} INTERFACE)
  if(GSLTS_STATIC AND arg_PACKAGE)
    find_package(${arg_PACKAGE} CONFIG REQUIRED)
    target_link_libraries(${target} INTERFACE ${arg_LIBRARIES})
    return()
  endif()
  find_path(${prefix}_INCLUDE_DIR ${arg_HEADER} PATH_SUFFIXES ${arg_SUFFIXES} REQUIRED)
  mark_as_advanced(${prefix}_INCLUDE_DIR)
  target_include_directories(${target} SYSTEM INTERFACE $<BUILD_INTERFACE:${${prefix}_INCLUDE_DIR}>)
  foreach(library IN LISTS arg_LIBRARIES)
    find_library(GSLTS_LIBRARY_${library} ${library} REQUIRED)
    mark_as_advanced(GSLTS_LIBRARY_${library})
    # By name, so that the installed package does not hold the paths of this machine.
    target_link_libraries(${target} INTERFACE ${library})
  endforeach()
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY GSLTS_EXTERNALS ${target})
endfunction()
