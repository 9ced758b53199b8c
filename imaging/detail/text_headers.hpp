#pragma once
/// The text headers of NRRD and MetaImage, as far as the checks before reading need them.

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

struct TextHeader {
    std::map<std::string, std::string> fields;  ///< keys in lower case
    std::size_t bytes = 0;                      ///< length of the header, where attached data begin

    /// The value of a key, or "" when it is absent.
    [[nodiscard]] std::string value(const std::string& key) const;
};

/// Lines "key: value" up to the empty line. Throws IoError unless the file begins with "NRRD".
TextHeader read_nrrd_header(const std::filesystem::path& path);

/// Lines "Key = Value" up to and with ElementDataFile. Throws IoError when that line does not come.
TextHeader read_meta_header(const std::filesystem::path& path);

/// The numbers in a text, with parentheses and commas taken as blanks. Words that are no numbers become NaN.
std::vector<double> numbers_in(std::string text);

}  // namespace tissuewarp::imaging::detail
