# Installation and the exported CMake package: find_package(tissuewarp COMPONENTS tled) or registration, the default.
# Studies, pages, benchmarks and their engines are not installed.

include(CMakePackageConfigHelpers)

configure_file(${PROJECT_SOURCE_DIR}/core/version.hpp.in ${PROJECT_BINARY_DIR}/generated/version.hpp @ONLY)

# The public face of a library is what lies directly in its folder (registration names its own), and what that includes.
function(with_what_they_include list)
  set(open ${${list}})
  while(open)
    list(POP_FRONT open header)
    file(STRINGS ${PROJECT_SOURCE_DIR}/${header} includes REGEX "^#include \"[a-z_]+/")
    foreach(include ${includes})
      string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" included "${include}")
      if(NOT included IN_LIST ${list})
        list(APPEND ${list} ${included})
        list(APPEND open ${included})
      endif()
    endforeach()
  endwhile()
  set(${list} ${${list}} PARENT_SCOPE)
endfunction()

set(components tled)
set(tled_targets core shaders meshing tled)
set(folders core shaders meshing tled)
if(TISSUEWARP_COMPONENTS STREQUAL "all")
  list(APPEND components registration)
  set(registration_targets imaging mesher hdf5 registration)
  list(APPEND folders imaging)
  set(headers ${TISSUEWARP_REGISTRATION_HEADERS})
endif()
foreach(folder ${folders})
  file(GLOB face RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.hpp)
  if(TISSUEWARP_COMPONENTS STREQUAL "tled")
    list(FILTER face EXCLUDE REGEX "meshing/(mesher|fidelity|surface_voxels)")  # these need images
  endif()
  list(APPEND headers ${face})
endforeach()
with_what_they_include(headers)

string(REPLACE ";" "|" header_argument "${headers};${PROJECT_BINARY_DIR}/generated/version.hpp")
install(CODE "execute_process(COMMAND \"${CMAKE_COMMAND}\" \"-DROOT=${PROJECT_SOURCE_DIR}\"
  \"-DHEADERS=${header_argument}\"
  \"-DDESTINATION=\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}/tissuewarp\"
  -P \"${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake\" COMMAND_ERROR_IS_FATAL ANY)")
if(TARGET tissuewarp_app)
  install(TARGETS tissuewarp_app RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/tissuewarp)
foreach(component ${components})
  list(TRANSFORM ${component}_targets PREPEND tissuewarp_ OUTPUT_VARIABLE libraries)
  install(TARGETS ${libraries} EXPORT tissuewarp_${component} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT tissuewarp_${component} NAMESPACE tissuewarp:: DESTINATION ${config_dir}
    FILE tissuewarp_${component}.cmake)
endforeach()
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/tissuewarpConfig.cmake.in
  ${PROJECT_BINARY_DIR}/tissuewarpConfig.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tissuewarpConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tissuewarpConfig.cmake ${PROJECT_BINARY_DIR}/tissuewarpConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindSuiteSparse.cmake
  DESTINATION ${config_dir})
