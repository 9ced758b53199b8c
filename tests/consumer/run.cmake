# Installs tissuewarp, then configures, builds and runs against the installed package what users would write: the tutorial
# of examples/navigation on the head of data/brainshift, and a program that takes the solver alone.
#     cmake -DBUILD=<build folder> -DSOURCE=<source folder> -P run.cmake
set(prefix ${BUILD}/consumer/prefix)
file(REMOVE_RECURSE ${BUILD}/consumer)
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE status OUTPUT_VARIABLE said WORKING_DIRECTORY ${BUILD})
  message("${said}")
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGV}")
  endif()
  set(said "${said}" PARENT_SCOPE)
endfunction()
function(build source name)
  run(${CMAKE_COMMAND} -S ${source} -B ${BUILD}/consumer/${name} -G Ninja -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${prefix})
  run(${CMAKE_COMMAND} --build ${BUILD}/consumer/${name})
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
file(GLOB_RECURSE headers ${prefix}/include/tissuewarp/*.hpp)
foreach(header ${headers})
  file(STRINGS ${header} unprefixed REGEX "#include \"(core|imaging|meshing|shaders|tled|simulation|registration)/")
  if(unprefixed)
    message(FATAL_ERROR "${header} includes without the project's name: ${unprefixed}")
  endif()
endforeach()
file(GLOB_RECURSE inner ${prefix}/include/tissuewarp/study/* ${prefix}/include/tissuewarp/report/*
  ${prefix}/include/tissuewarp/registration/terms/*)
if(inner)
  message(FATAL_ERROR "installed, but for nobody to include: ${inner}")
endif()

# What the page for users of C++ shows, with the page's own lines for CMake; the README shows the same.
function(write_page_program folder)
  file(READ ${SOURCE}/docs/from-cpp.md page)
  file(READ ${SOURCE}/README.md readme)
  string(REGEX MATCH "```cpp\n(#include [^\n]*\n\nusing namespace [^\n]*\n)([^`]*)```" snippet "${page}")
  set(head "${CMAKE_MATCH_1}")
  set(body "${CMAKE_MATCH_2}")
  string(FIND "${readme}" "${snippet}" place)
  if(snippet STREQUAL "" OR place EQUAL -1)
    message(FATAL_ERROR "docs/from-cpp.md shows no program, or the README another one")
  endif()
  file(WRITE ${folder}/main.cpp "${head}
using tissuewarp::imaging::Volume;
void page(const Volume& preop_labels, const Volume& preop_image, const Volume& intraop_image,
          const Eigen::Vector3d& tumour_before) {
${body}}
int main() {}
")
  string(REGEX MATCH "```cmake\n([^`]*)```" lines "${page}")
  file(WRITE ${folder}/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)
project(page LANGUAGES C CXX)
add_executable(navigation main.cpp)
${CMAKE_MATCH_1}")
endfunction()
write_page_program(${BUILD}/consumer/page_source)
build(${BUILD}/consumer/page_source page)

build(${SOURCE}/tests/consumer solver)
run(${BUILD}/consumer/solver/solver)
build(${SOURCE}/examples/navigation navigation)
set(head ${SOURCE}/data/brainshift)
run(${BUILD}/consumer/navigation/navigation ${head}/preop.nii.gz ${head}/preop_labels.nii.gz ${head}/intraop.nii.gz
  ${head}/intraop_surface.ply)
# The truth, landmarks.csv: this target moved by 5.2 mm.
if(NOT said MATCHES "image: [^\n]* moved 5\\.[0-4] mm" OR NOT said MATCHES "surface: [^\n]* moved [3-6]\\.[0-9] mm")
  message(FATAL_ERROR "the example's targets are wrong: ${said}")
endif()
