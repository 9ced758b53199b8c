#include "server/journal.hpp"

#include "server/crc64.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

namespace tissuewarp::server {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t entry_header = 1 + 4 + 8 + 8;  // kind, client, length, checksum of the payload

/// The first line, which tells whose log it is.
std::string first_line(const std::string& patient_digest) {
    return "tissuewarp server log 1 " + patient_digest + "\n";
}

[[noreturn]] void fail(const fs::path& path, const char* what) {
    throw IoError(std::string("cannot ") + what + " '" + path.string() + "': " + std::strerror(errno));
}

/// Reads the next entry; false at the end, or where the rest is none.
bool read_entry(std::ifstream& file, std::uint64_t left, Entry& entry) {
    Bytes head(entry_header);
    if (left < entry_header || !file.read(reinterpret_cast<char*>(head.data()), entry_header)) return false;
    Reader reader(head);
    entry.kind = static_cast<Entry::Kind>(reader.u8());
    entry.client = reader.u32();
    const std::uint64_t length = reader.u64(), crc = reader.u64();
    if (length > left - entry_header) return false;
    entry.payload.resize(length);
    if (!file.read(reinterpret_cast<char*>(entry.payload.data()), static_cast<std::streamsize>(length))) return false;
    return crc64(entry.payload) == crc;
}

/// Where the last whole entry ends.
std::uint64_t read_entries(const fs::path& path, const std::string& patient_digest,
                           const std::function<void(const Entry&)>& each) {
    std::ifstream file(path, std::ios::binary);
    if (!file) fail(path, "read");
    const std::uint64_t size = fs::file_size(path);
    const std::string wanted = first_line(patient_digest);
    std::string line(wanted.size(), '\0');
    file.read(line.data(), static_cast<std::streamsize>(line.size()));
    if (line != wanted)
        throw InvalidInput("'" + path.string() +
                           "' is no log of this patient's server; give --log another name, or the patient it is of");
    std::uint64_t end = wanted.size();
    for (Entry entry; read_entry(file, size - end, entry); end += entry_header + entry.payload.size()) each(entry);
    return end;
}

}  // namespace

Journal::Journal(fs::path path, std::string patient_digest) : path_(std::move(path)) {
    std::error_code none;
    const bool begun = fs::exists(path_, none) && fs::file_size(path_, none) > 0;
    const std::uint64_t end = begun ? read_entries(path_, patient_digest, [](const Entry&) {}) : 0;
    file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_APPEND | O_NOFOLLOW, 0600);
    if (file_ < 0) fail(path_, "write");
    if (begun) {
        if (::ftruncate(file_, static_cast<off_t>(end)) != 0) fail(path_, "write");
        return;
    }
    const std::string line = first_line(patient_digest);
    if (::write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) fail(path_, "write");
}

Journal::~Journal() {
    ::close(file_);
}

void Journal::append(Entry::Kind kind, std::uint32_t client, ByteView payload) {
    Writer writer;
    writer.bytes().reserve(entry_header + payload.size());
    writer.u8(static_cast<std::uint8_t>(kind));
    writer.u32(client);
    writer.u64(payload.size());
    writer.u64(crc64(payload));
    writer.raw(payload);
    const std::scoped_lock lock(mutex_);
    for (ByteView rest = writer.bytes(); !rest.empty();) {
        const ssize_t written = ::write(file_, rest.data(), rest.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) fail(path_, "write");
        rest = rest.subspan(static_cast<std::size_t>(written));
    }
}

void read_journal(const fs::path& path, const std::string& patient_digest,
                  const std::function<void(const Entry&)>& each) {
    read_entries(path, patient_digest, each);
}

}  // namespace tissuewarp::server
