#pragma once
/// The BLAS under factors and dense products: whichever the system's alternative is.

#include <string>

namespace tissuewarp::apps {

/// OpenBLAS knows processors by their numbers. One that came after it may pass for a Prescott of 2004, whose kernels
/// are five times slower than those that it has for the same vector units. It reads OPENBLAS_CORETYPE while it is
/// loaded: where that is not set and would help, this sets it and starts the program again. Returns where there is
/// nothing to gain. `argv` of main.
void start_again_if_blas_mistook_the_processor(char** argv);

/// What the BLAS says of itself, with the processor that it works for; "not OpenBLAS" where it cannot be asked.
std::string blas_name();

}  // namespace tissuewarp::apps
