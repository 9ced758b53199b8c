# What differs between the packages. CPack reads this once for each of them.
set(build ${CPACK_PACKAGE_DIRECTORY}/..)
if(CPACK_GENERATOR STREQUAL "DEB")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
else()  # the archive: one folder, with the libraries that other systems lack
  set(CPACK_INSTALL_CMAKE_PROJECTS "${build};tissuewarp;ALL;/;${build};tissuewarp;bundle;/")
endif()
