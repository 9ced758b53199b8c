#pragma once
/// Results as a derivative dataset of BIDS: names, sidecars and the dataset's description.

#include "apps/options.hpp"

#include <filesystem>
#include <string>

namespace tissuewarp::apps {

/// "sub-01" of "01" or "sub-01". Throws InvalidInput unless the label is of letters and digits.
std::string bids_subject(const std::string& given);

/// The suffix (T1w, ct, ...) of an image that is named as BIDS names them: letters and digits behind the last "_".
/// Throws InvalidInput where there is none.
std::string bids_suffix(const std::filesystem::path& image);

/// The name that a result has in BIDS, from its usual one; the usual one where BIDS has no name for it, and without
/// --bids.
std::string bids_name(const RegisterOptions& options, const std::string& usual);

/// The sidecar of a result with a name of BIDS: "..._xfm.json" of "..._xfm.h5".
std::string sidecar_name(const std::string& bids_name);

/// Content of a sidecar: the files it was made from, the space it lies in, and the program.
std::string sidecar(const RegisterOptions& options, const std::string& usual);

/// dataset_description.json, unless there is one, and .bidsignore for what BIDS has no names for, in the folder of the
/// dataset. Throws IoError.
void write_bids_dataset(const RegisterOptions& options);

/// Whether a file may be a result under a name of BIDS.
bool is_bids_output(const std::string& name);

}  // namespace tissuewarp::apps
