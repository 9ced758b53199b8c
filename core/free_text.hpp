#pragma once
/// What remarks, titles and comments of files of points say of their frame and their unit of length.

#include <set>
#include <string>
#include <string_view>

namespace tissuewarp {

/// Frames that a text names, as three letters of directions: "RAS" and "LPS" as words in capitals, or in any case where
/// the text speaks of a space, a coordinate system, a frame or an orientation; others ("LAS") only there; and three
/// directions in words ("right-anterior-superior").
std::set<std::string> frames_in(std::string_view text);

/// As above, of a text that is written for other purposes, such as a title: only where it speaks of a space, a
/// coordinate system, a frame or an orientation.
std::set<std::string> frames_stated_in(std::string_view text);

/// The unit behind the word "unit" or "units" where that is another unit of length than mm; otherwise empty.
std::string foreign_unit_in(std::string_view text);

}  // namespace tissuewarp
