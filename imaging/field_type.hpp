#pragma once
/// Which points the vectors of a displacement field carry.

namespace tissuewarp::imaging {

/// In the words of 3D Slicer, whose NRRD files say so by the key `displacement field type`.
enum class FieldType {
    Resampling,  ///< points of the fixed image to where they lie in the moving one: what resamplers ask
    Modeling     ///< points of the moving image to where they lie in the fixed one: what moves points and meshes
};

/// "resampling" or "modeling".
constexpr const char* name_of(FieldType type) {
    return type == FieldType::Resampling ? "resampling" : "modeling";
}

}  // namespace tissuewarp::imaging
