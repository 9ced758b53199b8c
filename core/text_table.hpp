#pragma once
/// Text files of rows and columns, as spreadsheets and other programs write them: the one reader of them all.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp {

/// The rows of a file whose columns stand between semicolons, tabulators, commas or blanks, whichever its first row
/// shows. Numbers may have decimal commas where columns are separated otherwise; one file has commas or points.
/// Byte-order marks, quotation marks and every kind of line end are seen through, and empty rows before and behind all
/// others; what follows #, % or // at the beginning of a line is a remark.
class TextTable {
public:
    struct Row {
        int line;  ///< of the file, from 1
        std::vector<std::string> fields;
    };

    /// `separator` where the format fixes it, which then has decimal points; 0 finds it. Throws IoError; InvalidInput
    /// for what is no text.
    explicit TextTable(const std::filesystem::path& path, char separator = 0);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

    /// The fields of the first row where none of them is a number; otherwise empty.
    [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
    [[nodiscard]] int header_line() const { return header_line_; }
    [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }

    /// Remarks in their order, without their sign; `line` counts as for rows.
    struct Remark {
        int line;
        std::string text;
    };
    [[nodiscard]] const std::vector<Remark>& remarks() const { return remarks_; }
    [[nodiscard]] bool has_decimal_commas() const { return decimal_commas_; }
    /// The line of a first row that numbers the columns (0,1,2), which is no row here; 0 where there is none.
    [[nodiscard]] int line_of_numbers() const { return line_of_numbers_; }
    /// The first empty line between two rows; 0 where there is none, or one behind every row.
    [[nodiscard]] int blank_line() const;
    /// True where commas stand between columns and for decimal marks alike ("1,50,2,05,3,00").
    [[nodiscard]] bool has_commas_of_both_kinds() const;

    /// Takes a first row that is a whole number alone for the count of the rows behind it, and returns it; 0 where
    /// there is none. Throws InvalidInput where it counts otherwise.
    long long take_count();

    /// Throws InvalidInput, naming the line, unless every row has as many fields as the header or the first row, and no
    /// row of separators alone lies between others. One empty field behind the others does not count.
    void require_even_rows();

    /// A finite coordinate in mm, at most 1 km; throws InvalidInput with line and value for anything else.
    [[nodiscard]] double coordinate(const Row& row, std::size_t column, std::string_view name) const;

    /// Throws InvalidInput "file:line: reason".
    [[noreturn]] void refuse(int line, const std::string& reason) const;

private:
    std::filesystem::path path_;
    char separator_;
    std::vector<std::string> header_;
    int header_line_ = 0;
    std::vector<Row> rows_;
    std::vector<Remark> remarks_;
    bool decimal_commas_ = false;
    int line_of_numbers_ = 0;
    std::vector<int> blank_lines_, empty_rows_;  ///< lines with nothing, or separators alone

    void take_lines(std::string_view text);
    void take_line(int number, std::string_view line);
    void find_header();
    void find_decimal_mark();
};

/// "'file': text", a note's form.
std::string note_of(const std::filesystem::path& path, std::string_view text);

/// Without blanks around it.
std::string_view trimmed(std::string_view text);

/// Lower-case copy of ASCII text.
std::string lower_case(std::string_view text);

/// The runs between blanks, commas and semicolons.
std::vector<std::string> words_of(std::string_view text);

}  // namespace tissuewarp
