#include "imaging/detail/dicom_object.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <gdcmSequenceOfItems.h>
#include <gdcmUIDGenerator.h>
#include <gdcmWriter.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <sstream>

namespace tissuewarp::imaging::detail {

namespace {

gdcm::Tag gdcm_tag(std::uint32_t tag) {
    return gdcm::Tag(static_cast<std::uint16_t>(tag >> 16U), static_cast<std::uint16_t>(tag));
}

/// With as many digits as 16 characters hold.
std::string decimal(double value) {
    std::array<char, 40> text{};
    for (int digits = 15; digits > 0; --digits)
        if (std::snprintf(text.data(), text.size(), "%.*g", digits, value) <= 16) break;
    return text.data();
}

std::string now(const char* format) {
    const std::time_t time = std::time(nullptr);
    std::tm utc{};
    gmtime_r(&time, &utc);
    std::array<char, 32> text{};
    std::strftime(text.data(), text.size(), format, &utc);
    return text.data();
}

}  // namespace

void DicomObject::bytes(std::uint32_t tag, const char* representation, const void* values, std::size_t size) {
    gdcm::DataElement element(gdcm_tag(tag));
    element.SetVR(gdcm::VR::GetVRType(representation));
    element.SetByteValue(static_cast<const char*>(values), gdcm::VL(static_cast<std::uint32_t>(size)));
    set_.Replace(element);
}

void DicomObject::text(std::uint32_t tag, const char* representation, const std::string& value) {
    std::string even = value;
    if (even.size() % 2 != 0) even += std::string(representation) == "UI" ? '\0' : ' ';
    bytes(tag, representation, even.data(), even.size());
}

void DicomObject::decimals(std::uint32_t tag, const std::vector<double>& values) {
    std::string all;
    for (const double value : values) all.append(all.empty() ? "" : "\\").append(decimal(value));
    text(tag, "DS", all);
}

void DicomObject::whole(std::uint32_t tag, const std::vector<int>& values) {
    std::string all;
    for (const int value : values) all.append(all.empty() ? "" : "\\").append(std::to_string(value));
    text(tag, "IS", all);
}

void DicomObject::us(std::uint32_t tag, const std::vector<std::uint16_t>& values) {
    bytes(tag, "US", values.data(), values.size() * sizeof values[0]);
}

void DicomObject::at(std::uint32_t tag, std::uint32_t pointer) {
    const std::array<std::uint16_t, 2> words{static_cast<std::uint16_t>(pointer >> 16U),
                                             static_cast<std::uint16_t>(pointer)};
    bytes(tag, "AT", words.data(), sizeof words);
}

void DicomObject::ul(std::uint32_t tag, const std::vector<std::uint32_t>& values) {
    bytes(tag, "UL", values.data(), values.size() * sizeof values[0]);
}

void DicomObject::fd(std::uint32_t tag, const std::vector<double>& values) {
    bytes(tag, "FD", values.data(), values.size() * sizeof values[0]);
}

void DicomObject::fl(std::uint32_t tag, float value) {
    bytes(tag, "FL", &value, sizeof value);
}

void DicomObject::of(std::uint32_t tag, const std::vector<float>& values) {
    bytes(tag, "OF", values.data(), values.size() * sizeof values[0]);
}

void DicomObject::sequence(std::uint32_t tag, const std::vector<DicomObject>& items) {
    const gdcm::SmartPointer<gdcm::SequenceOfItems> list = new gdcm::SequenceOfItems;
    list->SetLengthToUndefined();
    for (const DicomObject& object : items) {
        gdcm::Item item;
        item.SetVLToUndefined();
        item.SetNestedDataSet(object.set_);
        list->AddItem(item);
    }
    gdcm::DataElement element(gdcm_tag(tag));
    element.SetVR(gdcm::VR::SQ);
    element.SetValue(*list);
    element.SetVLToUndefined();
    set_.Replace(element);
}

DicomObject derived_object(const DicomOrigin& origin, const char* sop_class, const char* modality,
                           const std::string& series_description) {
    DicomObject object;
    for (const auto& [tag, representation] : std::map<std::uint32_t, const char*>{{0x00080020, "DA"},
                                                                                  {0x00080030, "TM"},
                                                                                  {0x00080050, "SH"},
                                                                                  {0x00080090, "PN"},
                                                                                  {0x00100010, "PN"},
                                                                                  {0x00100020, "LO"},
                                                                                  {0x00100030, "DA"},
                                                                                  {0x00100040, "CS"},
                                                                                  {0x00200010, "SH"}}) {
        const auto value = origin.repeated.find(tag);  // present without a value where it is not known (type 2)
        object.text(tag, representation, value == origin.repeated.end() ? "" : value->second);
    }
    if (const auto set = origin.repeated.find(0x00080005); set != origin.repeated.end())
        object.text(0x00080005, "CS", set->second);
    object.text(0x00080016, "UI", sop_class);
    object.text(0x00080018, "UI", new_uid());
    object.text(0x00080060, "CS", modality);
    object.text(0x00080070, "LO", "tissuewarp");
    object.text(0x0008103e, "LO", series_description);
    object.text(0x00081090, "LO", "tissuewarp");
    object.text(0x00181000, "LO", "0");
    object.text(0x00181020, "LO", TISSUEWARP_VERSION);
    object.text(0x0020000d, "UI", origin.study);
    object.text(0x0020000e, "UI", new_uid());
    object.whole(0x00200011, {1});
    object.whole(0x00200013, {1});
    object.text(0x00200052, "UI", origin.frame_of_reference);
    object.text(0x00201040, "LO", "");
    object.text(0x00080012, "DA", today());
    object.text(0x00080013, "TM", time_of_day());
    return object;
}

void add_content(DicomObject& object, const char* label, const std::string& description) {
    object.text(0x00080023, "DA", today());
    object.text(0x00080033, "TM", time_of_day());
    object.text(0x00700080, "CS", label);
    object.text(0x00700081, "LO", description);
    object.text(0x00700084, "PN", "");
}

DicomObject reference_to(const DicomInstance& instance) {
    DicomObject item;
    item.text(0x00081150, "UI", instance.sop_class);
    item.text(0x00081155, "UI", instance.sop_instance);
    return item;
}

std::vector<DicomObject> references_to(const std::vector<DicomInstance>& instances) {
    std::vector<DicomObject> items;
    for (const DicomInstance& instance : instances) items.push_back(reference_to(instance));
    return items;
}

DicomObject code(const char* value, const char* scheme, const char* meaning) {
    DicomObject item;
    item.text(0x00080100, "SH", value);
    item.text(0x00080102, "SH", scheme);
    item.text(0x00080104, "LO", meaning);
    return item;
}

std::string today() {
    return now("%Y%m%d");
}

std::string time_of_day() {
    return now("%H%M%S");
}

std::string new_uid() {
    gdcm::UIDGenerator generator;
    return generator.Generate();
}

void write_dicom(const DicomObject& object, const std::filesystem::path& path) {
    std::ostringstream stream;  // GDCM does not notice a full disk
    gdcm::Writer writer;
    writer.SetStream(stream);
    writer.GetFile().SetDataSet(object.set());
    writer.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
    if (!writer.Write()) throw IoError("cannot put together '" + path.string() + "': GDCM refuses the object");
    write_file(stream.view(), path);
}

}  // namespace tissuewarp::imaging::detail
