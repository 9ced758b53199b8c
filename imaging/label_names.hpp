#pragma once
/// Names of labels, as other programs keep them beside a label map.

#include <filesystem>
#include <map>
#include <string>

namespace tissuewarp::imaging {

using LabelNames = std::map<int, std::string>;

/// Of a colour table of 3D Slicer or FreeSurfer ("1 left_lung 128 174 128 255", underscores stand for blanks), one of
/// 3D Slicer as CSV (columns LabelValue and Name; where that is empty Type_CodeMeaning), or a label file of ITK-SNAP
/// (`1 255 0 0 1 1 1 "Left lung"`). Label 0 is the background and has no name. Throws IoError; InvalidInput with the
/// line for rows of another form, for a label with two names and for tables that name nothing.
LabelNames read_label_names(const std::filesystem::path& path);

/// "label 2 (tumour)"; "label 2" where it has no name.
std::string label_title(int label, const LabelNames& names);

/// The text with its names behind every "label N".
std::string with_label_names(const std::string& text, const LabelNames& names);

}  // namespace tissuewarp::imaging
