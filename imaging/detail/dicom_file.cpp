#include "imaging/detail/dicom_file.hpp"

#include "imaging/detail/dicom_bits.hpp"
#include "imaging/detail/dicom_set.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/isolated.hpp"

#include <Eigen/Geometry>

#include <gdcmFragment.h>
#include <gdcmPixmap.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// Attributes of frames: in their own functional groups, in the shared ones, or, in files of one frame, in the file.
class FrameAttributes {
public:
    FrameAttributes(const fs::path& path, const DicomSet& file)
        : path_(path), file_(file), own_(file.items(0x52009230)), shared_(file.items(0x52009229)) {}

    DicomFrame frame(std::size_t index) {
        DicomFrame frame;
        if (const auto p = stated({0x00209113, 0x00200032, index, "Image Position (Patient)"}, 3))
            frame.position = Eigen::Vector3d((*p)[0], (*p)[1], (*p)[2]);
        if (const auto a = stated({0x00209116, 0x00200037, index, "Image Orientation (Patient)"}, 6))
            frame.axes = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(a->data()).colwise().normalized();
        constexpr DicomTag measures = 0x00289110, transformation = 0x00289145;
        // The distance between rows, that along j, comes first.
        if (const auto s = stated({measures, 0x00280030, index, "Pixel Spacing"}, 2))
            frame.spacing = {(*s)[1], (*s)[0]};
        frame.slice_spacing = number(measures, 0x00180088, index);
        if (!frame.slice_spacing) frame.slice_spacing = number(measures, 0x00180050, index);
        frame.intercept = number(transformation, 0x00281052, index).value_or(0.0);
        frame.slope = number(transformation, 0x00281053, index).value_or(1.0);
        if (const auto set = group(0x00209111, index)) frame.stack = set->text(0x00209056);
        if (const auto set = group(0x0062000a, index)) frame.segment = set->whole(0x0062000b, 0);
        return frame;
    }

private:
    const fs::path& path_;
    const DicomSet& file_;
    std::vector<DicomSet> own_, shared_;

    std::optional<DicomSet> group(DicomTag sequence, std::size_t index) {
        for (const DicomSet* groups :
             {index < own_.size() ? &own_[index] : nullptr, shared_.empty() ? nullptr : &shared_.front()}) {
            if (groups == nullptr) continue;
            std::vector<DicomSet> items = groups->items(sequence);
            if (!items.empty()) return std::move(items.front());
        }
        return std::nullopt;
    }
    std::optional<std::vector<double>> numbers(DicomTag sequence, DicomTag tag, std::size_t index, std::size_t count) {
        if (const auto set = group(sequence, index))
            if (auto found = set->numbers(tag, count)) return found;
        return file_.numbers(tag, count);
    }
    struct Attribute {
        DicomTag sequence, tag;
        std::size_t index;
        const char* name;
    };
    /// What places a frame: nothing where it is absent, and an error where it is there and is no numbers.
    std::optional<std::vector<double>> stated(const Attribute& attribute, std::size_t count) {
        auto found = numbers(attribute.sequence, attribute.tag, attribute.index, count);
        if (found) return found;
        const auto set = group(attribute.sequence, attribute.index);
        const std::string text = (set && set->contains(attribute.tag) ? *set : file_).text(attribute.tag);
        if (text.empty()) return std::nullopt;
        throw unusable(path_, std::string(attribute.name) + " is '" + text + "' where " + std::to_string(count) +
                                  " numbers with decimal points belong, separated by backslashes; correct it");
    }
    std::optional<double> number(DicomTag sequence, DicomTag tag, std::size_t index) {
        const auto found = numbers(sequence, tag, index, 1);
        return found ? std::optional((*found)[0]) : std::nullopt;
    }
};

/// Planes of a dose (RT Dose): offsets along the normal from the one position of the file.
void place_dose_planes(const DicomSet& set, std::vector<DicomFrame>& frames) {
    if (const auto scaling = set.number(0x3004000e))
        for (DicomFrame& frame : frames) frame.slope = *scaling;
    const auto offsets = set.numbers(0x3004000c, frames.size());
    if (!offsets || !frames[0].position || !frames[0].axes) return;
    const Eigen::Vector3d normal = frames[0].axes->col(0).cross(frames[0].axes->col(1)), first = *frames[0].position;
    for (std::size_t i = 0; i < frames.size(); ++i)
        frames[i].position = first + ((*offsets)[i] - (*offsets)[0]) * normal;
}

void read_segments(const DicomSet& set, DicomFile& file) {
    const std::string type = set.text(0x00620001);
    if (type == "FRACTIONAL") file.segmentation = DicomFile::Segmentation::Fractional;
    if (type == "BINARY") file.segmentation = DicomFile::Segmentation::Binary;
    if (type == "LABELMAP") file.segmentation = DicomFile::Segmentation::LabelMap;
    if (file.segmentation == DicomFile::Segmentation::None) return;
    file.most_fraction = set.whole(0x0062000e, 255);
    for (const DicomSet& segment : set.items(0x00620002))
        file.segment_names[segment.whole(0x00620004, 0)] = segment.text(0x00620005);
}

IoError damaged(const DicomFile& file, const std::string& cause) {
    return IoError("cannot read the pixels of '" + file.path.string() + "': " + cause + "; copy or convert the file");
}

cv::Mat frames_of(const DicomFile& file, int depth) {
    const int sizes[3] = {static_cast<int>(file.frames.size()), file.rows, file.columns};
    return {3, sizes, CV_MAKETYPE(depth, 1)};
}

/// Values of 8, 16 or 32 bits as they lie in the file: of them the stored bits count, with a sign or without.
template <class T, class Stored>
void unpack_values(const DicomFile& file, std::string_view bytes, bool swapped, cv::Mat& frames) {
    using Unsigned = std::make_unsigned_t<Stored>;
    const int unused =
        static_cast<int>(8 * sizeof(Stored)) - std::clamp(file.bits_stored, 1, static_cast<int>(8 * sizeof(Stored)));
    const int below = std::clamp(file.high_bit + 1 - file.bits_stored, 0, unused);
    T* target = frames.ptr<T>();
    for (std::size_t i = 0; i < frames.total(); ++i) {
        std::array<char, sizeof(Stored)> raw;
        std::memcpy(raw.data(), bytes.data() + i * sizeof(Stored), sizeof(Stored));
        if (swapped) std::reverse(raw.begin(), raw.end());
        const auto value = std::bit_cast<Unsigned>(raw);
        // Up to the top, so that a shift back brings the sign along.
        const auto top = static_cast<Unsigned>(value << (unused - below));
        target[i] = static_cast<T>(static_cast<Stored>(static_cast<Stored>(top) >> unused));
    }
}

cv::Mat values_of_bytes(const DicomFile& file, std::string_view bytes, bool swapped) {
    const bool has_sign = file.is_signed;
    const int depth = file.bits_allocated == 8    ? (has_sign ? CV_8S : CV_8U)
                      : file.bits_allocated == 16 ? (has_sign ? CV_16S : CV_16U)
                                                  : (has_sign ? CV_32S : CV_64F);
    cv::Mat frames = frames_of(file, depth);
    switch (depth) {
        case CV_8U:
            unpack_values<std::uint8_t, std::uint8_t>(file, bytes, false, frames);
            break;
        case CV_8S:
            unpack_values<std::int8_t, std::int8_t>(file, bytes, false, frames);
            break;
        case CV_16U:
            unpack_values<std::uint16_t, std::uint16_t>(file, bytes, swapped, frames);
            break;
        case CV_16S:
            unpack_values<std::int16_t, std::int16_t>(file, bytes, swapped, frames);
            break;
        case CV_32S:
            unpack_values<std::int32_t, std::int32_t>(file, bytes, swapped, frames);
            break;
        default:
            unpack_values<double, std::uint32_t>(file, bytes, swapped, frames);
            break;
    }
    return frames;
}

/// Bytes of all frames, unpacked; nothing where the transfer syntax is one that GDCM decodes.
std::optional<std::string> plain_bytes(const DicomFile& file, const DicomBytes& read) {
    const auto fragments = read.set.fragments(pixel_data);
    if (!fragments) {
        const std::string_view value = read.set.bytes(pixel_data);
        if (const std::uint64_t promised = read.set.promised(pixel_data); value.size() < promised)
            throw IoError("'" + file.path.string() + "' is cut short: " + std::to_string(value.size()) + " bytes of " +
                          std::to_string(promised) + " of pixels; copy the file again");
        return std::string(value);
    }
    const bool rle = read.transfer_syntax == "1.2.840.10008.1.2.5";
    const bool deflated = read.transfer_syntax == "1.2.840.10008.1.2.8.1";
    if (!rle && !deflated) return std::nullopt;
    if (fragments->size() != file.frames.size())
        throw damaged(file,
                      std::to_string(fragments->size()) + " packed frames of " + std::to_string(file.frames.size()));
    const std::uint64_t bits = static_cast<std::uint64_t>(file.rows) * static_cast<std::uint64_t>(file.columns) *
                               static_cast<std::uint64_t>(file.bits_allocated);
    std::string all;
    std::string joined_bits;
    for (const std::string_view fragment : *fragments) {
        std::string frame =
            rle ? unpack_rle(fragment, std::max<std::size_t>(1, static_cast<std::size_t>(file.bits_allocated) / 8))
                : unpack_deflated(fragment);
        if (8 * frame.size() < bits) throw damaged(file, "a packed frame is cut short or damaged");
        if (file.bits_allocated == 1) {
            joined_bits.resize(bits);
            unpack_bits(frame, bits, reinterpret_cast<std::uint8_t*>(joined_bits.data()));
            all += joined_bits;
        } else {
            all.append(frame, 0, bits / 8);
        }
    }
    return all;
}

/// Throws unless the frames are packed as the decoders below expect, and as large as the header promises.
void require_packed_frames(const DicomFile& file, const std::vector<std::string_view>& fragments) {
    if ((file.bits_allocated != 8 && file.bits_allocated != 16) || file.bits_stored < 1 ||
        file.bits_stored > file.bits_allocated || file.high_bit != file.bits_stored - 1)
        throw unusable(file.path, "its packed pixels take " + std::to_string(file.bits_stored) + " bits of " +
                                      std::to_string(file.bits_allocated) + ", up to bit " +
                                      std::to_string(file.high_bit) + "; convert it to 16 bits");
    const bool single = file.frames.size() == 1;  // which may lie in several fragments
    if (fragments.empty() || (!single && fragments.size() != file.frames.size()))
        throw damaged(file, std::to_string(fragments.size()) + " packed pieces of " +
                                std::to_string(file.frames.size()) + " frames");
    const std::array size{static_cast<std::uint32_t>(file.columns), static_cast<std::uint32_t>(file.rows)};
    for (std::size_t n = 0; n < (single ? 1 : fragments.size()); ++n)
        if (packed_frame_size(fragments[n]) != size)
            throw damaged(file, "packed frame " + std::to_string(n + 1) + " is not of the size " +
                                    text_of({1.0 * file.columns, 1.0 * file.rows}) + " that its header promises");
}

gdcm::DataElement element_of(const std::vector<std::string_view>& fragments) {
    const gdcm::SmartPointer<gdcm::SequenceOfFragments> sequence = new gdcm::SequenceOfFragments;
    for (const std::string_view bytes : fragments) {
        gdcm::Fragment fragment;
        fragment.SetByteValue(bytes.data(), gdcm::VL(static_cast<std::uint32_t>(bytes.size())));
        sequence->AddFragment(fragment);
    }
    gdcm::DataElement element(gdcm::Tag(0x7fe0, 0x0010));
    element.SetValue(*sequence);
    return element;
}

/// The packed frames alone: the library's own reading of the rest believes lengths that lie.
gdcm::Pixmap packed_pixmap(const DicomFile& file, const DicomBytes& read) {
    const std::vector<std::string_view> fragments = read.set.fragments(pixel_data).value();
    require_packed_frames(file, fragments);
    const auto syntax = gdcm::TransferSyntax::GetTSType(read.transfer_syntax.c_str());
    if (syntax == gdcm::TransferSyntax::TS_END || !gdcm::TransferSyntax(syntax).IsEncapsulated())
        throw damaged(file,
                      "they are packed in a way that is not known (transfer syntax '" + read.transfer_syntax + "')");
    gdcm::Pixmap pixmap;
    const bool single = file.frames.size() == 1;
    pixmap.SetNumberOfDimensions(single ? 2 : 3);
    pixmap.SetDimension(0, static_cast<unsigned>(file.columns));
    pixmap.SetDimension(1, static_cast<unsigned>(file.rows));
    if (!single) pixmap.SetDimension(2, static_cast<unsigned>(file.frames.size()));
    pixmap.SetPixelFormat(gdcm::PixelFormat(1, static_cast<unsigned short>(file.bits_allocated),
                                            static_cast<unsigned short>(file.bits_stored),
                                            static_cast<unsigned short>(file.high_bit), file.is_signed ? 1 : 0));
    pixmap.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
    pixmap.SetTransferSyntax(gdcm::TransferSyntax(syntax));
    pixmap.SetDataElement(element_of(fragments));
    return pixmap;
}

/// Frames of JPEG, JPEG-LS and JPEG 2000. The library's decoders end the program over damaged frames, and leave parts
/// of pictures unwritten.
cv::Mat decoded(const DicomFile& file, const DicomBytes& read) {
    // What the library would print becomes an exception here.
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    const gdcm::Pixmap pixmap = packed_pixmap(file, read);
    cv::Mat frames = frames_of(
        file, file.bits_allocated == 8 ? (file.is_signed ? CV_8S : CV_8U) : (file.is_signed ? CV_16S : CV_16U));
    const std::size_t bytes = frames.total() * frames.elemSize();
    const auto decode = [&](char* target) { return pixmap.GetBufferLength() == bytes && pixmap.GetBuffer(target); };
    if (!decode_isolated(decode, reinterpret_cast<char*>(frames.data), bytes))
        throw damaged(file, "they are cut short or damaged (transfer syntax " + read.transfer_syntax + ")");
    return frames;
}

DicomFile description_of(const fs::path& path, const DicomSet& set) {
    DicomFile file;
    file.path = path;
    file.rows = set.whole(0x00280010, 0);
    file.columns = set.whole(0x00280011, 0);
    file.series = set.text(0x0020000e);
    file.modality = set.text(0x00080060);
    file.samples = set.whole(0x00280002, 1);
    file.bits_allocated = set.whole(0x00280100, 0);
    file.bits_stored = set.whole(0x00280101, file.bits_allocated);
    file.high_bit = set.whole(0x00280102, file.bits_stored - 1);
    file.is_signed = set.whole(0x00280103, 0) != 0;
    file.palette = set.text(0x00280004) == "PALETTE COLOR";
    file.value_table = !set.items(0x00283000).empty();
    file.mosaic = set.text(0x00080008).find("MOSAIC") != std::string::npos;
    const double frames = set.number(0x00280008).value_or(1.0);
    values_of(path, {frames, 1.0 * file.rows, 1.0 * file.columns});
    std::error_code unknown;
    if (frames > 8.0 * static_cast<double>(fs::file_size(path, unknown)))
        throw unreadable(path, "it promises " + text_of({frames}) + " frames, more than it can hold; it is damaged");
    FrameAttributes attributes(path, set);
    for (std::size_t i = 0; i < static_cast<std::size_t>(frames); ++i) file.frames.push_back(attributes.frame(i));
    if (file.modality == "RTDOSE") place_dose_planes(set, file.frames);
    read_segments(set, file);
    return file;
}

/// Turns what does not end within the file into words.
template <class Read>
auto within_file(const fs::path& path, const Read& read) {
    try {
        return read();
    } catch (const std::out_of_range&) {
        throw IoError("cannot read '" + path.string() + "' as DICOM: it is cut short or damaged; copy the file again");
    }
}

}  // namespace

std::optional<DicomFile> read_dicom_file(const fs::path& path) {
    const DicomBytes read(path);
    if (read.set.whole(0x00280010, 0) == 0 || read.set.whole(0x00280011, 0) == 0) return std::nullopt;
    return within_file(path, [&] { return description_of(path, read.set); });
}

cv::Mat read_dicom_pixels(const DicomFile& file) {
    const bool label_map = file.segmentation == DicomFile::Segmentation::LabelMap;  // whose colours are for display
    if (file.samples != 1 || (file.palette && !label_map))
        throw unusable(file.path, "it is a colour image; give a grey one");
    const int bits = file.bits_allocated;
    if (bits != 1 && bits != 8 && bits != 16 && bits != 32)
        throw unusable(file.path, "its pixels take " + std::to_string(bits) + " bits; convert it to 8 or 16 bits");
    const DicomBytes read(file.path);
    if (read.big_endian && bits < 16)
        throw unusable(file.path, "its small pixels are stored big endian; convert it to explicit little endian");
    constexpr DicomTag float_pixels = 0x7fe00008, double_pixels = 0x7fe00009;
    const bool fractions = read.set.contains(float_pixels) || read.set.contains(double_pixels);
    if (!read.set.contains(pixel_data) && !fractions)
        throw unusable(file.path, "it holds no pixels (Pixel Data); copy or export it again");
    if (!read.set.contains(pixel_data))
        throw unusable(file.path, "it holds no whole numbers as pixels (Pixel Data); convert it to 16 bits");
    const std::optional<std::string> bytes = within_file(file.path, [&] { return plain_bytes(file, read); });
    if (!bytes) return decoded(file, read);
    const std::uint64_t pixels =
        static_cast<std::uint64_t>(file.rows) * static_cast<std::uint64_t>(file.columns) * file.frames.size();
    const bool packed_bits = bits == 1 && !read.set.fragments(pixel_data);
    const std::uint64_t expected = packed_bits ? (pixels + 7) / 8
                                   : bits == 1 ? pixels
                                               : pixels * static_cast<std::uint64_t>(bits) / 8;
    if (bytes->size() < expected)
        throw damaged(file,
                      std::to_string(bytes->size()) + " bytes where its header promises " + std::to_string(expected));
    if (bits != 1) return values_of_bytes(file, *bytes, read.big_endian != (std::endian::native == std::endian::big));
    cv::Mat frames = frames_of(file, CV_8U);
    if (packed_bits)
        unpack_bits(*bytes, pixels, frames.ptr<std::uint8_t>());
    else
        std::memcpy(frames.data, bytes->data(), pixels);
    return frames;
}

}  // namespace tissuewarp::imaging::detail
