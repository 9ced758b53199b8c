# Helpers that every folder uses, so that each CMakeLists.txt holds only names.

include(GNUInstallDirs)
find_package(Threads REQUIRED)

add_library(tissuewarp_warnings INTERFACE)
target_compile_options(tissuewarp_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-qual
  $<$<BOOL:${TISSUEWARP_WERROR}>:-Werror>)

if(TISSUEWARP_SANITIZE)
  if(TISSUEWARP_SANITIZE MATCHES undefined)
    set(first_finding_ends -fno-sanitize-recover=undefined)  # a report alone would not fail a test
  endif()
  # GCC 12 sees uninitialised values inside <regex> and <functional> when it instruments them.
  add_compile_options(-fsanitize=${TISSUEWARP_SANITIZE} ${first_finding_ends} -fno-omit-frame-pointer
                      -Wno-maybe-uninitialized)
  add_link_options(-fsanitize=${TISSUEWARP_SANITIZE})
endif()

# tissuewarp_library(<folder> SOURCES … [PUBLIC libs…] [PRIVATE libs…])
# Declares the library tissuewarp_<folder> with the alias tissuewarp::<folder>; headers are found as "<folder>/x.hpp".
function(tissuewarp_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target tissuewarp_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(tissuewarp::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC}
    PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:tissuewarp_warnings>)
endfunction()

# tissuewarp_test(<name> SOURCES … LIBS … [TIMEOUT seconds] [LABELS …]): a GoogleTest program; every TEST is a ctest test,
# labelled with <name> where no label is given.
function(tissuewarp_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LIBS;LABELS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(NOT ARG_LABELS)
    set(ARG_LABELS ${name})
  endif()
  add_executable(test_${name} ${ARG_SOURCES})
  target_link_libraries(test_${name} PRIVATE ${ARG_LIBS} tissuewarp_test_main GTest::gmock tissuewarp_warnings)
  # No test reads what the user has measured on this machine.
  gtest_discover_tests(test_${name} NO_PRETTY_VALUES DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}"
      ENVIRONMENT "TISSUEWARP_CACHE=${PROJECT_BINARY_DIR}/cache")
endfunction()
