# OpenCV's core and imgproc as archives, for what is packaged. Debian's shared core loads libGLX for functions that nobody
# here calls, and with it come Mesa and LLVM: half of an installation (docs/decisions/packages.md). Programs that set the
# property TISSUEWARP_OPENCV_ARCHIVES take these in place of the shared libraries.
find_library(TISSUEWARP_OPENCV_CORE_ARCHIVE libopencv_core.a)
find_library(TISSUEWARP_OPENCV_IMGPROC_ARCHIVE libopencv_imgproc.a)
mark_as_advanced(TISSUEWARP_OPENCV_CORE_ARCHIVE TISSUEWARP_OPENCV_IMGPROC_ARCHIVE)
if(TISSUEWARP_OPENCV_CORE_ARCHIVE AND TISSUEWARP_OPENCV_IMGPROC_ARCHIVE)
  set(TISSUEWARP_HAS_OPENCV_ARCHIVES ON PARENT_SCOPE)  # of the folder that includes this
endif()

add_library(tissuewarp_no_glx STATIC EXCLUDE_FROM_ALL ${PROJECT_SOURCE_DIR}/packaging/no_glx.c)
add_library(tissuewarp_opencv_archives INTERFACE)
target_include_directories(tissuewarp_opencv_archives SYSTEM INTERFACE
  $<TARGET_PROPERTY:opencv_core,INTERFACE_INCLUDE_DIRECTORIES>)
target_link_libraries(tissuewarp_opencv_archives INTERFACE
  ${TISSUEWARP_OPENCV_IMGPROC_ARCHIVE} ${TISSUEWARP_OPENCV_CORE_ARCHIVE} tissuewarp_no_glx ZLIB::ZLIB TBB::tbb lapack blas)
target_link_options(tissuewarp_opencv_archives INTERFACE -Wl,--gc-sections)

# tissuewarp_opencv(<variable>): what a library links that gives OpenCV on to its users.
function(tissuewarp_opencv variable)
  set(archives $<BOOL:$<TARGET_PROPERTY:TISSUEWARP_OPENCV_ARCHIVES>>)
  set(${variable} $<$<NOT:${archives}>:opencv_core> $<$<NOT:${archives}>:opencv_imgproc>
    $<BUILD_INTERFACE:$<${archives}:tissuewarp_opencv_archives>> PARENT_SCOPE)
endfunction()
