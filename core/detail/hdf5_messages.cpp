#include "core/detail/hdf5_messages.hpp"

namespace tissuewarp::detail {

namespace {

/// Deflate saves a factor of 1032 at most.
constexpr std::uint64_t most_packed = 1032;

void require_in(const Hdf5Bytes& file, Hdf5Range message, std::uint64_t begin, std::uint64_t bytes) {
    if (begin > message.end || bytes > message.end - begin) file.fail("a message of a header is cut short");
}

bool is_ieee(const Hdf5Bytes& file, std::uint64_t at, std::uint64_t bytes) {
    const std::uint64_t layout = file.at<std::uint64_t>(at + 8);  // offset, precision, exponent, mantissa
    const std::uint32_t bias = file.at<std::uint32_t>(at + 16);
    const bool normalised = (file.at<std::uint8_t>(at + 1) & 0x30U) == 0x20U;
    const auto sign = file.at<std::uint8_t>(at + 2);
    if (bytes == 4) return layout == 0x17'00'08'17'0020'0000ULL && bias == 127 && sign == 31 && normalised;
    return bytes == 8 && layout == 0x34'00'0b'34'0040'0000ULL && bias == 1023 && sign == 63 && normalised;
}

}  // namespace

Hdf5Type hdf5_type(const Hdf5Bytes& file, Hdf5Range message) {
    enum Class { Integer = 0, Real = 1, Text = 3, Variable = 9 };
    const std::uint64_t at = message.begin;
    require_in(file, message, at, 8);
    const int kind = file.at<std::uint8_t>(at) & 15, version = file.at<std::uint8_t>(at) >> 4;
    const std::uint64_t bytes = file.at<std::uint32_t>(at + 4);
    if (version < 1 || version > 3) file.refuse("a type of unknown version");
    if (kind == Integer) {
        require_in(file, message, at + 8, 4);
        const bool narrow = bytes == 1 || bytes == 2 || bytes == 4 || bytes == 8;
        if (!narrow || file.at<std::uint16_t>(at + 8) != 0 || file.at<std::uint16_t>(at + 10) != 8 * bytes)
            file.fail("integers of an unknown kind");
        return {bytes, false};
    }
    if (kind == Real) {
        require_in(file, message, at + 8, 12);
        if (!is_ieee(file, at, bytes)) file.fail("reals of an unknown kind");
        return {bytes, false};
    }
    if (kind == Text && bytes >= 1 && bytes <= 65536) return {bytes, false};
    if (kind != Variable || bytes != 16) file.refuse("values that are neither numbers nor texts");
    if (hdf5_type(file, {at + 8, message.end}).bytes != 1) file.fail("lists of values");
    return {16, true};
}

Hdf5Space hdf5_space(const Hdf5Bytes& file, Hdf5Range message) {
    require_in(file, message, message.begin, 4);
    const int version = file.at<std::uint8_t>(message.begin), rank = file.at<std::uint8_t>(message.begin + 1);
    const auto flags = file.at<std::uint8_t>(message.begin + 2);
    constexpr int most_rank = 32;
    if ((version != 1 && version != 2) || rank > most_rank) file.refuse("a shape of unknown version");
    const bool none = version == 2 && file.at<std::uint8_t>(message.begin + 3) == 2;
    const std::uint64_t sizes = message.begin + (version == 1 ? 8 : 4);
    require_in(file, message, sizes, 8U * static_cast<unsigned>(rank) * ((flags & 1U) ? 2U : 1U));
    double count = none ? 0 : 1;
    Hdf5Space space{rank, 0, {}};
    for (int axis = 0; axis < rank; ++axis) {
        space.sizes.push_back(file.at<std::uint64_t>(sizes + 8U * static_cast<unsigned>(axis)));
        count *= static_cast<double>(space.sizes.back());
    }
    if (count > static_cast<double>(most_packed) * static_cast<double>(file.size()))
        file.fail("a dataset claims more values than the file can hold");
    space.values = static_cast<std::uint64_t>(count);
    return space;
}

Hdf5Layout hdf5_layout(const Hdf5Bytes& file, Hdf5Range message) {
    require_in(file, message, message.begin, 2);
    if (file.at<std::uint8_t>(message.begin) != 3) file.refuse("a dataset's layout is of another version than 3");
    const std::uint64_t at = message.begin + 2;
    Hdf5Layout layout;
    switch (file.at<std::uint8_t>(message.begin + 1)) {
        case 0:
            require_in(file, message, at, 2);
            layout = {Hdf5Layout::Kind::Compact, at + 2, file.at<std::uint16_t>(at), {}};
            require_in(file, message, layout.address, layout.bytes);
            return layout;
        case 1:
            require_in(file, message, at, 16);
            layout = {Hdf5Layout::Kind::Contiguous, file.at<std::uint64_t>(at), file.at<std::uint64_t>(at + 8), {}};
            if (layout.address != hdf5_nowhere) file.require(layout.address, layout.bytes);
            return layout;
        case 2:
            require_in(file, message, at, 9);
            layout = {Hdf5Layout::Kind::Chunked, file.at<std::uint64_t>(at + 1), 0, {}};
            require_in(file, message, at + 9, 4U * file.at<std::uint8_t>(at));
            for (unsigned axis = 0; axis < file.at<std::uint8_t>(at); ++axis)
                layout.chunk.push_back(file.at<std::uint32_t>(at + 9 + 4U * axis));
            return layout;
        default:
            file.refuse("a dataset's layout is unknown");
    }
}

void require_hdf5_filters(const Hdf5Bytes& file, Hdf5Range message) {
    enum Filter { Deflate = 1, Shuffle = 2, Fletcher32 = 3 };
    require_in(file, message, message.begin, 2);
    const int version = file.at<std::uint8_t>(message.begin), count = file.at<std::uint8_t>(message.begin + 1);
    if ((version != 1 && version != 2) || count > 8) file.refuse("a list of filters is of unknown version");
    std::uint64_t at = message.begin + (version == 1 ? 8 : 2);
    for (int left = count; left > 0; --left) {
        const bool named = version == 1;  // in version 2 the filters of HDF5 have no names
        require_in(file, message, at, named ? 8 : 6);
        const int filter = file.at<std::uint16_t>(at);
        if (filter != Deflate && filter != Shuffle && filter != Fletcher32)
            file.refuse("data are packed by filter " + std::to_string(filter) + ", which is not read");
        const std::uint64_t name = named ? file.at<std::uint16_t>(at + 2) : 0;
        const std::uint64_t values = file.at<std::uint16_t>(at + (named ? 6 : 4));
        if (name % 8 != 0 && named) file.fail("a filter's name has an odd length");
        at += (named ? 8 : 6) + name + 4 * (values + (named ? values % 2 : 0));
        if (values > 16 || at > message.end) file.fail("a filter is cut short");
    }
}

std::uint64_t hdf5_fill_bytes(const Hdf5Bytes& file, Hdf5Range message, bool old) {
    std::uint64_t at = message.begin;
    if (!old) {
        require_in(file, message, at, 2);
        const int version = file.at<std::uint8_t>(at);
        if (version < 1 || version > 3) file.refuse("a fill value is of unknown version");
        if (version == 3 && (file.at<std::uint8_t>(at + 1) & 0x20U) == 0) return 0;
        if (version < 3) require_in(file, message, at, 4);
        if (version == 2 && file.at<std::uint8_t>(at + 3) == 0) return 0;
        at += version == 3 ? 2 : 4;
    }
    require_in(file, message, at, 4);
    const std::uint64_t bytes = file.at<std::uint32_t>(at);
    require_in(file, message, at + 4, bytes);
    return bytes;
}

}  // namespace tissuewarp::detail
