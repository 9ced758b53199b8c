#include "core/detail/hdf5_structure.hpp"

#include "core/detail/hdf5_messages.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace tissuewarp::detail {

namespace {

enum Message {
    Nothing = 0,
    Space = 1,
    LinkInfo = 2,
    Type = 3,
    OldFill = 4,
    Fill = 5,
    Link = 6,
    Layout = 8,
    GroupInfo = 10,
    Filters = 11,
    Attribute = 12,
    Comment = 13,
    OldTime = 14,
    Continuation = 16,
    Group = 17,
    Time = 18,
    AttributeInfo = 21,
    References = 22
};

/// What the messages of one header say together.
struct Object {
    Hdf5Type type;
    Hdf5Space space;
    Hdf5Layout layout;
    std::uint64_t fill_bytes = 0;
};

class Walk {
public:
    explicit Walk(const std::filesystem::path& path) : file_(path) {}

    void begin() {
        constexpr std::string_view signature = "\x89HDF\r\n\x1a\n";
        if (!file_.begins(0, signature)) file_.fail("it does not begin as HDF5 does");
        const int version = file_.at<std::uint8_t>(8);
        if (version > 3) file_.refuse("it is of an unknown version of HDF5");
        const std::uint64_t sizes = version < 2 ? 13 : 9;
        if (file_.at<std::uint16_t>(sizes) != 0x0808) file_.refuse("its addresses do not have eight bytes");
        version < 2 ? begin_old(version) : begin_new();
    }

private:
    Hdf5Bytes file_;
    std::set<std::uint64_t> headers_, blocks_;
    std::map<std::uint64_t, std::map<int, std::uint64_t>> collections_;         // sizes of objects
    std::uint64_t leaf_entries_ = 8, group_entries_ = 32, chunk_entries_ = 64;  // most in a node
    int depth_ = 0;

    void begin_old(int version) {
        leaf_entries_ = 2U * file_.at<std::uint16_t>(16);
        group_entries_ = 2U * file_.at<std::uint16_t>(18);
        if (version == 1) chunk_entries_ = 2U * file_.at<std::uint16_t>(24);
        if (leaf_entries_ == 0 || group_entries_ == 0 || chunk_entries_ == 0) file_.fail("its nodes hold nothing");
        const std::uint64_t addresses = version == 0 ? 24 : 28;
        if (file_.at<std::uint64_t>(addresses) != 0 || file_.at<std::uint64_t>(addresses + 8) != hdf5_nowhere ||
            file_.at<std::uint64_t>(addresses + 24) != hdf5_nowhere)
            file_.refuse("it has a driver or a list of free space");
        file_.require(0, file_.at<std::uint64_t>(addresses + 16));
        take_entry(addresses + 32, {});
    }

    void begin_new() {
        if (file_.at<std::uint64_t>(12) != 0 || file_.at<std::uint64_t>(20) != hdf5_nowhere)
            file_.refuse("it does not begin at its first byte, or its superblock is extended");
        file_.require(0, file_.at<std::uint64_t>(28));
        take_header(file_.at<std::uint64_t>(36));
    }

    // Object headers

    void take_header(std::uint64_t at) {
        constexpr int deepest = 64;
        if (!headers_.insert(at).second) return;
        if (++depth_ > deepest) file_.fail("its groups lie too deep");
        Object object;
        if (file_.begins(at, "OHDR"))
            take_new_header(at, object);
        else
            take_old_header(at, object);
        if (object.layout.kind != Hdf5Layout::Kind::None) check_dataset(object);
        --depth_;
    }

    void take_old_header(std::uint64_t at, Object& object) {
        if (file_.at<std::uint8_t>(at) != 1) file_.fail("an object has no header");
        take_old_messages(at + 16, file_.at<std::uint32_t>(at + 8), object);
    }

    void take_old_messages(std::uint64_t at, std::uint64_t bytes, Object& object) {
        take_block(at, bytes);
        const std::uint64_t end = at + bytes;
        while (end - at >= 8) {
            const int type = file_.at<std::uint16_t>(at), flags = file_.at<std::uint8_t>(at + 4);
            const std::uint64_t size = file_.at<std::uint16_t>(at + 2);
            if (size > end - at - 8) file_.fail("a message leaves its header");
            take_message(type, flags, {at + 8, at + 8 + size}, object, false);
            at += 8 + size;
        }
    }

    void take_new_header(std::uint64_t at, Object& object) {
        const auto flags = file_.at<std::uint8_t>(at + 5);
        if (file_.at<std::uint8_t>(at + 4) != 2) file_.refuse("an object header of unknown version");
        const std::uint64_t width = 1U << (flags & 3U), order = (flags & 4U) ? 2 : 0;
        at += 6 + ((flags & 0x20U) ? 16 : 0) + ((flags & 0x10U) ? 4 : 0);
        take_new_messages(at + width, file_.whole(at, width), order, object);
    }

    void take_new_messages(std::uint64_t at, std::uint64_t bytes, std::uint64_t order, Object& object) {
        take_block(at, bytes);
        const std::uint64_t end = at + bytes, head = 4 + order;
        order_ = order;
        while (end - at >= head) {
            const int type = file_.at<std::uint8_t>(at), flags = file_.at<std::uint8_t>(at + 3);
            const std::uint64_t size = file_.at<std::uint16_t>(at + 1);
            if (size > end - at - head) file_.fail("a message leaves its header");
            take_message(type, flags, {at + head, at + head + size}, object, true);
            order_ = order;
            at += head + size;
        }
    }
    std::uint64_t order_ = 0;

    /// Refuses what was seen before: a part that holds itself.
    void take_block(std::uint64_t at, std::uint64_t bytes) {
        file_.require(at, bytes);
        if (!blocks_.insert(at).second) file_.fail("a part of it belongs to two others");
    }

    void take_message(int type, int flags, Hdf5Range body, Object& object, bool is_new) {
        if (type != Nothing && (flags & 2) != 0) file_.refuse("a message is shared");
        switch (type) {
            case Space:
                object.space = hdf5_space(file_, body);
                break;
            case Type:
                object.type = hdf5_type(file_, body);
                break;
            case OldFill:
            case Fill:
                object.fill_bytes = std::max(object.fill_bytes, hdf5_fill_bytes(file_, body, type == OldFill));
                break;
            case Layout:
                object.layout = hdf5_layout(file_, body);
                break;
            case Filters:
                require_hdf5_filters(file_, body);
                break;
            case Attribute:
                take_attribute(body);
                break;
            case Link:
                take_link(body);
                break;
            case Group:
                take_group(file_.at<std::uint64_t>(body.begin), file_.at<std::uint64_t>(body.begin + 8));
                break;
            case Continuation:
                take_continuation(file_.at<std::uint64_t>(body.begin), file_.at<std::uint64_t>(body.begin + 8), object,
                                  is_new);
                break;
            case LinkInfo:
                require_compact(body, 8);
                break;
            case AttributeInfo:
                require_compact(body, 2);
                break;
            case Nothing:
            case GroupInfo:
            case Comment:
            case OldTime:
            case Time:
            case References:
                break;
            default:
                file_.refuse("a header holds a message of type " + std::to_string(type) + ", which is not read");
        }
    }

    /// More than eight links or attributes lie in heaps of their own; what those hold was not followed.
    void require_compact(Hdf5Range body, std::uint64_t index_bytes) {
        const std::uint64_t at =
            body.begin + 2 + ((file_.at<std::uint8_t>(body.begin + 1) & 1U) != 0 ? index_bytes : 0);
        if (at + 8 > body.end || file_.at<std::uint64_t>(at) != hdf5_nowhere)
            file_.refuse("a group has more than eight parts, listed as of HDF5 1.8");
    }

    void take_continuation(std::uint64_t at, std::uint64_t bytes, Object& object, bool is_new) {
        if (!is_new) return take_old_messages(at, bytes, object);
        if (bytes < 8 || !file_.begins(at, "OCHK")) file_.fail("a header is not continued where it says");
        take_new_messages(at + 4, bytes - 8, order_, object);
    }

    void take_attribute(Hdf5Range body) {
        if (body.end - body.begin < 8) file_.fail("an attribute is cut short");
        const int version = file_.at<std::uint8_t>(body.begin);
        if (version < 1 || version > 3 || file_.at<std::uint8_t>(body.begin + 1) != 0)
            file_.refuse("an attribute of unknown version");
        const auto padded = [&](std::uint64_t bytes) { return version == 1 ? (bytes + 7) / 8 * 8 : bytes; };
        const std::uint64_t name = file_.at<std::uint16_t>(body.begin + 2),
                            type = file_.at<std::uint16_t>(body.begin + 4),
                            space = file_.at<std::uint16_t>(body.begin + 6);
        std::uint64_t at = body.begin + (version == 3 ? 9 : 8);
        if (padded(name) + padded(type) + padded(space) > body.end - std::min(at, body.end) ||
            !file_.holds_text(at, at + name))
            file_.fail("an attribute is cut short");
        at += padded(name);
        const Hdf5Type values = hdf5_type(file_, {at, at + type});
        at += padded(type);
        const Hdf5Space shape = hdf5_space(file_, {at, at + space});
        at += padded(space);
        if (shape.values > (body.end - at) / values.bytes) file_.fail("an attribute's values are cut short");
        if (values.texts) check_texts(at, shape.values);
    }

    // Datasets

    void check_dataset(const Object& object) {
        const Hdf5Layout& layout = object.layout;
        const std::uint64_t value = object.type.bytes;
        if (value == 0 || object.space.rank < 0) file_.fail("a dataset lacks a type or a shape");
        if (object.fill_bytes != 0 && object.fill_bytes != value) file_.fail("a fill value is of another type");
        const bool stored = layout.kind == Hdf5Layout::Kind::Compact ||
                            (layout.kind == Hdf5Layout::Kind::Contiguous && layout.address != hdf5_nowhere);
        if (object.space.values > 0 && !stored && layout.kind != Hdf5Layout::Kind::Chunked)
            file_.fail("a dataset's values are missing");
        if (stored && object.space.values > layout.bytes / value) file_.fail("a dataset's values are cut short");
        if (stored && object.type.texts) check_texts(layout.address, object.space.values);
        if (layout.kind == Hdf5Layout::Kind::Chunked) check_chunks(object);
    }

    void check_chunks(const Object& object) {
        const std::vector<std::uint64_t>& chunk = object.layout.chunk;
        double bytes = 1;
        for (const std::uint64_t size : chunk) bytes *= static_cast<double>(size);
        if (object.type.texts || chunk.size() != static_cast<std::size_t>(object.space.rank) + 1 ||
            chunk.back() != object.type.bytes || bytes == 0 || bytes > 1032.0 * static_cast<double>(file_.size()))
            file_.fail("a dataset's pieces do not fit it");
        double pieces = 1, found = 0;
        for (std::size_t axis = 0; axis + 1 < chunk.size(); ++axis)
            pieces *= std::ceil(static_cast<double>(object.space.sizes[axis]) / static_cast<double>(chunk[axis]));
        if (object.layout.address != hdf5_nowhere)
            found = static_cast<double>(take_chunk_node(object.layout.address, chunk.size(), most_levels));
        if (found != pieces) file_.fail("pieces of a dataset are missing");
    }

    // Trees (version 1)

    static constexpr int most_levels = 16;

    struct Node {
        int level = 0;
        std::uint64_t entries = 0;
    };

    Node take_node(std::uint64_t at, int type, std::uint64_t most, std::uint64_t key_bytes) {
        take_block(at, 24 + most * 8 + (most + 1) * key_bytes);
        const Node node{file_.at<std::uint8_t>(at + 5), file_.at<std::uint16_t>(at + 6)};
        if (!file_.begins(at, "TREE") || file_.at<std::uint8_t>(at + 4) != type || node.entries > most)
            file_.fail("a node of a tree is none");
        return node;
    }

    void require_level(const Node& node, int above) {
        if (node.level >= above || (above < most_levels && node.level != above - 1))
            file_.fail("the levels of a tree are mixed up");
    }

    /// Pieces in it.
    std::uint64_t take_chunk_node(std::uint64_t at, std::uint64_t axes, int above) {
        const std::uint64_t key = 8 + 8 * axes;
        const Node node = take_node(at, 1, chunk_entries_, key);
        require_level(node, above);
        std::uint64_t pieces = 0;
        for (std::uint64_t entry = 0; entry < node.entries; ++entry) {
            const std::uint64_t place = at + 24 + entry * (key + 8), child = file_.at<std::uint64_t>(place + key);
            if (node.level == 0) file_.require(child, file_.at<std::uint32_t>(place));
            pieces += node.level > 0 ? take_chunk_node(child, axes, node.level) : 1;
        }
        return pieces;
    }

    // Groups

    struct Heap {
        std::uint64_t data = 0, bytes = 0;
    };

    void take_group(std::uint64_t tree, std::uint64_t heap_at) {
        if (blocks_.contains(tree)) return;  // the superblock repeats what the root's header says
        const Heap heap = heap_of(heap_at);
        take_group_node(tree, heap, most_levels);
    }

    /// A local heap: the names of one group.
    Heap heap_of(std::uint64_t at) {
        if (!file_.begins(at, "HEAP")) file_.fail("a group has no names");
        const Heap heap{file_.at<std::uint64_t>(at + 24), file_.at<std::uint64_t>(at + 8)};
        file_.require(heap.data, heap.bytes);
        constexpr std::uint64_t last = 1;
        std::uint64_t free = file_.at<std::uint64_t>(at + 16), most = heap.bytes / 16;
        while (free != last && free != hdf5_nowhere) {
            if (most-- == 0 || free > heap.bytes || heap.bytes - free < 16 ||
                file_.at<std::uint64_t>(heap.data + free + 8) > heap.bytes - free)
                file_.fail("the free space among a group's names is none");
            free = file_.at<std::uint64_t>(heap.data + free);
        }
        return heap;
    }

    void require_name(const Heap& heap, std::uint64_t offset) {
        if (offset >= heap.bytes || !file_.holds_text(heap.data + offset, heap.data + heap.bytes))
            file_.fail("a name lies outside of its group");
    }

    void take_group_node(std::uint64_t at, const Heap& heap, int above) {
        const Node node = take_node(at, 0, group_entries_, 8);
        require_level(node, above);
        for (std::uint64_t entry = 0; entry < node.entries; ++entry) {
            const std::uint64_t place = at + 24 + 16 * entry;
            require_name(heap, file_.at<std::uint64_t>(place));
            require_name(heap, file_.at<std::uint64_t>(place + 16));
            const std::uint64_t child = file_.at<std::uint64_t>(place + 8);
            node.level > 0 ? take_group_node(child, heap, node.level) : take_symbols(child, heap);
        }
    }

    void take_symbols(std::uint64_t at, const Heap& heap) {
        take_block(at, 8 + 40 * leaf_entries_);
        const std::uint64_t count = file_.at<std::uint16_t>(at + 6);
        if (!file_.begins(at, "SNOD") || file_.at<std::uint8_t>(at + 4) != 1 || count > leaf_entries_)
            file_.fail("a list of names is none");
        for (std::uint64_t entry = 0; entry < count; ++entry) take_entry(at + 8 + 40 * entry, heap);
    }

    /// A symbol table entry; the root's has no name.
    void take_entry(std::uint64_t at, const Heap& heap) {
        if (heap.bytes > 0) require_name(heap, file_.at<std::uint64_t>(at));
        const std::uint32_t cached = file_.at<std::uint32_t>(at + 16);
        if (cached > 1) file_.refuse("a name is a link to another one");
        take_header(file_.at<std::uint64_t>(at + 8));
        if (cached == 1) take_group(file_.at<std::uint64_t>(at + 24), file_.at<std::uint64_t>(at + 32));
    }

    void take_link(Hdf5Range body) {
        if (body.end - body.begin < 3 || file_.at<std::uint8_t>(body.begin) != 1) file_.fail("a link is cut short");
        const auto flags = file_.at<std::uint8_t>(body.begin + 1);
        std::uint64_t at = body.begin + 2;
        if ((flags & 8U) != 0 && file_.at<std::uint8_t>(at++) != 0) file_.refuse("a name is a link to another one");
        at += ((flags & 4U) != 0 ? 8 : 0) + ((flags & 16U) != 0 ? 1 : 0);
        const std::uint64_t width = 1U << (flags & 3U), name = file_.whole(at, width);
        if (at + width > body.end || name > body.end - at - width || body.end - at - width - name < 8)
            file_.fail("a link is cut short");
        take_header(file_.at<std::uint64_t>(at + width + name));
    }

    // Texts

    /// Each refers to an object of a global heap, of just its length.
    void check_texts(std::uint64_t at, std::uint64_t count) {
        for (std::uint64_t text = 0; text < count; ++text, at += 16) {
            const std::uint64_t length = file_.at<std::uint32_t>(at), heap = file_.at<std::uint64_t>(at + 4);
            if (length == 0 && heap == 0) continue;
            const auto& objects = collection(heap);
            const auto object = objects.find(static_cast<int>(file_.at<std::uint32_t>(at + 12)));
            if (object == objects.end() || object->second != length) file_.fail("a text is not where it should be");
        }
    }

    const std::map<int, std::uint64_t>& collection(std::uint64_t at) {
        const auto [entry, added] = collections_.try_emplace(at);
        if (!added) return entry->second;
        const std::uint64_t bytes = file_.at<std::uint64_t>(at + 8), least = 4096;
        if (!file_.begins(at, "GCOL") || file_.at<std::uint8_t>(at + 4) != 1 || bytes < least)
            file_.fail("a collection of texts is none");
        file_.require(at, bytes);
        const std::uint64_t end = at + bytes;
        for (at += 16; end - at >= 16;) {
            const int number = file_.at<std::uint16_t>(at);
            const std::uint64_t size = file_.at<std::uint64_t>(at + 8);
            if (number == 0) {  // free space to the end, its own head with it
                if (size != end - at) file_.fail("the free space among texts is none");
                break;
            }
            if (size > end - at - 16 || !entry->second.try_emplace(number, size).second)
                file_.fail("a collection of texts is mixed up");
            at += std::min(16 + (size + 7) / 8 * 8, end - at);
        }
        return entry->second;
    }
};

}  // namespace

void require_sound_hdf5(const std::filesystem::path& path) {
    Walk(path).begin();
}

}  // namespace tissuewarp::detail
