#pragma once
/// The text headers of NRRD and MetaImage: keys, values, and files that the header lists.

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

struct TextHeader {
    std::map<std::string, std::string> fields;  ///< keys in lower case
    /// Keys as written: NRRD's free pairs "key:=value", and of a MetaImage the fields of single frames, "Seq_Frame…".
    std::map<std::string, std::string> comments;
    std::vector<std::string> listed_files;  ///< lines behind "LIST"
    std::size_t bytes = 0;                  ///< length of the header, where attached data begin

    /// Takes a field. Throws IoError where the header has its key with another value.
    void set(const std::filesystem::path& path, const std::string& key, const std::string& value);
    /// The value of a key, or "" when it is absent.
    [[nodiscard]] std::string value(const std::string& key) const;
};

/// Lines "key: value" up to the empty line. Throws IoError unless the file begins with "NRRD".
TextHeader read_nrrd_header(const std::filesystem::path& path);

/// Lines "Key = Value" up to and with ElementDataFile. Throws IoError when that line does not come.
TextHeader read_meta_header(const std::filesystem::path& path);

/// The names of the files of slices that "LIST" or "pattern first last step" stands for, in a header's folder; one name
/// otherwise. A pattern without `last` stands for `slices` files; it stands for `most` at most. Throws InvalidInput on
/// a pattern that is none.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& header_path, const TextHeader& header,
                                            const std::string& value, std::size_t slices, std::size_t most);

/// The text without blanks at both ends; in lower case.
std::string trimmed(const std::string& text);
std::string lower_case(std::string text);

/// The numbers in a text, with parentheses and commas taken as blanks. Words that are no numbers become NaN.
std::vector<double> numbers_in(std::string text);

}  // namespace tissuewarp::imaging::detail
