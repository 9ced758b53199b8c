# Debian's SuiteSparse 5 ships no CMake config: SuiteSparse::CHOLMOD from its header and library, with the BLAS and LAPACK
# that it takes.
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
find_library(CHOLMOD_LAPACK_LIBRARY lapack REQUIRED)
find_library(CHOLMOD_BLAS_LIBRARY blas REQUIRED)
if(NOT TARGET SuiteSparse::CHOLMOD)
  add_library(SuiteSparse::CHOLMOD UNKNOWN IMPORTED)
  set_target_properties(SuiteSparse::CHOLMOD PROPERTIES
    IMPORTED_LOCATION "${CHOLMOD_LIBRARY}" INTERFACE_INCLUDE_DIRECTORIES "${CHOLMOD_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "${CHOLMOD_LAPACK_LIBRARY};${CHOLMOD_BLAS_LIBRARY}")
endif()
