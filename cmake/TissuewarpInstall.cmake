# Installation and the exported CMake package: find_package(tissuewarp) gives tissuewarp::<folder>.

include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY TISSUEWARP_LIBRARIES)
install(TARGETS ${libraries} EXPORT tissuewarpTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(TARGET tissuewarp_app)
  install(TARGETS tissuewarp_app RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

foreach(folder core imaging meshing shaders tled simulation registration report)
  if(TARGET tissuewarp_${folder})
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}/
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tissuewarp/${folder}
      FILES_MATCHING PATTERN "*.hpp" PATTERN "detail" EXCLUDE
      REGEX "/tled/(cpu|gpu|parallel|statics|reference|render_pass)/" EXCLUDE)
  endif()
endforeach()

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/tissuewarp)
install(EXPORT tissuewarpTargets NAMESPACE tissuewarp:: DESTINATION ${config_dir})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/tissuewarpConfig.cmake.in
  ${PROJECT_BINARY_DIR}/tissuewarpConfig.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tissuewarpConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tissuewarpConfig.cmake ${PROJECT_BINARY_DIR}/tissuewarpConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindSuiteSparse.cmake
  DESTINATION ${config_dir})
