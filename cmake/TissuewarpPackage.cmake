# Packages: a Debian package, and an archive that brings its libraries.
#     cmake --build build/release --target packages        (both, into build/release/packages)
# Decisions: docs/decisions/packages.md. Versions come from project() alone.

set(packaging ${PROJECT_SOURCE_DIR}/packaging)
set(brainshift ${PROJECT_SOURCE_DIR}/data/brainshift)

# What a first registration, the tutorial and the scenes need; scenes look for their labels beside them.
install(FILES ${brainshift}/preop.nii.gz ${brainshift}/preop_labels.nii.gz ${brainshift}/intraop.nii.gz
  ${brainshift}/intraop_labels.nii.gz ${brainshift}/intraop_surface.ply ${brainshift}/landmarks.csv
  DESTINATION ${CMAKE_INSTALL_DATADIR}/tissuewarp/brainshift)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/data/scenes DESTINATION ${CMAKE_INSTALL_DATADIR}/tissuewarp)
install(FILES ${PROJECT_SOURCE_DIR}/data/LICENSE-Apache-2.0 DESTINATION ${CMAKE_INSTALL_DATADIR}/tissuewarp)
install(FILES ${packaging}/copyright ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md
  ${PROJECT_SOURCE_DIR}/data/SOURCES.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${CMAKE_INSTALL_DOCDIR})
# All pages, since they link to each other; their paths are those that messages of the program name.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DOCDIR})

# Licences of what is compiled into the programs: archives of OpenCV, and templates.
foreach(package libopencv-core-dev libcgal-dev libeigen3-dev libcli11-dev nlohmann-json3-dev pybind11-dev)
  if(EXISTS /usr/share/doc/${package}/copyright)
    install(FILES /usr/share/doc/${package}/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR}/licences RENAME ${package})
  endif()
endforeach()

# 3D Slicer: the scripted module, and a program for each verb that is a command-line module.
set(slicer ${CMAKE_INSTALL_DATADIR}/tissuewarp/slicer)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/slicer/TissueWarp DESTINATION ${slicer} PATTERN __pycache__ EXCLUDE)
foreach(verb register mesh warp simulate)
  install(PROGRAMS ${PROJECT_SOURCE_DIR}/slicer/cli-modules/tissuewarp-module DESTINATION ${slicer}/cli-modules
    RENAME tissuewarp-${verb})
endforeach()

# What `tissuewarp cohort` starts: Python's standard library, and Snakemake.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/workflow DESTINATION ${CMAKE_INSTALL_DATADIR}/tissuewarp
  PATTERN __pycache__ EXCLUDE)

# Man pages and shell completion say what --help-all says.
if(TISSUEWARP_PYTHON3)
  install(CODE "execute_process(COMMAND ${TISSUEWARP_PYTHON3} ${packaging}/from_help.py $<TARGET_FILE:tissuewarp_app>
    \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR} COMMAND_ERROR_IS_FATAL ANY)")
endif()

set(programs tissuewarp_app)
if(TISSUEWARP_PYTHON)
  list(APPEND programs tissuewarp_python)
endif()
if(TISSUEWARP_HAS_OPENCV_ARCHIVES)
  set_target_properties(${programs} PROPERTIES TISSUEWARP_OPENCV_ARCHIVES ON)
endif()

# The archive's libraries lie in lib/tissuewarp. The older kind of path holds for what these libraries load themselves.
set(bundle lib/tissuewarp)
set_target_properties(tissuewarp_app PROPERTIES INSTALL_RPATH "$ORIGIN/../${bundle}")
if(TISSUEWARP_PYTHON)
  set_target_properties(tissuewarp_python PROPERTIES INSTALL_RPATH "$ORIGIN/../../../tissuewarp")
endif()
foreach(program ${programs})
  target_link_options(${program} PRIVATE -Wl,--disable-new-dtags)
  list(APPEND program_files $<TARGET_FILE:${program}>)
endforeach()
install(CODE "execute_process(COMMAND \"${CMAKE_COMMAND}\" \"-DPROGRAMS=${program_files}\"
  \"-DDESTINATION=\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${bundle}\"
  \"-DLICENCES=\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DOCDIR}/licences\"
  -P \"${packaging}/bundle_libraries.cmake\" COMMAND_ERROR_IS_FATAL ANY)" COMPONENT bundle EXCLUDE_FROM_ALL)

# A package that somebody built for themselves has nobody who answers mail; who gives it to others says who answers.
set(TISSUEWARP_MAINTAINER "tissuewarp built from source <nobody@tissuewarp.invalid>" CACHE STRING
  "Who answers for a package: name <address>")
set(CPACK_PACKAGE_CONTACT ${TISSUEWARP_MAINTAINER})
set(CPACK_GENERATOR DEB TGZ)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGE_DESCRIPTION_FILE ${packaging}/description.txt)
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# Any BLAS would do for the loader; apt's first choice is the reference one.
set(CPACK_DEBIAN_PACKAGE_DEPENDS libopenblas0-pthread)
if(TISSUEWARP_PYTHON)
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next}), python3-numpy")
endif()
# For a GPU's own driver; and to build programs on the libraries.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libegl1, libopengl0, snakemake, python3-nibabel, cmake, g++, pkg-config, libeigen3-dev, libtbb-dev, libhwy-dev, libsuitesparse-dev, libepoxy-dev, libssl-dev, zlib1g-dev, libdeflate-dev, libopencv-dev, libinsighttoolkit5-dev, libgdcm-dev, libcgal-dev, libnlopt-dev, libnlopt-cxx-dev, libhdf5-dev, nlohmann-json3-dev")
set(CPACK_PROJECT_CONFIG_FILE ${packaging}/cpack_options.cmake)
include(CPack)

list(TRANSFORM registration_targets PREPEND tissuewarp_ OUTPUT_VARIABLE installed_libraries)
add_custom_target(packages COMMAND ${CMAKE_CPACK_COMMAND} WORKING_DIRECTORY ${PROJECT_BINARY_DIR} USES_TERMINAL VERBATIM)
add_dependencies(packages ${programs} ${installed_libraries} tissuewarp_core tissuewarp_shaders tissuewarp_meshing
  tissuewarp_tled)
