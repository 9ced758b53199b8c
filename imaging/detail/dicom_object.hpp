#pragma once
/// A DICOM object that is put together and written by GDCM, explicit little endian.

#include "imaging/dicom_origin.hpp"

#include <gdcmDataSet.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

/// A data set: an object, or an item of a sequence. Tags are (group << 16) + element.
class DicomObject {
public:
    /// `representation` is the value representation, of text: "UI", "LO", "DA", ...; several values stand between
    /// backslashes.
    void text(std::uint32_t tag, const char* representation, const std::string& value);
    /// Numbers as text of at most 16 characters each (DS).
    void decimals(std::uint32_t tag, const std::vector<double>& values);
    void whole(std::uint32_t tag, const std::vector<int>& values);  ///< IS
    void us(std::uint32_t tag, const std::vector<std::uint16_t>& values);
    void at(std::uint32_t tag, std::uint32_t pointer);
    void ul(std::uint32_t tag, const std::vector<std::uint32_t>& values);
    void fd(std::uint32_t tag, const std::vector<double>& values);
    void fl(std::uint32_t tag, float value);
    void of(std::uint32_t tag, const std::vector<float>& values);
    void sequence(std::uint32_t tag, const std::vector<DicomObject>& items);

    [[nodiscard]] const gdcm::DataSet& set() const { return set_; }

private:
    gdcm::DataSet set_;

    void bytes(std::uint32_t tag, const char* representation, const void* values, std::size_t size);
};

/// An object of this class and modality in a series of its own, in the study and frame of reference of `origin`.
DicomObject derived_object(const DicomOrigin& origin, const char* sop_class, const char* modality,
                           const std::string& series_description);

/// Date, label and description of what was made.
void add_content(DicomObject& object, const char* label, const std::string& description);

/// Items that name instances.
DicomObject reference_to(const DicomInstance& instance);
std::vector<DicomObject> references_to(const std::vector<DicomInstance>& instances);

/// A code as a sequence of one item holds it.
DicomObject code(const char* value, const char* scheme, const char* meaning);

/// The present date (DA) and time (TM), UTC.
std::string today();
std::string time_of_day();

/// A new UID.
std::string new_uid();

/// Complete or absent. Throws IoError.
void write_dicom(const DicomObject& object, const std::filesystem::path& path);

}  // namespace tissuewarp::imaging::detail
