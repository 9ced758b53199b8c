#pragma once
/// What every reader refuses of a header, in the same words: sizes and spacings that are no volume's.

#include "core/errors.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

/// "cannot use 'path': cause". The cause says value and remedy.
InvalidInput unusable(const std::filesystem::path& path, const std::string& cause);

/// "cannot read 'path': cause", of a file that breaks the rules of its format.
IoError unreadable(const std::filesystem::path& path, const std::string& cause);

/// The beginning of a text that a file holds, for a message.
std::string shortened(const std::string& text);

/// As many digits as tell the value from its neighbours.
std::string all_digits(double value);

/// "4 x 5 x 6".
std::string text_of(const std::vector<double>& sizes);

/// Product of the sizes. Throws InvalidInput when one is no positive whole number or the product is beyond any
/// patient's image.
std::uint64_t values_of(const std::filesystem::path& path, const std::vector<double>& sizes);

/// Throws InvalidInput on a spacing (mm) of 0 or one that is not finite.
void require_spacing(const std::filesystem::path& path, double spacing, std::size_t axis);

/// Throws InvalidInput unless there are three sizes, each of two voxels or more.
void require_three_dimensions(const std::filesystem::path& path, const std::vector<double>& sizes);

}  // namespace tissuewarp::imaging::detail
