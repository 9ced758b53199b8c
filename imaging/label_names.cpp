#include "imaging/label_names.hpp"

#include "core/errors.hpp"
#include "core/text_table.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <vector>

namespace tissuewarp::imaging {

namespace {

template <class Number>
std::optional<Number> number_in(std::string_view text) {
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return value;
}

bool are_numbers(const std::vector<std::string>& fields, std::size_t first, std::size_t end) {
    return std::all_of(fields.begin() + static_cast<std::ptrdiff_t>(first),
                       fields.begin() + static_cast<std::ptrdiff_t>(end),
                       [](const std::string& field) { return number_in<double>(field).has_value(); });
}

class NameReader {
public:
    explicit NameReader(const std::filesystem::path& path)
        : is_csv_(lower_case(path.extension().string()) == ".csv"), table_(path, is_csv_ ? '\0' : ' ') {}

    LabelNames read() {
        if (is_csv_)
            take_columns();
        else
            for (const TextTable::Row& row : table_.rows()) take(row, row.fields[0], name_in(row));
        if (names_.empty()) table_.refuse(1, "the table names no label" + remedy);
        return names_;
    }

private:
    inline static const std::string remedy =
        "; give a colour table of 3D Slicer (.ctbl, .txt, .csv) or a label file of ITK-SNAP";

    bool is_csv_;
    TextTable table_;
    LabelNames names_;

    /// Of colour tables the second field, of ITK-SNAP the eighth.
    [[nodiscard]] std::string name_in(const TextTable::Row& row) const {
        const std::vector<std::string>& fields = row.fields;
        if (fields.size() == 8 && are_numbers(fields, 1, 7)) return fields[7];
        if ((fields.size() != 5 && fields.size() != 6) || !are_numbers(fields, 2, fields.size()))
            table_.refuse(row.line, "is no label, name and colour" + remedy);
        std::string name = fields[1];
        std::replace(name.begin(), name.end(), '_', ' ');
        return name;
    }

    [[nodiscard]] std::optional<std::size_t> column(std::initializer_list<std::string_view> titles) const {
        for (const std::string_view title : titles)
            for (std::size_t n = 0; n < table_.header().size(); ++n)
                if (lower_case(table_.header()[n]) == title) return n;
        return std::nullopt;
    }

    void take_columns() {
        const auto label = column({"labelvalue", "label value", "value", "label", "index", "id"}),
                   name = column({"name", "label name"}), meaning = column({"type_codemeaning"});
        if (!label || (!name && !meaning))
            table_.refuse(std::max(1, table_.header_line()), "has no columns LabelValue and Name" + remedy);
        table_.require_even_rows();
        for (const TextTable::Row& row : table_.rows()) {
            const bool named = name && !row.fields[*name].empty();
            if (!named && !meaning) continue;
            take(row, row.fields[*label], row.fields[named ? *name : *meaning]);
        }
    }

    void take(const TextTable::Row& row, const std::string& label_text, const std::string& name) {
        const auto label = number_in<int>(label_text);
        if (!label) table_.refuse(row.line, "'" + label_text + "' is no label; labels are whole numbers");
        if (*label == 0 || name.empty()) return;
        const auto [known, is_new] = names_.emplace(*label, name);
        if (!is_new && known->second != name)
            table_.refuse(row.line, "label " + label_text + " is named '" + known->second + "' above and '" + name +
                                        "' here; give it one name");
    }
};

}  // namespace

LabelNames read_label_names(const std::filesystem::path& path) {
    return NameReader(path).read();
}

std::string label_title(int label, const LabelNames& names) {
    return with_label_names("label " + std::to_string(label), names);
}

std::string with_label_names(const std::string& text, const LabelNames& names) {
    constexpr std::string_view word = "label ";
    std::string result;
    std::size_t at = 0;
    for (std::size_t found = text.find(word); found != std::string::npos; found = text.find(word, at)) {
        const std::size_t digits = found + word.size();
        const std::size_t end = std::min(text.find_first_not_of("0123456789", digits), text.size());
        result.append(text, at, end - at);
        const auto label = number_in<int>(std::string_view(text).substr(digits, end - digits));
        if (const auto named = names.find(label.value_or(0)); named != names.end())
            result += " (" + named->second + ")";
        at = end;
    }
    return result.append(text, at);
}

}  // namespace tissuewarp::imaging
