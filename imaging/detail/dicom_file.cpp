#include "imaging/detail/dicom_file.hpp"

#include "imaging/detail/dicom_bits.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/text_headers.hpp"

#include <gdcmDataSet.h>
#include <gdcmPixmapReader.h>
#include <gdcmReader.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

using gdcm::DataSet;
using gdcm::Tag;

const Tag pixel_data(0x7fe0, 0x0010);

const gdcm::ByteValue* bytes_at(const DataSet& set, const Tag& tag) {
    if (!set.FindDataElement(tag)) return nullptr;
    return set.GetDataElement(tag).GetByteValue();
}

std::string text_at(const DataSet& set, const Tag& tag) {
    const gdcm::ByteValue* value = bytes_at(set, tag);
    if (value == nullptr || value->GetPointer() == nullptr) return "";
    std::string text(value->GetPointer(), value->GetLength());
    text.erase(std::remove(text.begin(), text.end(), '\0'), text.end());
    return trimmed(text);
}

/// A whole number of VR US.
int whole_at(const DataSet& set, const Tag& tag, int otherwise) {
    const gdcm::ByteValue* value = bytes_at(set, tag);
    if (value == nullptr || value->GetLength() < sizeof(std::uint16_t)) return otherwise;
    std::uint16_t number = 0;
    std::memcpy(&number, value->GetPointer(), sizeof(number));
    return number;
}

/// The numbers of VR DS or IS, or nothing where there are not `count` (0: any) finite ones.
std::optional<std::vector<double>> numbers_at(const DataSet& set, const Tag& tag, std::size_t count) {
    std::string text = text_at(set, tag);
    std::replace(text.begin(), text.end(), '\\', ' ');
    std::vector<double> numbers = numbers_in(text);
    if (numbers.empty() || (count != 0 && numbers.size() != count)) return std::nullopt;
    if (std::any_of(numbers.begin(), numbers.end(), [](double n) { return !std::isfinite(n); })) return std::nullopt;
    return numbers;
}

std::optional<double> number_at(const DataSet& set, const Tag& tag) {
    const auto numbers = numbers_at(set, tag, 1);
    return numbers ? std::optional((*numbers)[0]) : std::nullopt;
}

std::vector<const DataSet*> items_at(const DataSet& set, const Tag& tag,
                                     std::vector<gdcm::SmartPointer<gdcm::SequenceOfItems>>& keep) {
    std::vector<const DataSet*> items;
    if (!set.FindDataElement(tag)) return items;
    const gdcm::SmartPointer<gdcm::SequenceOfItems> sequence = set.GetDataElement(tag).GetValueAsSQ();
    if (!sequence) return items;
    keep.push_back(sequence);
    for (gdcm::SequenceOfItems::SizeType i = 1; i <= sequence->GetNumberOfItems(); ++i)
        items.push_back(&sequence->GetItem(i).GetNestedDataSet());
    return items;
}

/// Attributes of frames: in their own functional groups, in the shared ones, or, in files of one frame, in the file.
class FrameAttributes {
public:
    explicit FrameAttributes(const DataSet& file) : file_(file) {
        own_ = items_at(file, Tag(0x5200, 0x9230), keep_);
        const auto shared = items_at(file, Tag(0x5200, 0x9229), keep_);
        if (!shared.empty()) shared_ = shared.front();
    }

    DicomFrame frame(std::size_t index) {
        DicomFrame frame;
        if (const auto p = numbers({0x0020, 0x9113}, {0x0020, 0x0032}, index, 3))
            frame.position = Eigen::Vector3d((*p)[0], (*p)[1], (*p)[2]);
        if (const auto a = numbers({0x0020, 0x9116}, {0x0020, 0x0037}, index, 6))
            frame.axes = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(a->data()).colwise().normalized();
        // The distance between rows, that along j, comes first.
        const Tag measures(0x0028, 0x9110);
        if (const auto s = numbers(measures, {0x0028, 0x0030}, index, 2)) frame.spacing = {(*s)[1], (*s)[0]};
        frame.slice_spacing = number(measures, {0x0018, 0x0088}, index);
        if (!frame.slice_spacing) frame.slice_spacing = number(measures, {0x0018, 0x0050}, index);
        const Tag transformation(0x0028, 0x9145);
        frame.intercept = number(transformation, {0x0028, 0x1052}, index).value_or(0.0);
        frame.slope = number(transformation, {0x0028, 0x1053}, index).value_or(1.0);
        if (const auto set = group({0x0020, 0x9111}, index)) frame.stack = text_at(*set, {0x0020, 0x9056});
        if (const auto set = group({0x0062, 0x000a}, index)) frame.segment = whole_at(*set, {0x0062, 0x000b}, 0);
        return frame;
    }

private:
    const DataSet& file_;
    std::vector<gdcm::SmartPointer<gdcm::SequenceOfItems>> keep_;
    std::vector<const DataSet*> own_;
    const DataSet* shared_ = nullptr;

    const DataSet* group(const Tag& sequence, std::size_t index) {
        for (const DataSet* groups : {index < own_.size() ? own_[index] : nullptr, shared_}) {
            if (groups == nullptr) continue;
            const auto items = items_at(*groups, sequence, keep_);
            if (!items.empty()) return items.front();
        }
        return nullptr;
    }
    std::optional<std::vector<double>> numbers(const Tag& sequence, const Tag& tag, std::size_t index,
                                               std::size_t count) {
        if (const DataSet* set = group(sequence, index))
            if (auto found = numbers_at(*set, tag, count)) return found;
        return numbers_at(file_, tag, count);
    }
    std::optional<double> number(const Tag& sequence, const Tag& tag, std::size_t index) {
        const auto found = numbers(sequence, tag, index, 1);
        return found ? std::optional((*found)[0]) : std::nullopt;
    }
};

/// Planes of a dose (RT Dose): offsets along the normal from the one position of the file.
void place_dose_planes(const DataSet& set, std::vector<DicomFrame>& frames) {
    if (const auto scaling = number_at(set, Tag(0x3004, 0x000e)))
        for (DicomFrame& frame : frames) frame.slope = *scaling;
    const auto offsets = numbers_at(set, Tag(0x3004, 0x000c), frames.size());
    if (!offsets || !frames[0].position || !frames[0].axes) return;
    const Eigen::Vector3d row = frames[0].axes->col(0), column = frames[0].axes->col(1);
    const Eigen::Vector3d normal(row[1] * column[2] - row[2] * column[1], row[2] * column[0] - row[0] * column[2],
                                 row[0] * column[1] - row[1] * column[0]);
    for (std::size_t i = 0; i < frames.size(); ++i)
        frames[i].position = *frames[0].position + ((*offsets)[i] - (*offsets)[0]) * normal;
}

void read_segments(const DataSet& set, DicomFile& file) {
    const std::string type = text_at(set, Tag(0x0062, 0x0001));
    if (type == "FRACTIONAL") file.segmentation = DicomFile::Segmentation::Fractional;
    if (type == "BINARY") file.segmentation = DicomFile::Segmentation::Binary;
    if (type == "LABELMAP") file.segmentation = DicomFile::Segmentation::LabelMap;
    if (file.segmentation == DicomFile::Segmentation::None) return;
    file.most_fraction = whole_at(set, Tag(0x0062, 0x000e), 255);
    std::vector<gdcm::SmartPointer<gdcm::SequenceOfItems>> keep;
    for (const DataSet* segment : items_at(set, Tag(0x0062, 0x0002), keep))
        file.segment_names[whole_at(*segment, Tag(0x0062, 0x0004), 0)] = text_at(*segment, Tag(0x0062, 0x0005));
}

/// The transfer syntax that a file's own header names, or "".
std::string transfer_syntax_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::string head(2048, '\0');
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(file.gcount()));
    const std::string element("\x02\x00\x10\x00UI", 6);
    const auto at = head.find(element);
    if (at == std::string::npos || at + 8 > head.size()) return "";
    const auto length = static_cast<unsigned char>(head[at + 6]);
    return std::string(head.substr(at + 8, length).c_str());
}

IoError not_dicom(const fs::path& path) {
    const std::string syntax = transfer_syntax_of(path);
    return IoError("cannot read '" + path.string() + "' as DICOM: it is damaged" +
                   (syntax.empty() ? "" : ", or its transfer syntax (" + syntax + ") is not known") +
                   "; copy the file again, or convert it to explicit little endian");
}

/// GDCM fills truncated pixels with what it finds and goes on. Skipping the pixel data by their stated length must not
/// lead beyond the end of the file.
void require_whole(const fs::path& path) {
    gdcm::Reader reader;
    reader.SetFileName(path.c_str());
    const Tag just_before(0x7fe0, 0x000f);
    if (!reader.ReadUpToTag(just_before, {pixel_data})) throw not_dicom(path);
    const auto& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
    // Compressed frames carry their own lengths, which the decoder checks; deflated files have no positions.
    if (syntax.IsEncapsulated() || syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) return;
    const std::uint64_t expected = reader.GetStreamCurrentPosition(), found = fs::file_size(path);
    if (found < expected)
        throw IoError("'" + path.string() + "' is cut short: " + std::to_string(found) + " bytes of " +
                      std::to_string(expected) + "; copy the file again");
}

IoError damaged(const DicomFile& file, const std::string& cause) {
    return IoError("cannot read the pixels of '" + file.path.string() + "': " + cause + "; copy or convert the file");
}

int opencv_depth(const gdcm::PixelFormat& format) {
    switch (format.GetScalarType()) {
        case gdcm::PixelFormat::UINT8:
            return CV_8U;
        case gdcm::PixelFormat::INT8:
            return CV_8S;
        case gdcm::PixelFormat::UINT12:
        case gdcm::PixelFormat::UINT16:
            return CV_16U;
        case gdcm::PixelFormat::INT12:
        case gdcm::PixelFormat::INT16:
            return CV_16S;
        case gdcm::PixelFormat::INT32:
            return CV_32S;
        case gdcm::PixelFormat::UINT32:
            return CV_64F;
        default:
            return -1;
    }
}

cv::Mat frames_of(const DicomFile& file, int depth) {
    const int sizes[3] = {static_cast<int>(file.frames.size()), file.rows, file.columns};
    return {3, sizes, CV_MAKETYPE(depth, 1)};
}

/// One bit a pixel, which GDCM does not decode.
cv::Mat read_bits(const DicomFile& file) {
    gdcm::Reader reader;
    reader.SetFileName(file.path.c_str());
    if (!reader.Read() || !reader.GetFile().GetDataSet().FindDataElement(pixel_data))
        throw damaged(file, "the file is cut short");
    const gdcm::DataElement& pixels = reader.GetFile().GetDataSet().GetDataElement(pixel_data);
    cv::Mat frames = frames_of(file, CV_8U);
    const std::size_t per_frame = static_cast<std::size_t>(file.rows) * static_cast<std::size_t>(file.columns);
    if (const gdcm::ByteValue* value = pixels.GetByteValue()) {
        const std::string bytes(value->GetPointer(), value->GetLength());
        if (!unpack_bits(bytes, 0, per_frame * file.frames.size(), frames.ptr<std::uint8_t>()))
            throw damaged(file, std::to_string(bytes.size()) + " bytes are too few for its frames");
        return frames;
    }
    const gdcm::SequenceOfFragments* fragments = pixels.GetSequenceOfFragments();
    const auto& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
    if (fragments == nullptr || syntax != gdcm::TransferSyntax::RLELossless)
        throw unusable(file.path, "its bits are packed as '" + std::string(gdcm::TransferSyntax::GetTSString(syntax)) +
                                      "', which is not read; convert it to an uncompressed transfer syntax");
    if (fragments->GetNumberOfFragments() != file.frames.size())
        throw damaged(file, std::to_string(fragments->GetNumberOfFragments()) + " packed frames of " +
                                std::to_string(file.frames.size()));
    for (std::size_t k = 0; k < file.frames.size(); ++k) {
        const gdcm::ByteValue* value = fragments->GetFragment(k).GetByteValue();
        const std::string packed = value == nullptr ? "" : std::string(value->GetPointer(), value->GetLength());
        if (!unpack_bits(unpack_rle(packed), 0, per_frame, frames.ptr<std::uint8_t>(static_cast<int>(k))))
            throw damaged(file, "frame " + std::to_string(k + 1) + " is cut short");
    }
    return frames;
}

/// Label maps, whose kind GDCM does not know, as they lie in the file: 8 or 16 bits.
cv::Mat read_label_map(const DicomFile& file) {
    gdcm::Reader reader;
    reader.SetFileName(file.path.c_str());
    if (!reader.Read()) throw not_dicom(file.path);
    const gdcm::ByteValue* value = bytes_at(reader.GetFile().GetDataSet(), pixel_data);
    if (value == nullptr || (file.bits_allocated != 8 && file.bits_allocated != 16))
        throw unusable(file.path,
                       "its label map is packed or not of 8 or 16 bits; convert it to explicit little endian");
    cv::Mat frames = frames_of(file, file.bits_allocated == 8 ? CV_8U : CV_16U);
    const std::size_t bytes = frames.total() * frames.elemSize();
    if (value->GetLength() < bytes)
        throw damaged(file,
                      std::to_string(value->GetLength()) + " bytes where its header promises " + std::to_string(bytes));
    std::memcpy(frames.data, value->GetPointer(), bytes);
    return frames;
}

}  // namespace

std::optional<DicomFile> read_dicom_file(const fs::path& path) {
    // What the library would print becomes an exception here.
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    gdcm::Reader reader;
    reader.SetFileName(path.c_str());
    if (!reader.ReadUpToTag(pixel_data) && !reader.Read()) throw not_dicom(path);
    const DataSet& set = reader.GetFile().GetDataSet();
    DicomFile file;
    file.path = path;
    file.rows = whole_at(set, Tag(0x0028, 0x0010), 0);
    file.columns = whole_at(set, Tag(0x0028, 0x0011), 0);
    if (file.rows == 0 || file.columns == 0) return std::nullopt;
    file.series = text_at(set, Tag(0x0020, 0x000e));
    file.modality = text_at(set, Tag(0x0008, 0x0060));
    file.kind = text_at(set, Tag(0x0008, 0x0016));
    file.samples = whole_at(set, Tag(0x0028, 0x0002), 1);
    file.bits_allocated = whole_at(set, Tag(0x0028, 0x0100), 0);
    file.bits_stored = whole_at(set, Tag(0x0028, 0x0101), file.bits_allocated);
    file.is_signed = whole_at(set, Tag(0x0028, 0x0103), 0) != 0;
    file.mosaic = text_at(set, Tag(0x0008, 0x0008)).find("MOSAIC") != std::string::npos;
    const double frames = number_at(set, Tag(0x0028, 0x0008)).value_or(1.0);
    values_of(path, {frames, 1.0 * file.rows, 1.0 * file.columns});
    FrameAttributes attributes(set);
    for (std::size_t i = 0; i < static_cast<std::size_t>(frames); ++i) file.frames.push_back(attributes.frame(i));
    if (file.modality == "RTDOSE") place_dose_planes(set, file.frames);
    read_segments(set, file);
    return file;
}

cv::Mat read_dicom_pixels(const DicomFile& file) {
    require_whole(file.path);
    if (file.samples != 1) throw unusable(file.path, "it is a colour image; give a grey one");
    if (file.bits_allocated == 1) return read_bits(file);
    if (file.segmentation == DicomFile::Segmentation::LabelMap) return read_label_map(file);
    if (file.bits_allocated != 8 && file.bits_allocated != 16 && file.bits_allocated != 32)
        throw unusable(file.path,
                       "its pixels take " + std::to_string(file.bits_allocated) + " bits; convert it to 8 or 16 bits");
    gdcm::PixmapReader reader;
    reader.SetFileName(file.path.c_str());
    if (!reader.Read()) throw damaged(file, "they are missing, cut short or of a transfer syntax that is not known");
    const gdcm::Pixmap& pixmap = reader.GetPixmap();
    const int depth = opencv_depth(pixmap.GetPixelFormat());
    if (depth < 0)
        throw unusable(file.path, "its pixels are of type " +
                                      std::string(pixmap.GetPixelFormat().GetScalarTypeAsString()) +
                                      "; convert it to 16 bits");
    cv::Mat frames = frames_of(file, depth);
    const bool wide = depth == CV_64F;  // uint32
    std::vector<std::uint32_t> buffer(wide ? frames.total() : 0);
    const std::size_t bytes = frames.total() * (wide ? sizeof(std::uint32_t) : frames.elemSize());
    if (pixmap.GetBufferLength() != bytes)
        throw damaged(file, std::to_string(pixmap.GetBufferLength()) + " bytes where its header promises " +
                                std::to_string(bytes));
    char* target = wide ? reinterpret_cast<char*>(buffer.data()) : reinterpret_cast<char*>(frames.data);
    if (!pixmap.GetBuffer(target)) throw damaged(file, "they are cut short or damaged");
    if (wide) std::copy(buffer.begin(), buffer.end(), frames.ptr<double>());
    return frames;
}

}  // namespace tissuewarp::imaging::detail
