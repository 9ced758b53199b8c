#include "core/text_table.hpp"

#include "core/file_message.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>

namespace tissuewarp {

namespace {

constexpr char blanks = ' ';  // stands for runs of blanks and tabulators

std::string read_text(const std::filesystem::path& path) {
    std::error_code ignored;
    std::ifstream file(path, std::ios::binary);
    if (!file || std::filesystem::is_directory(path, ignored))
        throw IoError(path.string() + ": cannot be opened; check that the file exists and may be read");
    std::string text{std::istreambuf_iterator<char>(file), {}};
    if (file.bad()) throw IoError(path.string() + ": reading failed");
    if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
        throw InvalidInput(path.string() + ": is text in UTF-16; save it as UTF-8");
    if (text.find('\0') != std::string::npos)
        throw InvalidInput(path.string() + ": is no text, it has bytes of zero; give a table of points as text");
    if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // byte-order mark
    return text;
}

/// The text with every `from` as `to`, in time linear in its length.
std::string with_replaced(std::string_view text, std::string_view from, std::string_view to) {
    std::string replaced;
    replaced.reserve(text.size());
    for (std::size_t at; (at = text.find(from)) != std::string_view::npos; text.remove_prefix(at + from.size()))
        replaced.append(text.substr(0, at)).append(to);
    return replaced.append(text);
}

std::optional<double> parsed_plain(std::string_view digits) {
    if (digits.starts_with('+')) digits.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (digits.empty() || error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
    return value;
}

std::optional<double> parsed(std::string_view text, bool decimal_commas) {
    const bool as_it_stands =
        !text.starts_with('\xE2') && !(decimal_commas && text.find(',') != std::string_view::npos);
    if (as_it_stands) return parsed_plain(text);
    constexpr std::string_view minus = "\xE2\x88\x92";  // of typesetting, as spreadsheets copy it
    std::string plain = with_replaced(text, minus, "-");
    if (decimal_commas) std::replace(plain.begin(), plain.end(), ',', '.');
    return parsed_plain(plain);
}

bool is_decimal(std::string_view text, char mark) {
    return text.find(mark) != std::string_view::npos && text.find(mark == ',' ? '.' : ',') == std::string_view::npos &&
           parsed(text, mark == ',').has_value();
}

bool is_number(std::string_view text) {
    return parsed(text, false).has_value() || is_decimal(text, ',');
}

std::string unquoted(std::string_view text) {
    text = trimmed(text);
    if (text.size() < 2 || text.front() != '"' || text.back() != '"') return std::string(text);
    return std::string(trimmed(with_replaced(text.substr(1, text.size() - 2), "\"\"", "\"")));
}

/// What stands between separators that are not within quotation marks.
std::vector<std::string> split(std::string_view line, char separator) {
    std::vector<std::string> fields;
    const auto separates = [&](char c) { return c == separator || (separator == blanks && c == '\t'); };
    bool quoted = false;
    std::size_t start = 0;
    if (separator == blanks) line = trimmed(line);
    for (std::size_t at = 0; at <= line.size(); ++at) {
        if (at < line.size() && line[at] == '"') quoted = !quoted;
        if (at < line.size() && (quoted || !separates(line[at]))) continue;
        if (separator != blanks || at > start) fields.push_back(unquoted(line.substr(start, at - start)));
        start = at + 1;
    }
    return fields;
}

/// "1,5 2,25 3": commas that are no separators.
bool is_row_of_numbers_between_blanks(std::string_view line) {
    const std::vector<std::string> fields = split(line, blanks);
    return fields.size() > 1 && std::all_of(fields.begin(), fields.end(), is_number);
}

char separator_of(std::string_view line) {
    if (line.find(';') != std::string_view::npos) return ';';
    if (is_row_of_numbers_between_blanks(line)) return blanks;
    if (line.find(',') != std::string_view::npos) return ',';
    return trimmed(line).find('\t') != std::string_view::npos ? '\t' : blanks;
}

/// "0", "1", "2", ...: names of columns that have none, as tables of data frames write them.
bool numbers_columns(const std::vector<std::string>& fields) {
    for (std::size_t f = 0; f < fields.size(); ++f)
        if (fields[f] != std::to_string(f)) return false;
    return fields.size() > 2;
}

/// The text behind the sign of a remark; nothing where the line is none.
std::optional<std::string_view> remark_in(std::string_view line) {
    line = trimmed(line);
    for (const std::string_view sign : {"#", "%", "//"})
        if (line.starts_with(sign)) return trimmed(line.substr(sign.size()));
    return std::nullopt;
}

}  // namespace

std::string note_of(const std::filesystem::path& path, std::string_view text) {
    return std::string("'").append(path.string()).append("': ").append(text);
}

std::string_view trimmed(std::string_view text) {
    const auto blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    while (!text.empty() && blank(text.front())) text.remove_prefix(1);
    while (!text.empty() && blank(text.back())) text.remove_suffix(1);
    return text;
}

std::string lower_case(std::string_view text) {
    std::string lower(text);
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return lower;
}

std::vector<std::string> words_of(std::string_view text) {
    constexpr std::string_view between = " \t,;";
    std::vector<std::string> words;
    for (std::size_t at = 0; (at = text.find_first_not_of(between, at)) < text.size();) {
        const std::size_t end = std::min(text.find_first_of(between, at), text.size());
        words.emplace_back(text.substr(at, end - at));
        at = end;
    }
    return words;
}

TextTable::TextTable(const std::filesystem::path& path, char separator) : path_(path), separator_(separator) {
    take_lines(read_text(path));
    find_header();
    if (separator == 0) find_decimal_mark();
}

void TextTable::take_lines(std::string_view text) {
    int number = 0;
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find_first_of("\r\n", start), text.size());
        const std::string_view line = text.substr(start, end - start);
        start = end + (text.substr(end).starts_with("\r\n") ? 2 : 1);
        take_line(++number, line);
    }
}

void TextTable::take_line(int number, std::string_view line) {
    const bool blank = trimmed(line).empty(), separated = separator_ == '\t' && line.find('\t') < line.size();
    if (blank) {
        (separated ? empty_rows_ : blank_lines_).push_back(number);
    } else if (const auto remark = remark_in(line)) {
        remarks_.push_back({number, std::string(*remark)});
    } else if (rows_.empty() && line.size() == 5 && lower_case(line).starts_with("sep=")) {
        separator_ = line[4];  // as spreadsheets write it
    } else {
        const char separator = separator_ == 0 ? separator_of(line) : separator_;
        std::vector<std::string> fields = split(line, separator);
        if (fields.size() > 1) separator_ = separator;  // one word does not show what stands between columns
        const bool empty = std::all_of(fields.begin(), fields.end(), [](auto& field) { return field.empty(); });
        if (empty)
            empty_rows_.push_back(number);
        else
            rows_.push_back({number, std::move(fields)});
    }
}

void TextTable::find_header() {
    if (rows_.empty()) return;
    Row& first = rows_[0];
    if (std::none_of(first.fields.begin(), first.fields.end(), is_number)) {
        header_ = std::move(first.fields);
        header_line_ = first.line;
    } else if (separator_ != blanks && rows_.size() > 1 && numbers_columns(first.fields)) {
        line_of_numbers_ = first.line;
    } else {
        return;
    }
    rows_.erase(rows_.begin());
}

int TextTable::blank_line() const {
    int found = 0;
    std::size_t gaps = 0;
    for (std::size_t r = 1; r < rows_.size(); ++r) {
        const auto blank = std::upper_bound(blank_lines_.begin(), blank_lines_.end(), rows_[r - 1].line);
        if (blank == blank_lines_.end() || *blank > rows_[r].line) continue;
        if (gaps++ == 0) found = *blank;
    }
    const bool behind_every_row = rows_.size() > 2 && gaps + 1 == rows_.size();
    return behind_every_row ? 0 : found;
}

bool TextTable::has_commas_of_both_kinds() const {
    bool leading_zeros = false;
    for (const Row& row : rows_)
        for (std::size_t f = 0; f < row.fields.size(); ++f) {
            const std::string& field = row.fields[f];
            const bool fraction = f % 2 == 1;
            if (field.find_first_not_of(fraction ? "0123456789" : "+-0123456789") < field.size()) return false;
            leading_zeros = leading_zeros || (fraction && field.size() > 1 && field[0] == '0');
        }
    return separator_ == ',' && leading_zeros;
}

long long TextTable::take_count() {
    if (!header_.empty() || rows_.size() < 2 || rows_[0].fields.size() != 1 || rows_.back().fields.size() == 1)
        return 0;
    const std::string& text = rows_[0].fields[0];
    const std::size_t behind = rows_.size() - 1;
    if (text.find_first_not_of("0123456789") < text.size()) return 0;
    if (text != std::to_string(behind))
        refuse(rows_[0].line, "'" + text + "' looks like the number of points, and " + std::to_string(behind) +
                                  " rows follow; correct it, or take out the lines before the points");
    rows_.erase(rows_.begin());
    return static_cast<long long>(behind);
}

void TextTable::find_decimal_mark() {
    for (const Row& row : rows_)
        decimal_commas_ = decimal_commas_ || std::any_of(row.fields.begin(), row.fields.end(),
                                                         [](auto& field) { return is_decimal(field, ','); });
    if (!decimal_commas_) return;
    for (const Row& row : rows_)
        for (const std::string& field : row.fields)
            if (is_decimal(field, '.'))
                refuse(row.line, std::string("'") + field +
                                     "': the file has decimal commas and decimal points; write one of them");
}

void TextTable::require_even_rows() {
    if (rows_.empty()) return;
    const int first_line = header_.empty() ? rows_.front().line : header_line_;
    for (const int line : empty_rows_)
        if (line > first_line && line < rows_.back().line)
            refuse(line, "the row is empty and others follow; a point may be missing: fill it in, or take the row out");
    if (header_.size() > 1 && header_.back().empty()) header_.pop_back();
    if (header_.empty() && rows_[0].fields.back().empty()) rows_[0].fields.pop_back();
    const std::size_t columns = header_.empty() ? rows_[0].fields.size() : header_.size();
    for (Row& row : rows_) {
        if (row.fields.size() == columns + 1 && row.fields.back().empty()) row.fields.pop_back();
        if (row.fields.size() == columns) continue;
        refuse(row.line,
               std::to_string(row.fields.size()) + " fields; " +
                   (header_.empty() ? "the first row has " : "the header names ") + std::to_string(columns) +
                   (row.fields.size() > columns ? "; separate columns with decimal commas by semicolons" : ""));
    }
}

double TextTable::coordinate(const Row& row, std::size_t column, std::string_view name) const {
    const std::string& text = row.fields[column];
    const std::optional<double> value = parsed(text, decimal_commas_);
    if (!value) refuse(row.line, std::string(name) + " is '" + text.substr(0, 40) + "'; a number in mm is needed");
    if (!std::isfinite(*value) || std::abs(*value) > 1e6)
        refuse(row.line, std::string(name) + " is " + text + "; a finite coordinate in mm is needed");
    return *value;
}

void TextTable::refuse(int line, const std::string& reason) const {
    throw InvalidInput(presentable(path_.string() + ":" + std::to_string(line) + ": " + reason));
}

}  // namespace tissuewarp
