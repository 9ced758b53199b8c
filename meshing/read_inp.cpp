// Tetrahedra of Abaqus' input files: *NODE, *ELEMENT, TYPE=C3D4, and *ELSET, in one part.

#include "core/text_table.hpp"
#include "meshing/detail/tetrahedra_formats.hpp"

#include <algorithm>
#include <cctype>
#include <optional>
#include <set>
#include <unordered_set>

namespace tissuewarp::meshing::detail {

namespace {

std::vector<std::string_view> between_commas(std::string_view line) {
    std::vector<std::string_view> entries;
    for (std::size_t start = 0; start <= line.size();) {
        const std::size_t comma = std::min(line.find(',', start), line.size());
        entries.push_back(trimmed(line.substr(start, comma - start)));
        start = comma + 1;
    }
    return entries;
}

/// Of a line of keywords: the value of `name=value`, "" where the name stands alone, nothing where it does not.
std::optional<std::string> parameter(const std::vector<std::string_view>& words, std::string_view wanted) {
    for (const std::string_view word : words) {
        const std::size_t equals = std::min(word.find('='), word.size());
        if (lower_case(trimmed(word.substr(0, equals))) == wanted)
            return std::string(trimmed(word.substr(std::min(equals + 1, word.size()))));
    }
    return std::nullopt;
}

/// Elements that *ELSET lists, by numbers of the file.
struct ElementSet {
    struct Range {
        long long first, last, step;
    };
    std::string name;
    bool internal = false;     ///< of a program's own, such as the faces of a load
    std::string other_sets{};  ///< a name where a number is expected: the set is made of others
    std::unordered_set<long long> elements{};
    std::vector<Range> ranges{};  ///< of GENERATE

    [[nodiscard]] bool holds(long long element) const {
        return elements.contains(element) || std::any_of(ranges.begin(), ranges.end(), [&](const Range& range) {
                   return element >= range.first && element <= range.last && (element - range.first) % range.step == 0;
               });
    }
};

class InpReader {
public:
    explicit InpReader(FileReader& file) : file_(file) {}

    RawTetrahedra read() {
        while (file_.remaining() > 0) {
            const std::string_view line = trimmed(file_.line());
            if (line.empty() || line.starts_with("**")) continue;
            if (line.starts_with("*"))
                begin(between_commas(line));
            else
                take(between_commas(line));
        }
        label_by_sets();
        return std::move(mesh_);
    }

private:
    enum class In { Nodes, Tetrahedra, Set, Instance, Other };

    FileReader& file_;
    In in_ = In::Other;
    int label_ = 0;
    std::map<std::string, int> label_of_set_;
    std::vector<ElementSet> sets_;
    std::size_t set_ = 0;
    bool generates_ = false;
    std::vector<std::string> sections_;  ///< sets that have a material, in lower case
    std::vector<long long> numbers_;     ///< of the tetrahedra
    RawTetrahedra mesh_;

    void begin(const std::vector<std::string_view>& words) {
        const std::string keyword = lower_case(words.front());
        refuse_what_moves_or_makes(keyword, words);
        in_ = keyword == "*node" ? In::Nodes : keyword == "*instance" ? In::Instance : In::Other;
        if (keyword == "*element") begin_elements(words);
        if (keyword == "*elset") begin_set(words);
        if (keyword == "*solid section") sections_.push_back(lower_case(parameter(words, "elset").value_or("")));
    }

    /// Keywords without which nodes and elements are others, or elsewhere.
    void refuse_what_moves_or_makes(const std::string& keyword, const std::vector<std::string_view>& words) const {
        static const std::set<std::string> making{"*ngen", "*nfill", "*nmap", "*ncopy", "*elgen", "*elcopy"};
        const bool elsewhere = (keyword == "*node" || keyword == "*element" || keyword == "*elset") &&
                               parameter(words, "input").has_value();
        if (keyword == "*include" || elsewhere)
            file_.refuse("has the line '" + joined(words) + "'; put what is in that file in its place");
        if (making.contains(keyword))
            file_.refuse("makes nodes or elements by " + std::string(words.front()) + "; write them all out");
        const std::string system = parameter(words, "system").value_or("R");
        if ((keyword == "*node" && lower_case(system) != "r") || keyword == "*system")
            file_.refuse("has the line '" + joined(words) +
                         "', coordinates in a system of their own; write rectangular ones of the whole, without it");
    }

    static std::string joined(const std::vector<std::string_view>& words) {
        std::string text;
        for (const std::string_view word : words) (text += text.empty() ? "" : ", ") += word;
        return text;
    }

    void begin_elements(const std::vector<std::string_view>& words) {
        const std::string type = lower_case(parameter(words, "type").value_or("")),
                          set = parameter(words, "elset").value_or("");
        if (type.starts_with("c3d") && !type.starts_with("c3d4"))
            file_.refuse("has elements " + type + "; only linear tetrahedra (C3D4) are read");
        if (!type.starts_with("c3d4")) return;
        in_ = In::Tetrahedra;
        label_ = label_of_set_.try_emplace(set, static_cast<int>(label_of_set_.size()) + 1).first->second;
        if (!set.empty()) mesh_.label_names[label_] = set;
    }

    /// A set may be given in several pieces.
    void begin_set(const std::vector<std::string_view>& words) {
        const std::string name = parameter(words, "elset").value_or("");
        const auto known = std::find_if(sets_.begin(), sets_.end(), [&](const ElementSet& set) {
            return lower_case(set.name) == lower_case(name);
        });
        set_ = static_cast<std::size_t>(known - sets_.begin());
        if (known == sets_.end()) sets_.push_back({name, parameter(words, "internal").has_value()});
        generates_ = parameter(words, "generate").has_value();
        in_ = In::Set;
    }

    void take(const std::vector<std::string_view>& entries) {
        if (in_ == In::Nodes) add_node(entries);
        if (in_ == In::Tetrahedra) add_tetrahedron(entries);
        if (in_ == In::Set) add_to_set(entries);
        if (in_ == In::Instance) require_in_place(entries);
    }

    void add_node(const std::vector<std::string_view>& entries) {
        if (entries.size() < 4) file_.fail("has a node of fewer than three coordinates");
        mesh_.add_node(file_.to_integer(entries[0]),
                       {file_.to_number(entries[1]), file_.to_number(entries[2]), file_.to_number(entries[3])}, file_);
    }

    void add_tetrahedron(const std::vector<std::string_view>& entries) {
        if (entries.size() < 5) file_.fail("has a C3D4 of fewer than four nodes");
        std::array<long long, 4> nodes{};
        for (std::size_t k = 0; k < 4; ++k) nodes[k] = file_.to_integer(entries[k + 1]);
        mesh_.tets.push_back(nodes);
        mesh_.labels.push_back(label_);
        numbers_.push_back(file_.to_integer(entries[0]));
    }

    /// "first, last, step" of GENERATE, else numbers of elements or names of sets.
    void add_to_set(const std::vector<std::string_view>& entries) {
        ElementSet& set = sets_[set_];
        if (generates_) {
            if (entries.size() < 2) file_.fail("has an element set '" + set.name + "' without its last element");
            const long long step = entries.size() > 2 && !entries[2].empty() ? file_.to_integer(entries[2]) : 1;
            if (step < 1) file_.refuse("has an element set '" + set.name + "' of steps of " + std::to_string(step));
            set.ranges.push_back({file_.to_integer(entries[0]), file_.to_integer(entries[1]), step});
            return;
        }
        for (const std::string_view entry : entries) {
            if (entry.empty()) continue;
            if (std::isdigit(static_cast<unsigned char>(entry.front())) == 0) {
                set.other_sets = entry;
                continue;
            }
            set.elements.insert(file_.to_integer(entry));
        }
    }

    /// The lines of *INSTANCE are a translation, and a rotation.
    void require_in_place(const std::vector<std::string_view>& entries) const {
        for (const std::string_view entry : entries)
            if (!entry.empty() && file_.to_number(entry) != 0)
                file_.refuse("places its part by an *INSTANCE with '" + joined(entries) +
                             "'; write nodes where they belong, without an assembly");
    }

    /// Sets that have a section, or all where none of them has one.
    [[nodiscard]] std::vector<const ElementSet*> regions() const {
        std::vector<const ElementSet*> all, with_section;
        for (const ElementSet& set : sets_) {
            if (!set.internal) all.push_back(&set);
            if (std::find(sections_.begin(), sections_.end(), lower_case(set.name)) != sections_.end())
                with_section.push_back(&set);
        }
        return with_section.empty() ? all : with_section;
    }

    /// Elements are in one set of *ELEMENT: sets of *ELSET that hold some of them are regions, numbered behind it.
    void label_by_sets() {
        std::string passed_over;
        std::vector<const ElementSet*> set_of(numbers_.size(), nullptr);
        for (const ElementSet* set : regions()) {
            std::vector<std::size_t> held = tetrahedra_of(*set);
            if (held.empty() || held.size() == numbers_.size()) continue;
            (passed_over += passed_over.empty() ? "" : ", ") += set->name;
            if (label_of_set_.size() > 1) continue;
            const int label = 2 + static_cast<int>(mesh_.label_names.size() - mesh_.label_names.count(1));
            mesh_.label_names[label] = set->name;
            for (const std::size_t t : held) {
                if (set_of[t] != nullptr)
                    file_.refuse("has element " + std::to_string(numbers_[t]) + " in the sets " + set_of[t]->name +
                                 " and " + set->name +
                                 "; a label is one set: leave those of the regions, or give these a *SOLID SECTION");
                set_of[t] = set;
                mesh_.labels[t] = label;
            }
        }
        if (label_of_set_.size() > 1 && !passed_over.empty())
            mesh_.notes.push_back("its labels are the sets of *ELEMENT; sets of *ELSET are passed over: " +
                                  passed_over);
        else if (!passed_over.empty())
            mesh_.notes.push_back("sets of *ELSET are its labels: " + passed_over);
    }

    [[nodiscard]] std::vector<std::size_t> tetrahedra_of(const ElementSet& set) const {
        if (!set.other_sets.empty())
            file_.refuse("has the element set " + set.name + " made of others (" + set.other_sets +
                         "); list its elements");
        std::vector<std::size_t> held;
        for (std::size_t t = 0; t < numbers_.size(); ++t)
            if (set.holds(numbers_[t])) held.push_back(t);
        return held;
    }
};

}  // namespace

RawTetrahedra read_inp(FileReader& file) {
    return InpReader(file).read();
}

}  // namespace tissuewarp::meshing::detail
