#include "core/file_message.hpp"

namespace tissuewarp {

namespace {

/// Where a character of UTF-8 begins, at `at` or before.
std::size_t beginning_of_character(const std::string& text, std::size_t at) {
    while (at > 0 && (static_cast<unsigned char>(text[at]) & 0xc0U) == 0x80U) --at;
    return at;
}

}  // namespace

std::string presentable(std::string message) {
    constexpr std::size_t most = 1000, of_the_end = 300;
    if (message.size() > most) {
        const std::size_t head = beginning_of_character(message, most - of_the_end),
                          tail = beginning_of_character(message, message.size() - of_the_end);
        message = message.substr(0, head) + " … " + message.substr(tail);
    }
    for (char& c : message)
        if ((static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f) c = '?';
    return message;
}

std::string message_naming(const std::filesystem::path& path, const std::string& message) {
    const std::string name = path.string();
    return presentable(message.find(name) != std::string::npos ? message
                                                               : std::string("'").append(name).append("': ") + message);
}

}  // namespace tissuewarp
